# SPDX-License-Identifier: GPL-3.0-or-later
"""Draw the picture of docs/offsets.md: curves at constant distances, and at a varying one.

python -m docs.examples.offsets docs/images/offsets.png
"""

import sys
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

import nicmm_core as nicmm
from benchmarks import renders
from benchmarks.scale import Scale
from nicmm_core import shapes


def nearest(mesh, places):
    """Vertices of the mesh nearest to places."""
    return cKDTree(mesh.vertices).query(np.array(places))[1]


def picture(title, mesh, places, distances, **options):
    """A designed curve in blue, and its offsets at the distances in orange."""
    designer = nicmm.Designer(mesh)
    curve = designer.design(nearest(mesh, places), **options).curves[0]
    found = designer.offset_curves(curve, distances)
    print(title, [len(curves) for curves in found])
    shown = [(curve, renders.BLUE)]
    return renders.Picture(
        title, mesh, shown + [(each, renders.ORANGE) for curves in found for each in curves]
    )


angle = np.linspace(0.0, 2.0 * np.pi, 7)[:-1]
radius = np.where(np.arange(6) % 2, 0.95, 0.35)
star = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
star = np.column_stack([star, np.sqrt(1.0 - (star**2).sum(axis=1))])
wave = np.array([[-0.9, 0.1], [-0.45, 0.35], [0.0, -0.05], [0.45, 0.35], [0.9, 0.1]])
wave = np.column_stack([wave, np.sqrt(1.0 - (wave**2).sum(axis=1))])
step = 0.12
pictures = [
    picture("both sides of a loop", shapes.sphere(5), star, [step, 2 * step, -step, -2 * step]),
    picture(
        "one distance for each point",
        shapes.sphere(5),
        wave,
        [[0.04, 0.3, 0.04, 0.3, 0.04], [-0.3, -0.04, -0.3, -0.04, -0.3]],
        closed=False,
    ),
]
towards = np.array([0.0, -0.4, 0.92])
right = np.array([1.0, 0.0, 0.0])
view = np.stack([right, np.cross(towards, right), towards])
renders.render_sheet(pictures, Path(sys.argv[1]), Scale.FULL, views=[view] * 2)
