# SPDX-License-Identifier: GPL-3.0-or-later
"""Draw the picture of docs/symmetry.md: the same points with a mirror and without.

python -m docs.examples.symmetry docs/images/symmetry.png
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

import nicmm_core as nicmm
from benchmarks import renders
from benchmarks.scale import Scale
from nicmm_core import shapes

MIRROR = ((0, 0, 0), (1, 0, 0))

mesh = shapes.double_torus(faces=1500, subdivisions=2)
given = cKDTree(mesh.vertices).query([[0.35, 0.35, 0.3], [1.3, 0.1, 0.2], [0.7, -0.5, 0.3]])[1]

plain = nicmm.design_curve(mesh, given)
symmetric = nicmm.design_curve(mesh, given, mirror=MIRROR)
for design in (plain, symmetric):
    print(design.status)

(curve,) = symmetric.curves
points = curve.control_index
images = curve.points[points[len(given) :]]
towards = np.array([0.0, -0.5, 0.9])
right = np.array([1.0, 0.0, 0.0])
view = np.stack([right, np.cross(towards, right), towards])
picture = renders.Picture(
    "white: without, orange: with a mirror",
    mesh,
    [
        (replace(curve, control_index=points[: len(given)]), renders.ORANGE),
        (plain.curves[0], renders.WHITE),
    ],
    marks=images,
)
renders.render_sheet([picture], Path(sys.argv[1]), Scale.FULL, views=[view])
