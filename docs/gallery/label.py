"""A label with rounded and sharp corners on a bottle."""

import sys

import numpy as np

import nicmm_core as nicmm
from docs.gallery import models

path = sys.argv[1]

mesh = models.bottle()
angle = np.radians([-40, 40, 40, -40])
height = np.array([0.3, 0.3, 0.8, 0.8])
places = np.stack([0.36 * np.sin(angle), -0.36 * np.cos(angle), height], axis=1)
points = models.nearest(mesh, places)
round_label = nicmm.design_curve(mesh, points)
sharp_label = nicmm.design_curve(mesh, points, corners=[0, 1, 2, 3])
nicmm.plot(mesh, [round_label, sharp_label], path, view=(0.3, -1.0, 0.3), up=(0, 0, 1))
