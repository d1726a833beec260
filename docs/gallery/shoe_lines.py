"""Lines on a shoe last that avoid each other."""

import sys

import nicmm_core as nicmm
from docs.gallery import models

path = sys.argv[1]

mesh = models.shoe()
designer = nicmm.Designer(mesh)
top = [(0.15, 0.4, 0.42), (0, 0.22, 0.45), (-0.15, 0.4, 0.42), (0, 0.56, 0.45)]
vamp = [(0.17, 0.0, 0.05), (0.0, -0.12, 0.32), (-0.2, 0.0, 0.05)]
cap = [(0.14, -0.45, 0.05), (-0.03, -0.42, 0.3), (-0.22, -0.45, 0.05)]
curves = [designer.design(models.nearest(mesh, top))]
for places in (vamp, cap):
    points = models.nearest(mesh, places)
    curves.append(designer.design(points, closed=False, avoid=curves, clearance=0.03))
nicmm.plot(mesh, curves, path, view=(0.8, -0.8, 0.6), up=(0, 0, 1))
