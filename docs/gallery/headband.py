"""A headband, whose points are given in any order."""

import sys

import nicmm_core as nicmm
from docs.gallery import models

path = sys.argv[1]

mesh = models.head()
places = [(0, -0.45, 0.35), (0, 0.5, 0.0), (0.5, 0.05, 0.2), (-0.5, 0.05, 0.2)]
band = nicmm.design_curve(mesh, models.nearest(mesh, places), order="shortest")
nicmm.plot(mesh, band, path, view=(0.6, -1.0, 0.6), up=(0, 0, 1))
