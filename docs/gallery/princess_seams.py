"""Princess seams on both sides, by a seam and its mirror image."""

import sys

import nicmm_core as nicmm
from docs.gallery import models

path = sys.argv[1]

mesh = models.dress_form()
places = [(0.17, -0.1, 1.08), (0.13, -0.32, 0.82), (0.1, -0.25, 0.5), (0.13, -0.3, 0.1)]
seam = nicmm.design_curve(mesh, models.nearest(mesh, places), closed=False)
other = nicmm.mirrored(mesh, seam, ((0, 0, 0), (1, 0, 0)))
nicmm.plot(mesh, [seam, other], path, view=(0.3, -1.0, 0.2), up=(0, 0, 1))
