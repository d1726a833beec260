"""Fits a start, an earlier curve, to the control points of a request.

The course of the start is kept. Control points may have been moved, added or removed: `moved_start`
matches them with the control points of the start and moves the curve to them. A start that cannot
be used raises `CurveError`; there is no fallback to another course.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import igl
import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from .errors import CurveError, PointName
from .geometry import tolerances
from .geometry.array_types import FloatArray, IntArray
from .geometry.curve import SurfaceCurve, curve_on_mesh
from .geometry.mesh import Mesh
from .geometry.surface_points import SurfacePoints, in_faces, joined
from .geometry.tracing import strictly_inside, trace_between
from .relaxation.curve_nodes import CurveSurface
from .relaxation.discrete_curve import DiscreteCurve, is_simple, place_nodes
from .relaxation.relaxing import relax
from .relaxation.warm_start import LONGEST_MOVE, WARM, with_moved_controls
from .request import Request, same_request

WITHOUT_START = "; leave start out"

OTHER_ORDER = f"start visits the control_points in another order{WITHOUT_START}"

LONGEST_TRACE = 1.5
"""Longest trace of a control point to its new position, relative to the straight distance."""

STEPS = 4
"""Steps in which a curve is moved if it would cross itself in one step."""

ITERATIONS_OF_A_STEP = 3
"""Iterations of the relaxation after each step."""


@dataclass(frozen=True)
class Resumable:
    """A relaxed curve with its nodes, from which a later design can continue.

    Attributes
    ----------
    mesh : Mesh
        The mesh on which the curve was designed, a canonical copy or a manifold.
    request : Request
        The request that the curve answers, on this mesh.
    curve : DiscreteCurve
    visited : (k,) int array
        For each control node, the index of its control point in the request.
    collisions : int
        Number of the following designs in which strands are assumed to collide, so that every
        iteration is traced.
    unsettled : (u,) int array or None
        Vertices near which the curve may not have converged; None if that may be so everywhere.
    given : Mesh or None
        The mesh of the caller. Meshes that differ in position or numbering have equal copies.
    """

    mesh: Mesh
    request: Request
    curve: DiscreteCurve
    visited: IntArray
    collisions: int = 0
    unsettled: IntArray | None = None
    given: Mesh | None = None


def unsettled_vertices(start: Resumable, request: Request, visited: IntArray) -> IntArray | None:
    """Vertices near which a start may move, if the request differs in painted weights only.

    Elsewhere the curve has converged, and a map that changes far away should not move it. The
    control points may be numbered in another way, as long as their positions are the same.

    Parameters
    ----------
    start : Resumable
    request : Request
    visited : (k,) int array
        For each control node of the start, the index of its control point in the request.

    Returns
    -------
    (u,) int array or None
        Vertices whose weights changed, and those near which the start has not converged. None if
        the whole curve may move.
    """
    before, mesh = start.request, start.mesh
    points = before.points[start.visited].positions(mesh)
    now = request.points[visited].positions(mesh)
    if (
        points.shape != now.shape
        or np.abs(points - now).max() > tolerances.SAME_POSITION * mesh.diagonal
    ):
        return None
    # Neither alternatives nor via points matter to a design with a start.
    unpainted = replace(
        request,
        points=before.points,
        order=before.order,
        obstacles=before.obstacles,
        alignment=before.alignment,
        alternatives=before.alternatives,
        via_points=before.via_points,
    )
    if start.unsettled is None or not same_request(before, unpainted):
        return None
    changed = np.zeros(len(mesh.vertices), dtype=bool)
    changed[start.unsettled] = True
    for one, other in (
        (before.obstacles, request.obstacles),
        (before.alignment, request.alignment),
    ):
        changed |= np.not_equal(0.0 if one is None else one, 0.0 if other is None else other)
    return np.flatnonzero(changed)


def curve_of_start(
    surface: CurveSurface, start: Resumable | SurfaceCurve, request: Request
) -> tuple[DiscreteCurve, IntArray | None]:
    """The curve of a start with nodes.

    Parameters
    ----------
    surface : CurveSurface
        The surface of the start.
    start : Resumable or SurfaceCurve
        A curve on the surface. The points of a SurfaceCurve must be given in the face of the
        segment after them.
    request : Request

    Returns
    -------
    DiscreteCurve
        The curve with its former control points.
    (k,) int array or None
        For each control node, the index of its control point in the request that the start answers;
        None for a SurfaceCurve.

    Raises
    ------
    CurveError
        If the start is not simple, or open where a closed curve is requested or vice versa.
    """
    if isinstance(start, Resumable):
        curve, visited = start.curve, start.visited
    else:
        curve, visited = place_nodes(surface, start, WARM.levels[-1]), None
        if not is_simple(surface, curve):
            raise CurveError("start crosses or touches itself; pass a simple curve")
    if curve.closed != request.closed:
        kinds = ("an open", "a closed") if request.closed else ("a closed", "an open")
        raise CurveError(
            f"start is {kinds[0]} curve and {kinds[1]} one is requested{WITHOUT_START}"
        )
    return curve, visited


def moved_start(
    surface: CurveSurface, curve: DiscreteCurve, visited: IntArray | None, request: Request
) -> tuple[DiscreteCurve, IntArray]:
    """Move the curve of a start to the control points of a request.

    If the request has as many control points as the start, points are matched by index or by their
    order along the start, whichever moves them less; a SurfaceCurve is matched by distance if the
    order is "shortest". Otherwise points at unchanged positions are matched, and every new point is
    inserted at the nearest position on the curve, between its neighbours if the order is "given".

    Parameters
    ----------
    surface : CurveSurface
        The surface of the start.
    curve, visited : DiscreteCurve and (c,) int array or None
        The curve of the start, from `curve_of_start`.
    request : Request
        The request with the new control points.

    Returns
    -------
    DiscreteCurve
        The moved curve, which is simple.
    (k,) int array
        For each control node, the index of its control point in the request.

    Raises
    ------
    CurveError
        If the start visits the points in another order, or has another number of control points
        and none at an unchanged position; if a point has moved by more than `LONGEST_MOVE` times
        the curve's length; or if the moved curve would cross itself.
    """
    if len(request.points) == len(curve.control_nodes):
        visited = _nearest_numbering(surface.mesh, curve, visited, request)
    else:
        curve, visited = with_other_points(surface, curve, request)
    if request.order == "given" and visited[0] != 0:
        curve, visited = _rotated_to_first(surface, curve, visited)
    _check_moves(surface.mesh, curve, visited, request.points)
    points, curve = request.points[visited], curve.with_corners(request.are_corners(visited))
    moved = with_moved_controls(surface, curve, points)
    if moved is None:
        moved = _moved_in_steps(surface, curve, points, request.smoothness)
    if moved is None:
        raise CurveError(
            f"start would cross itself when moved to the control_points{WITHOUT_START}"
        )
    return moved, visited


def _moved_in_steps(
    surface: CurveSurface, curve: DiscreteCurve, points: SurfacePoints, smoothness: float
) -> DiscreteCurve | None:
    """Move a curve to control points in steps, with a few iterations of relaxation in between.

    Returns None if there is no straight trace to one of the points, or if the curve still crosses
    itself.
    """
    routes = _routes(surface, curve, points)
    if routes is None:
        return None
    config = replace(WARM, most_iterations=ITERATIONS_OF_A_STEP)
    for step in range(1, STEPS):
        there = [route[np.array([(len(route) - 1) * step // STEPS])] for route in routes]
        moved = with_moved_controls(surface, curve, joined(there))
        if moved is None:
            return None
        curve = relax(surface, moved, smoothness, config).discrete_curve
    return with_moved_controls(surface, curve, points)


def _routes(
    surface: CurveSurface, curve: DiscreteCurve, points: SurfacePoints
) -> list[SurfacePoints] | None:
    """For each control node, points on the trace to its new position, including both ends.

    None if one of the traces fails.
    """
    mesh, at_controls = surface.mesh, curve.control_nodes
    here = curve.nodes.places[at_controls]
    inside = SurfacePoints(here.faces, strictly_inside(here.barycentric))
    normals = curve.nodes.normals[at_controls]
    distance = np.linalg.norm(points.positions(mesh) - here.positions(mesh), axis=1)
    traces = trace_between(mesh, inside, points, normals, LONGEST_TRACE * distance, surface.folded)
    if not traces.reached.all():
        return None
    return [
        joined([here[i : i + 1], traces.crossings[traces.pair == i], points[i : i + 1]])
        for i in range(len(here))
    ]


def _check_moves(
    mesh: Mesh, curve: DiscreteCurve, visited: IntArray, points: SurfacePoints
) -> None:
    """Raise CurveError if a control node has to move too far to its control point."""
    away = points[visited].positions(mesh) - curve.nodes.positions[curve.control_nodes]
    distance = np.linalg.norm(away, axis=1)
    longest = LONGEST_MOVE * curve.length
    if distance.max() > longest:
        raise too_far(int(visited[distance.argmax()]), distance.max() / curve.length)


def too_far(number: int, move: float) -> CurveError:
    """The error that a control point, given by its index, is too far from the start.

    `move` is its distance relative to the length of the start.
    """
    point = PointName("control_points", number)
    return CurveError(
        f"{point} is {move:.0%} of the curve's length away from its position on start; the limit "
        f"is {LONGEST_MOVE:.0%}{WITHOUT_START}",
        point,
    )


def _nearest_numbering(
    mesh: Mesh, curve: DiscreteCurve, visited: IntArray | None, request: Request
) -> IntArray:
    """For each control node, the index of its control point, if there are as many as nodes.

    Of the possible numberings, the one with the smallest maximum move is taken.
    """
    there = request.points.positions(mesh)
    here = curve.nodes.positions[curve.control_nodes]
    if visited is None and request.order == "shortest":
        return linear_sum_assignment(cdist(here, there))[1]
    numberings = [np.arange(len(there))]
    if visited is not None and (request.order == "shortest" or _ascending(visited, curve.closed)):
        numberings.append(visited)
    return min(numberings, key=lambda each: np.linalg.norm(there[each] - here, axis=1).max())


def _ascending(numbers: IntArray, closed: bool) -> bool:
    """Whether indices ascend; on a closed curve, from some starting point."""
    first = int(numbers.argmin()) if closed else 0
    return bool((np.diff(np.roll(numbers, -first)) > 0).all())


def _rotated_to_first(
    surface: CurveSurface, curve: DiscreteCurve, visited: IntArray
) -> tuple[DiscreteCurve, IntArray]:
    """Rotate a closed curve so that it begins at control point 0; return it and its indices."""
    first = int(visited.argmin())
    whole = curve.surface_curve(surface.mesh)
    whole = replace(whole, control_index=np.roll(whole.control_index, -first))
    return place_nodes(surface, whole, WARM.levels[-1]), np.roll(visited, -first)


def unchanged_points(surface: CurveSurface, curve: DiscreteCurve, request: Request) -> IntArray:
    """For each control point of a request, (k,), its place in the order of a start, or -1.

    Raises
    ------
    CurveError
        If no control point is where it was.
    """
    mesh, there = surface.mesh, request.points.positions(surface.mesh)
    at_controls = curve.polyline[curve.node_index[curve.control_nodes]]
    distance = np.linalg.norm(there[:, None] - at_controls.positions(mesh), axis=2)
    same = distance.min(axis=1) <= tolerances.SAME_POSITION * mesh.diagonal
    if not same.any():
        raise CurveError(
            f"start has {len(at_controls)} control points, {len(there)} are requested, "
            f"and none of them is where it was{WITHOUT_START}"
        )
    places: IntArray = np.where(same, distance.argmin(axis=1), -1)
    return places


def with_other_points(
    surface: CurveSurface, curve: DiscreteCurve, request: Request
) -> tuple[DiscreteCurve, IntArray]:
    """Replace the control nodes of a curve by nodes at, or nearest to, the points of a request.

    Returns
    -------
    DiscreteCurve
    (k,) int array
        For each control node, the index of its control point in the request.
    """
    mesh, polyline, in_order = surface.mesh, curve.polyline, request.order == "given"
    there, unchanged = request.points.positions(mesh), unchanged_points(surface, curve, request)
    same = unchanged >= 0
    index = curve.node_index[curve.control_nodes[unchanged]]
    visited = np.arange(len(there))
    if in_order and curve.closed:
        # Begin the polyline at the first unchanged point.
        first = int(same.argmax())
        visited = np.roll(visited, -first)
        begin, count = index[first], len(polyline)
        polyline, index = polyline[(np.arange(count) + begin) % count], (index - begin) % count
    index = np.where(same, index, -1)
    before = 0
    for turn, number in enumerate(visited.tolist()):
        if not same[number]:
            low, high = 0, len(polyline) - (not curve.closed)
            if in_order:
                later = index[visited[turn:]]
                low, high = before, int(np.append(later[later >= 0], high)[0])
            inserted, place = _with_point(mesh, polyline, there[number], low, high)
            index[index >= place] += len(inserted) - len(polyline)
            polyline, index[number] = inserted, place
        before = int(index[number])
    if not in_order:
        visited = np.argsort(index)
    index = index[visited]
    if (np.diff(index) <= 0).any():
        raise CurveError(OTHER_ORDER)
    if not curve.closed:
        polyline, index = polyline[index[0] : index[-1] + 1], index - index[0]
    whole = curve_on_mesh(mesh, curve.closed, polyline.faces, polyline.barycentric, index)
    return place_nodes(surface, whole, WARM.levels[-1]), visited


def _with_point(
    mesh: Mesh, polyline: SurfacePoints, position: FloatArray, low: int, high: int
) -> tuple[SurfacePoints, int]:
    """Insert the point nearest to a position, (3,), on the segments low … high - 1 of a polyline.

    Returns the polyline and the index of the point. If the polyline has a point there, or there are
    no such segments, it stays as it is.
    """
    if low >= high:
        return polyline, low
    line, segments = polyline.positions(mesh), np.arange(low, high)
    ends = np.stack([segments, (segments + 1) % len(line)], axis=1)
    _, nearest, foot = igl.point_mesh_squared_distance(position[None], line, ends)
    start, end = ends[np.ravel(nearest)[0]].tolist()
    to_start, to_end = np.linalg.norm(line[[start, end]] - foot, axis=1).tolist()
    if min(to_start, to_end) <= tolerances.SAME_POSITION * mesh.diagonal:
        # The first point of a closed polyline is not reached from its end.
        return polyline, min(start + (to_end < to_start), len(line) - 1)
    faces = polyline.faces[[start, start]]
    one, other = in_faces(mesh, polyline[np.array([start, end])], faces).barycentric
    share = to_start / (to_start + to_end)
    point = SurfacePoints(faces[:1], ((1.0 - share) * one + share * other)[None])
    return joined([polyline[: start + 1], point, polyline[start + 1 :]]), start + 1
