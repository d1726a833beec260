"""A symmetric neckline with a corner at its lowest point."""

import sys

import numpy as np

import nicmm_core as nicmm
from docs.gallery import models

path = sys.argv[1]

mesh = models.dress_form()
middle = mesh.vertices[models.nearest(mesh, [(0, -0.35, 0.78)])[0]] * [0, 1, 1]
places = np.array([middle, (0.16, -0.14, 1.08), (0.0, 0.2, 1.14)])
on_surface = mesh.vertices[models.nearest(mesh, places)]
on_surface[[0, 2], 0] = 0.0
points = nicmm.nearest_points(mesh, on_surface)[0]
neckline = nicmm.design_curve(mesh, points, mirror=((0, 0, 0), (1, 0, 0)), corners=[0])
nicmm.plot(mesh, neckline, path, view=(0.3, -1.0, 0.5), up=(0, 0, 1))
