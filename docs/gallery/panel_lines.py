"""Panel lines on a car: a bonnet with corners, and a symmetric roof line."""

import sys

import nicmm_core as nicmm
from docs.gallery import models

path = sys.argv[1]

mesh = models.car()
designer = nicmm.Designer(mesh)
bonnet = [(-0.32, -0.85, 0.45), (0.32, -0.85, 0.45), (0.3, -0.35, 0.5), (-0.3, -0.35, 0.5)]
lines = [designer.design(models.nearest(mesh, bonnet), corners=[0, 1, 2, 3])]
roof = [(-0.22, -0.1, 0.66), (0.22, -0.1, 0.66), (0.22, 0.45, 0.68), (-0.22, 0.45, 0.68)]
lines.append(designer.design(models.nearest(mesh, roof), avoid=lines, clearance=0.02))
nicmm.plot(mesh, lines, path, view=(-0.6, -1.0, 0.9), up=(0, 0, 1))
