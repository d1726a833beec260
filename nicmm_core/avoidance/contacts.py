"""Whether a curve meets avoided curves elsewhere than at junctions, or comes too close to them.

The barrier along an avoided curve has a narrow gap at a junction. There a curve may cross the
avoided one also beside the junction, by less than the width of the gap; it is made straight there.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.distance import cdist

from ..errors import UnreachableError
from ..geometry.crossings import meeting_places
from ..geometry.curve import SurfaceCurve
from ..geometry.mesh import Mesh
from ..geometry.segment_distances import segments_of
from ..geometry.surface_points import SurfacePoints
from ..repair.mapped_mesh import MappedMesh
from .avoided_curve import Avoided, gap_width
from .clearance import distances_near, segments_with_clearance
from .straight_junctions import straight_at_junctions

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
    controls = curve.points[curve.control_index]
    junctions, reach = [], []
    for each in avoided:
        for arc, position in zip(each.junctions, each.positions(each.junctions), strict=True):
            junctions.append(int(np.linalg.norm(controls - position, axis=1).argmin()))
            reach.append(STRAIGHT * gap_width(mesh, each, arc, clearance))
    straight = straight_at_junctions(mesh, curve, np.array(junctions), np.array(reach))
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
