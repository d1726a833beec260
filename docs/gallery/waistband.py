"""A waistband: a curve, and two parallel curves 4 cm from it."""

import sys

import numpy as np

import nicmm_core as nicmm
from docs.gallery import models

path = sys.argv[1]

mesh = models.dress_form()
angle = np.radians([0, 90, 180, 270])
ring = np.stack([0.3 * np.cos(angle), 0.3 * np.sin(angle), 0.42 + 0.0 * angle], axis=1)
designer = nicmm.Designer(mesh)
waist = designer.design(models.nearest(mesh, ring))
above, below = designer.offset_curves(waist, [0.04, -0.04])
nicmm.plot(mesh, [waist, *above, *below], path, view=(0.5, -1.0, 0.3), up=(0, 0, 1))
