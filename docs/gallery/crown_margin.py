"""The margin of a prepared tooth, found from one click."""

import sys

import nicmm_core as nicmm
from docs.gallery import models

path = sys.argv[1]

mesh = models.tooth()
points = nicmm.feature_loop(mesh, mesh.vertices[models.nearest(mesh, [(0.53, 0, 0.05)])[0]])
margin = nicmm.design_curve(mesh, points)
nicmm.plot(mesh, margin, path, view=(0.6, -1.0, 0.7), up=(0, 0, 1))
