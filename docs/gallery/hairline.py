"""A hairline around the ears, which are obstacles with a distance to keep."""

import sys

import numpy as np

import nicmm_core as nicmm
from docs.gallery import models

path = sys.argv[1]

mesh = models.head()
places = [(0, -0.48, 0.3), (0.36, 0.3, -0.3), (0, 0.5, -0.2), (-0.36, 0.3, -0.3)]
points = models.nearest(mesh, places)
ears = (np.abs(mesh.vertices[:, 0]) > 0.515).astype(float)
line = nicmm.design_curve(mesh, points, obstacles=ears, clearance=0.05)
nicmm.plot(mesh, line, path, view=(1.0, -0.1, 0.2), up=(0, 0, 1))
