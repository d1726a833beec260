"""A road over hills: straight on the map, and with the bending of the ground."""

import sys

import nicmm_core as nicmm
from docs.gallery import models

path = sys.argv[1]

mesh = models.terrain()
points = models.nearest(mesh, [(-0.9, -0.8, 0), (0.1, 0.1, 0), (0.9, 0.8, 0)])
straight = nicmm.design_curve(mesh, points, closed=False)
road = nicmm.design_curve(mesh, points, closed=False, normal_bending=1.0)
nicmm.plot(mesh, [straight, road], path, view=(0.2, -1.0, 0.7), up=(0, 0, 1))
