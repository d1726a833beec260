"""A line between the fingers, along the webs, by few points."""

import sys

import nicmm_core as nicmm
from docs.gallery import models

path = sys.argv[1]

mesh = models.hand()
places = [(-0.45, -0.1, 0.1), (-0.17, 0.0, 0.5), (0, 0.0, 0.52), (0.17, 0.0, 0.5), (0.33, 0.0, 0.3)]
points = models.nearest(mesh, places)
line = nicmm.design_curve(mesh, points, closed=False, smoothness=0.5)
nicmm.plot(mesh, line, path, view=(0.1, -1.0, 0.5), up=(0, 0, 1))
