"""A line around a car, aligned with a painted height."""

import sys

import numpy as np

import nicmm_core as nicmm
from docs.gallery import models

path = sys.argv[1]

mesh = models.car()
line = np.exp(-(((mesh.vertices[:, 2] - 0.33) / 0.03) ** 2))
places = [(0, -1.1, 0.33), (0.5, 0, 0.33), (0, 1.15, 0.33), (-0.5, 0, 0.33)]
points = models.nearest(mesh, places)
waist = nicmm.design_curve(mesh, points, alignment=line)
nicmm.plot(mesh, waist, path, view=(-0.8, -1.0, 0.5), up=(0, 0, 1))
