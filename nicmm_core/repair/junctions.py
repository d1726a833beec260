"""Makes a curve meet avoided curves at its junctions only.

The barrier along an avoided curve has a narrow gap at a junction (`off_curves`). There a curve may
cross the avoided one also beside the junction, by less than the width of the gap.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.curve import SurfaceCurve
from ..geometry.mesh import Mesh


def straight_at_junctions(
    mesh: Mesh, curve: SurfaceCurve, controls: IntArray, reach: FloatArray
) -> SurfaceCurve:
    """Replace the parts of a curve on both sides of some junctions by straight segments.

    A segment in a face meets a straight line through one of its ends there only, so it cannot cross
    a curve through the junction.

    Parameters
    ----------
    mesh : Mesh
    curve : SurfaceCurve
    controls : (j,) int array
        Points of the curve that are junctions.
    reach : (j,) float array
        Distance from each junction that the segments should have at least, if they find room in
        the faces at the junction.
    """
    kept = np.ones(len(curve.faces), dtype=bool)
    for control, least in zip(controls.tolist(), reach.tolist(), strict=True):
        for step in (-1, 1):
            _leave_out(mesh, curve, control, step, least, kept)
    index = np.cumsum(kept) - 1
    passed = curve.control_index
    return replace(
        curve,
        faces=curve.faces[kept],
        barycentric=curve.barycentric[kept],
        points=curve.points[kept],
        control_index=np.where(passed >= 0, index[passed], passed),
    )


def _leave_out(
    mesh: Mesh, curve: SurfaceCurve, control: int, step: int, least: float, kept: BoolArray
) -> None:
    """Mark the points between a junction and the first one, on one side, beyond a distance."""
    n = len(curve.faces)
    between: list[int] = []
    found: list[int] = []
    here = control
    while True:
        here += step
        if not (curve.closed or 0 <= here < n) or here % n == control:
            break
        point = here % n
        if not _have_common_face(mesh, curve, control, point):
            break
        found = between.copy()
        away = np.linalg.norm(curve.points[point] - curve.points[control])
        if away >= least or point in curve.control_index:
            break
        between.append(point)
    kept[found] = False


def _have_common_face(mesh: Mesh, curve: SurfaceCurve, one: int, other: int) -> bool:
    """Whether two points of a curve lie in a common face."""
    pair = np.array([one, other])
    used = curve.barycentric[pair] > 0.0
    return len(mesh.faces_with(np.unique(mesh.faces[curve.faces[pair]][used]))) > 0
