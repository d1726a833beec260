"""The split line of a mould: over the cup and through the middle of its handle."""

import sys

import nicmm_core as nicmm
from docs.gallery import models

path = sys.argv[1]

mesh = models.mug()
places = [(-0.42, 0, 0.4), (0.0, 0.0, 0.95), (0.76, 0, 0.45), (0.0, 0.0, 0.0)]
points = models.nearest(mesh, places)
line = nicmm.design_curve(mesh, points)
nicmm.plot(mesh, line, path, view=(0.4, -1.0, 0.5), up=(0, 0, 1))
