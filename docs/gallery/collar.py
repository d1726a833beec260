"""A collar line on a dress form, of six points around the neck."""

import sys

import numpy as np

import nicmm_core as nicmm
from docs.gallery import models

path = sys.argv[1]

mesh = models.dress_form()
angle = np.radians([0, 60, 120, 180, 240, 300])
ring = np.stack([0.2 * np.sin(angle), -0.16 * np.cos(angle), 1.1 - 0.08 * np.cos(angle)], axis=1)
collar = nicmm.design_curve(mesh, models.nearest(mesh, ring))
nicmm.plot(mesh, collar, path, view=(0.5, -1.0, 0.4), up=(0, 0, 1))
