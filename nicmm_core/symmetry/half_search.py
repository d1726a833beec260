"""Searches for the half of a symmetric curve on the side of the given points alone.

It is needed where every curve found through all points crosses the plane elsewhere. The half is an
open curve on the part of the surface on this side, which ends at the nearest vertices on the plane.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ..courses.hop_graph import distances_along_edges
from ..errors import UnreachableError
from ..geometry.array_types import FloatArray, IntArray
from ..geometry.curve import SurfaceCurve, arc_lengths
from ..geometry.mesh import Mesh
from ..geometry.mirror import ON_PLANE
from ..geometry.numbering import Renumbered, renumbered
from ..geometry.surface_points import SurfacePoints, joined, nearest_points, snapped
from ..geometry.tolerances import COINCIDENT
from ..relaxation.curve_nodes import CurveSurface
from ..relaxation.discrete_curve import DiscreteCurve, place_nodes, short_segments
from ..relaxation.warm_start import WARM
from ..request import Request
from ..start_search import InitialCurve, StartSearch
from .half_mesh import HalfMesh, half_mesh
from .halves import TRIMMED, Half, mirror_of, with_image

MOST_COURSES = 4
"""Greatest number of courses of the half that are made symmetric."""

SEPARATED = (
    "there is no symmetric curve through control_points: the surface on their side of the mirror "
    "does not connect them to each other and to the mirror; choose points that it connects, or "
    "leave mirror out"
)

NO_SYMMETRIC_CURVE = (
    "no symmetric curve through control_points was found: every curve found crosses the mirror "
    "between two of them, or its mirror image cannot be traced on this mesh without crossing it; "
    "use other points or another order, or leave mirror out"
)


def symmetric_by_halves(
    surface: CurveSurface, request: Request
) -> Iterator[tuple[DiscreteCurve, SurfaceCurve, IntArray]]:
    """Yield symmetric curves whose halves are found on one side of the plane.

    The results are those of `halves.symmetric_curves`.

    Parameters
    ----------
    surface : CurveSurface
        The surface with the maps of the request.
    request : Request
        A request with a mirror and the order "given".

    Raises
    ------
    UnreachableError
        If the points of one side are not connected on this side, or no simple curve passes them.
    """
    mirror = mirror_of(request)
    half = half_mesh(surface.mesh, mirror.plane)
    count = int((mirror.side >= 0).sum())
    if half is None:
        raise UnreachableError(SEPARATED)
    points = _on_half(half, surface.mesh, request.points[:count])
    component = half.mesh.face_component[points.faces]
    if (component != component[0]).any():
        raise UnreachableError(SEPARATED)
    copy = renumbered(half.mesh, int(component[0]))
    search = StartSearch(copy.mesh)
    on_copy, controls = _half_request(surface.mesh, half, copy, search, points, request)
    starts: Iterator[InitialCurve] = search.courses(on_copy, insist=True)
    first = next(starts, None)
    if first is None:
        first = search.by_path(on_copy)
    for start in itertools.islice(itertools.chain([first], starts), MOST_COURSES):
        curve = start.curve
        if isinstance(curve, SurfaceCurve):
            curve = place_nodes(search.surface.without_maps, curve, WARM.levels[-1])
        found = with_image(surface, _on_whole(half, copy, curve, controls), request)
        if found is not None:
            yield found


def _on_half(half: HalfMesh, whole: Mesh, points: SurfacePoints) -> SurfacePoints:
    """Points of the whole mesh on the half mesh."""
    return snapped(nearest_points(half.mesh, points.positions(whole))[0])


def _half_request(
    whole: Mesh,
    half: HalfMesh,
    copy: Renumbered,
    search: StartSearch,
    points: SurfacePoints,
    request: Request,
) -> tuple[Request, IntArray]:
    """The request for the half on its copy; the index of each point, or -1 for an end on the plane.

    Raises
    ------
    UnreachableError
        If this part of the surface does not reach the plane.
    """
    mirror, count = mirror_of(request), len(points)
    via_points = {
        leg: copy.points_to(_on_half(half, whole, via))
        for leg, via in request.via_points.items()
        if leg < count - 1
    }
    points = copy.points_to(points)
    to_plane = request.via_points.get(count - 1)
    if to_plane is not None and mirror.side[count - 1]:
        above = mirror.plane.heights(to_plane.positions(whole)) > ON_PLANE * whole.diagonal
        if above.any():
            via_points[count - 1] = copy.points_to(_on_half(half, whole, to_plane[above]))
    last = points[count - 1 :]
    if count - 1 in via_points:
        last = via_points[count - 1][-1:]
    controls = np.arange(count)
    on_plane = np.flatnonzero(half.on_plane[copy.vertex])
    if mirror.side[count - 1]:
        end, on_plane = _nearest_vertex(search, last, on_plane)
        points, controls = joined([points, end]), np.append(controls, -1)
    if request.closed and mirror.side[0]:
        end, _ = _nearest_vertex(search, points[:1], on_plane)
        points, controls = joined([end, points]), np.append(-1, controls)
        via_points = {leg + 1: via for leg, via in via_points.items()}

    def weights(of_whole: FloatArray | None) -> FloatArray | None:
        if of_whole is None:
            return None
        return copy.weights_to(half.weights_to(whole, of_whole))

    on_copy = replace(
        request,
        points=points,
        via_points=via_points,
        closed=False,
        corners=np.flatnonzero(np.isin(controls, request.corners)),
        obstacles=weights(request.obstacles),
        alignment=weights(request.alignment),
        mirror=None,
        alternatives=0,
    )
    return on_copy, controls


def _nearest_vertex(
    search: StartSearch, point: SurfacePoints, among: IntArray
) -> tuple[SurfacePoints, IntArray]:
    """The vertex nearest to a point along edges, as a point, and the other vertices.

    A vertex at the point itself does not count.
    """
    mesh = search.mesh
    along = distances_along_edges(search.surface.without_maps, point)[0, among]
    along[along <= 2.0 * COINCIDENT * mesh.diagonal] = np.inf
    if not np.isfinite(along).any():
        raise UnreachableError(SEPARATED)
    vertex = among[along.argmin()]
    face = mesh.faces_at(vertex[None])[:1]
    barycentric = (mesh.faces[face] == vertex).astype(np.float64)
    return SurfacePoints(face, barycentric), among[among != vertex]


def _on_whole(half: HalfMesh, copy: Renumbered, curve: DiscreteCurve, controls: IntArray) -> Half:
    """A curve on the copy of the half mesh as a half on the whole mesh, without ends on the plane.

    `controls` has the index of each of its control points, or -1 at the plane.
    """
    polyline = curve.polyline
    control, is_node = np.full(len(polyline), -1), np.zeros(len(polyline), dtype=bool)
    control[curve.node_index[curve.control_nodes]], is_node[curve.node_index] = controls, True
    positions = polyline.positions(copy.mesh)
    arc = arc_lengths(np.diff(positions, axis=0))
    trimmed = 2.0 * TRIMMED * arc[-1]
    kept = (arc > trimmed) | (controls[0] >= 0)
    kept &= (arc < arc[-1] - trimmed) | (controls[-1] >= 0)
    first, *_, last = np.flatnonzero((kept & is_node) | (control >= 0))
    kept = slice(first, last + 1)
    left_out = short_segments(copy.mesh, curve)[kept]
    left_out[[0, -1]] = False
    points = half.parts.in_parents(copy.points_back(polyline[kept]))
    return Half(points, control[kept], is_node[kept], left_out)
