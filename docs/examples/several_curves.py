# SPDX-License-Identifier: GPL-3.0-or-later
"""Draw the picture of docs/several_curves.md: curves that do not cross each other.

python -m docs.examples.several_curves docs/images/several_curves.png
"""

import sys
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

import nicmm_core as nicmm
from benchmarks import renders
from benchmarks.scale import Scale
from nicmm_core import shapes

CLEARANCE = 0.08


def on_torus(around, across):
    """Points of the torus by their angles about its axis and about its tube, in degrees."""
    u, v = np.radians(around), np.radians(across)
    radius = 1.0 + 0.4 * np.cos(v)
    return np.stack([radius * np.cos(u), radius * np.sin(u), 0.4 * np.sin(v)], axis=-1)


mesh = shapes.torus(major=1.0, minor=0.4)
designer = nicmm.Designer(mesh)
vertices = cKDTree(mesh.vertices)
curves: list[nicmm.SurfaceCurve] = []


def design(points, closed=False):
    """Design the next curve."""
    given = {"avoid": curves, "clearance": CLEARANCE} if curves else {}
    found = designer.design(points, closed=closed, **given)
    print(found.status)
    curves.append(found.curves[0])
    return found.curves[0]


def nearest(around, across):
    """Vertices of the torus near some angles."""
    return mesh.vertices[vertices.query(on_torus(np.array(around), np.array(across)))[1]]


blue = design(nearest([-160.0, -120.0, -60.0, -20.0], [40.0, 95.0, 50.0, 95.0]))
orange = design(nearest([-160.0, -120.0, -60.0, -20.0], [10.0, 75.0, 30.0, 75.0]))
green = design(nearest([-160.0, -115.0, -60.0, -20.0], [-15.0, 50.0, 8.0, 50.0]))
yellow = design(nearest([-100.0, -80.0, -70.0], [125.0, 140.0, 110.0]), closed=True)
white = design(np.stack([each.points[each.control_index[2]] for each in (blue, orange, green)]))

towards = np.array([0.0, -0.6, 0.8])
right = np.array([1.0, 0.0, 0.0])
view = np.stack([right, np.cross(towards, right), towards])
colours = [renders.BLUE, renders.ORANGE, renders.GREEN, renders.YELLOW, renders.WHITE]
picture = renders.Picture(
    "each curve avoids those before it", mesh, list(zip(curves, colours, strict=True))
)
renders.render_sheet([picture], Path(sys.argv[1]), Scale.FULL, views=[view])
