"""A strap that hangs together with the body: with and without normal bending."""

import sys

import nicmm_core as nicmm
from docs.gallery import models

path = sys.argv[1]

mesh = models.dress_form()
places = [(0.2, -0.05, 1.1), (-0.3, -0.1, 0.3), (0.1, 0.25, 0.6)]
points = models.nearest(mesh, places)
flat = nicmm.design_curve(mesh, points)
strap = nicmm.design_curve(mesh, points, normal_bending=1.0)
nicmm.plot(mesh, [flat, strap], path, view=(0.2, -1.0, 0.3), up=(0, 0, 1))
