# SPDX-License-Identifier: GPL-3.0-or-later
"""Draw the picture of docs/via_points.md: the same control points without and with via points.

python -m docs.examples.via_points docs/images/via-points.png
"""

import sys
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

import nicmm_core as nicmm
from benchmarks import renders
from benchmarks.scale import Scale
from nicmm_core import shapes


def on_torus(around, across):
    """Points of the torus by their angles about its axis and about its tube, in degrees."""
    u, v = np.radians(around), np.radians(across)
    radius = 1.0 + 0.4 * np.cos(v)
    return np.stack([radius * np.cos(u), radius * np.sin(u), 0.4 * np.sin(v)], axis=-1)


mesh = shapes.torus(major=1.0, minor=0.4)
vertices = cKDTree(mesh.vertices)
control_points = vertices.query(on_torus([-130.0, -90.0, -50.0], [40.0, 20.0, 40.0]))[1]
round_the_hole = vertices.query(on_torus([20.0, 90.0, 160.0], [60.0, 110.0, 60.0]))[1]

without = nicmm.design_curve(mesh, control_points)
with_via = nicmm.design_curve(mesh, control_points, via_points={2: round_the_hole})
for design in (without, with_via):
    print(design.status)

towards = np.array([0.0, -0.6, 0.8])
right = np.array([1.0, 0.0, 0.0])
view = np.stack([right, np.cross(towards, right), towards])
picture = renders.Picture(
    "white: without, orange: with via points",
    mesh,
    [(without.curves[0], renders.WHITE), (with_via.curves[0], renders.ORANGE)],
    marks=mesh.vertices[round_the_hole],
)
renders.render_sheet([picture], Path(sys.argv[1]), Scale.FULL, views=[view])
