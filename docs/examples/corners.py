# SPDX-License-Identifier: GPL-3.0-or-later
"""Draw the picture of docs/corners.md: the same control points without and with corners.

python -m docs.examples.corners docs/images/corners.png
"""

import sys
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

import nicmm_core as nicmm
from benchmarks import renders
from benchmarks.scale import Scale
from nicmm_core import shapes


def on_ball(sideways, upwards):
    """Points of the unit sphere by their longitude and latitude, in degrees."""
    u, v = np.radians(sideways), np.radians(upwards)
    return np.stack([np.cos(v) * np.sin(u), -np.cos(v) * np.cos(u), np.sin(v)], axis=-1)


def picture(title, sideways, upwards, corners):
    """Curves through the vertices nearest to places, without corners and with some."""
    points = vertices.query(on_ball(sideways, upwards))[1]
    without = nicmm.design_curve(mesh, points)
    with_corners = nicmm.design_curve(mesh, points, corners=corners)
    print(without.status, with_corners.status, sep="; ")
    curves = [(without.curves[0], renders.WHITE), (with_corners.curves[0], renders.ORANGE)]
    return renders.Picture(title, mesh, curves)


mesh = shapes.sphere(5)
vertices = cKDTree(mesh.vertices)
pictures = [
    picture("two corners", [-60, -30, 30, 60, 25, -25], [8, 38, 38, 8, -22, -22], [0, 3]),
    picture("three corners", [-48, 0, 48, 30, 0, -30], [38, 26, 38, -10, -52, -10], [0, 2, 4]),
]
towards, right = np.array([0.0, -1.0, 0.0]), np.array([1.0, 0.0, 0.0])
view = np.stack([right, np.cross(towards, right), towards])
renders.render_sheet(pictures, Path(sys.argv[1]), Scale.FULL, views=[view, view])
