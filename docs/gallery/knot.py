"""One curve along the whole tube of a knot, and another one around it."""

import sys

import nicmm_core as nicmm
from docs.gallery import models

path = sys.argv[1]

mesh = models.knot()
rings = mesh.vertices.reshape(320, 24, 3)
along = nicmm.design_curve(mesh, models.nearest(mesh, rings[::20, 6]))
around = nicmm.design_curve(mesh, models.nearest(mesh, rings[5, ::8]))
nicmm.plot(mesh, [along, around], path, view=(0.2, -0.3, 1.0), up=(0, 1, 0))
