"""Whether a curve meets avoided curves elsewhere than at junctions, or comes too close to them.

The barrier along an avoided curve has a narrow gap at a junction. There a curve may cross the
avoided one also beside the junction, by less than the width of the gap; it is made straight there.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.distance import cdist

from ..errors import UnreachableError
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.crossings import meeting_places
from ..geometry.curve import SurfaceCurve
from ..geometry.mesh import Mesh
from ..geometry.segment_distances import segments_of
from ..geometry.surface_points import SurfacePoints
from ..repair.mapped_mesh import MappedMesh
from .avoided_curve import Avoided, gap_width
from .clearance import distances_near, segments_with_clearance

MEETING = 1e-8
"""Greatest distance between a control point and the place at which the curve may meet an avoided
curve, in bounding-box diagonals."""

STRAIGHT = 2.0
"""Distance from a junction up to which a curve is made straight, if necessary; in such widths."""


def meeting_only_at_junctions(
    mesh: Mesh, curve: SurfaceCurve, avoided: list[Avoided], clearance: float
) -> SurfaceCurve:
    """A curve that meets avoided curves only at its junctions.

    If a curve crosses an avoided one beside a junction, it is made straight there.

    Raises
    ------
    UnreachableError
        If it also crosses one elsewhere.
    """
    if _crossed(mesh, curve, avoided) is None:
        return curve
    controls = curve.control_index[curve.control_index >= 0]
    at, reach = [], []
    for each in avoided:
        for arc, position in zip(each.junctions, each.positions(each.junctions), strict=True):
            away = np.linalg.norm(curve.points[controls] - position, axis=1)
            at.append(int(controls[away.argmin()]))
            reach.append(STRAIGHT * gap_width(mesh, each, arc, clearance))
    straight = _straight_at_junctions(mesh, curve, np.array(at, dtype=np.int64), np.array(reach))
    crossed = _crossed(mesh, straight, avoided)
    if crossed is not None:
        raise UnreachableError(
            f"the curve would cross avoid[{crossed}]; move control points away from it, or use "
            "a larger clearance"
        )
    return straight


def _crossed(mesh: Mesh, curve: SurfaceCurve, avoided: list[Avoided]) -> int | None:
    """Index of an avoided curve that a curve meets elsewhere than at junctions, or None."""
    return next((number for number, each in enumerate(avoided) if meets(mesh, curve, each)), None)


def meets(mesh: Mesh, curve: SurfaceCurve, avoided: Avoided) -> bool:
    """Whether a curve meets an avoided curve elsewhere than at junctions."""
    points = curve.points[curve.control_index[curve.control_index >= 0]]
    meeting = meeting_places(mesh, curve, avoided.curve)
    away = cdist(meeting, points).min(axis=1, initial=np.inf)
    return bool((away > MEETING * mesh.diagonal).any())


def is_too_close(
    mapped: MappedMesh, curve: SurfaceCurve, avoided: Avoided, clearance: float
) -> bool:
    """Whether a curve comes closer to an avoided curve than the clearance.

    Parameters
    ----------
    mapped : MappedMesh
        Map from the given mesh to a manifold.
    curve : SurfaceCurve
        A curve on the manifold. Its points and the middles of its segments count.
    avoided : Avoided
        A curve on the given mesh.
    clearance : float
        It does not count near junctions.
    """
    segments = segments_with_clearance(mapped, avoided, clearance)
    if not len(segments):
        return False
    pieces = segments_of(mapped.mesh, curve)
    distances = distances_near(mapped.mesh, segments, clearance)
    return any(
        bool((distances.at(SurfacePoints(pieces.faces, weights)) < clearance).any())
        for weights in (pieces.start, 0.5 * (pieces.start + pieces.end), pieces.end)
    )


def _straight_at_junctions(
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
