"""The outline of a mask, symmetric, of four points on one side."""

import sys

import numpy as np

import nicmm_core as nicmm
from docs.gallery import models

path = sys.argv[1]

mesh = models.head()
places = [(0.0, -0.5, 0.35), (0.3, -0.4, 0.2), (0.32, -0.36, -0.1), (0.0, -0.62, -0.12)]
points = nicmm.nearest_points(mesh, np.array(places))[0].positions(mesh)
points[[0, 3], 0] = 0.0
mask = nicmm.design_curve(
    mesh, nicmm.nearest_points(mesh, points)[0], mirror=((0, 0, 0), (1, 0, 0)), smoothness=3.0
)
nicmm.plot(mesh, mask, path, view=(0.5, -1.0, 0.1), up=(0, 0, 1))
