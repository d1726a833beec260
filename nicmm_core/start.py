"""What a design goes on from: an earlier curve, led through control points that may differ.

The course of the start is kept. Control points may have moved, come or gone: `moved_start` finds
which point of the start each of them is, and moves the curve there. A start that cannot be used is
a `CurveError`; nothing falls back on another course.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from .errors import CurveError, PointName
from .geometry import tolerances
from .geometry.array_types import FloatArray, IntArray
from .geometry.curve import SurfaceCurve, curve_on_mesh
from .geometry.mesh import Mesh
from .geometry.surface_points import SurfacePoints, in_faces, joined
from .geometry.tracing import strictly_inside, trace_between
from .relaxation.curve_nodes import CurveSurface
from .relaxation.node_spacing import arc_lengths
from .relaxation.noded_curve import DETOUR, NodedCurve, is_simple, noded_curve
from .relaxation.relaxing import relax
from .relaxation.warm_start import LONGEST_MOVE, WARM, moved_along
from .request import Request

ANEW = "; ask again without start"

STEPS = 4
"""By which a curve is moved that would cross itself if it was moved at once."""

ITERATIONS_OF_A_STEP = 3
"""Of the relaxation after each of them."""


@dataclass(frozen=True)
class Resumable:
    """The relaxed curve of a design with its nodes.

    Attributes
    ----------
    mesh : Mesh
        The manifold that it lies on.
    request : Request
        That it answers, on this mesh.
    curve : NodedCurve
    visited : (k,) int array
        Which of the request's points its control nodes are.
    collisions : int
        Next designs in which strands are assumed to collide, so that every iteration is traced.
    """

    mesh: Mesh
    request: Request
    curve: NodedCurve
    visited: IntArray
    collisions: int = 0


def moved_start(
    surface: CurveSurface, start: Resumable | SurfaceCurve, request: Request
) -> tuple[NodedCurve, IntArray]:
    """The curve of a start through the control points of a request.

    Parameters
    ----------
    surface : CurveSurface
        Of the mesh that the start lies on.
    start : Resumable or SurfaceCurve
        Each point of a SurfaceCurve in the face of the segment after it.
    request : Request
        With as many control points as the start, its point of the same index is where each one has
        moved to. Otherwise points are recognised by their places, and new ones are taken to the
        nearest place on the curve between their neighbours.

    Returns
    -------
    NodedCurve
        Simple.
    (k,) int array
        Which of the request's points its control nodes are.

    Raises
    ------
    CurveError
        If the start is of the other kind, open or closed, or not simple, if it visits the points in
        another order, if one of them is farther away than `LONGEST_MOVE` times its length, or if it
        would cross itself there.
    """
    if isinstance(start, Resumable):
        curve, visited = start.curve, start.visited
    else:
        curve, visited = noded_curve(surface, start, WARM.levels[-1]), None
        if not is_simple(surface, curve):
            raise CurveError("start crosses or touches itself; pass a simple curve")
    if curve.closed != request.closed:
        kinds = ("an open", "a closed") if request.closed else ("a closed", "an open")
        raise CurveError(f"start is {kinds[0]} curve and {kinds[1]} one is asked for{ANEW}")
    if len(request.points) == len(curve.control_nodes):
        visited = _nearest_numbering(surface.mesh, curve, visited, request)
    else:
        curve, visited = _with_other_points(surface, curve, request)
    if request.order == "given" and visited[0] != 0:
        curve, visited = _begun_at_first(surface, curve, visited)
    _check_moves(surface.mesh, curve, visited, request.points)
    points = request.points[visited]
    moved = moved_along(surface, curve, points)
    if moved is None:
        moved = _moved_in_steps(surface, curve, points, request.smoothness)
    if moved is None:
        raise CurveError(f"start would cross itself on its way to the control_points{ANEW}")
    return moved, visited


def _moved_in_steps(
    surface: CurveSurface, curve: NodedCurve, points: SurfacePoints, smoothness: float
) -> NodedCurve | None:
    """A curve moved to control points by steps, relaxed a little in between.

    None where there is no straight trace to one of the points, or where it still crosses itself.
    """
    routes = _routes(surface, curve, points)
    if routes is None:
        return None
    config = replace(WARM, most_iterations=ITERATIONS_OF_A_STEP)
    for step in range(1, STEPS):
        there = [route[np.array([(len(route) - 1) * step // STEPS])] for route in routes]
        moved = moved_along(surface, curve, joined(there))
        if moved is None:
            return None
        curve = relax(surface, moved, smoothness, config).noded_curve
    return moved_along(surface, curve, points)


def _routes(
    surface: CurveSurface, curve: NodedCurve, points: SurfacePoints
) -> list[SurfacePoints] | None:
    """Points on the way from each control node to where it goes, both ends included."""
    mesh, at_controls = surface.mesh, curve.control_nodes
    here = curve.nodes.places[at_controls]
    inside = SurfacePoints(here.faces, strictly_inside(here.barycentric))
    normals = curve.nodes.normals[at_controls]
    traces = trace_between(mesh, inside, points, normals, DETOUR, surface.folded)
    if not traces.reached.all():
        return None
    routes = []
    for number in range(len(here)):
        own = np.array([number])
        between = traces.crossings[np.flatnonzero(traces.pair == number)]
        routes.append(joined([here[own], between, points[own]]))
    return routes


def _check_moves(mesh: Mesh, curve: NodedCurve, visited: IntArray, points: SurfacePoints) -> None:
    """Raise CurveError where a control point is too far away from its node."""
    away = points[visited].positions(mesh) - curve.nodes.positions[curve.control_nodes]
    distance = np.linalg.norm(away, axis=1)
    longest = LONGEST_MOVE * curve.length
    if distance.max() > longest:
        worst = PointName("control_points", int(visited[distance.argmax()]))
        raise CurveError(
            f"{worst} is {distance.max():g} from where start passes it, more than {longest:g}, "
            f"which is {LONGEST_MOVE:g} of the curve's length{ANEW}",
            worst,
        )


def _nearest_numbering(
    mesh: Mesh, curve: NodedCurve, visited: IntArray | None, request: Request
) -> IntArray:
    """Which of as many points each control node is: by index, in the order asked for."""
    count = len(request.points)
    numberings = [np.arange(count)]
    if visited is not None and (request.order == "shortest" or _ascending(visited, curve.closed)):
        numberings.append(visited)
    there = request.points.positions(mesh)
    here = curve.nodes.positions[curve.control_nodes]
    if visited is None and request.order == "shortest":
        distances = np.linalg.norm(here[:, None] - there, axis=2)
        numberings = [linear_sum_assignment(distances)[1]]
    farthest = [np.linalg.norm(there[each] - here, axis=1).max() for each in numberings]
    return numberings[int(np.argmin(farthest))]


def _ascending(numbers: IntArray, closed: bool) -> bool:
    """Whether numbers ascend, on a closed curve from some place on it."""
    first = int(numbers.argmin()) if closed else 0
    return bool((np.diff(np.roll(numbers, -first)) > 0).all())


def _begun_at_first(
    surface: CurveSurface, curve: NodedCurve, visited: IntArray
) -> tuple[NodedCurve, IntArray]:
    """A closed curve from its control point 0 on, and which points its control nodes are."""
    first = int(visited.argmin())
    whole = curve.surface_curve(surface.mesh)
    whole = replace(whole, control_index=np.roll(whole.control_index, -first))
    return noded_curve(surface, whole, WARM.levels[-1]), np.roll(visited, -first)


def _with_other_points(
    surface: CurveSurface, curve: NodedCurve, request: Request
) -> tuple[NodedCurve, IntArray]:
    """The same curve with other control points: nodes of it at, or nearest to, those asked for.

    Returns
    -------
    NodedCurve
    (k,) int array
        Which of the request's points its control nodes are.
    """
    mesh = surface.mesh
    line = _Line(mesh, curve)
    there = request.points.positions(mesh)
    arcs = np.full(len(there), np.nan)
    at_controls = line.arc[curve.node_place[curve.control_nodes]]
    distance = np.linalg.norm(there[:, None] - curve.nodes.positions[curve.control_nodes], axis=2)
    nearest = distance.argmin(axis=1)
    same = distance.min(axis=1) <= tolerances.AT_ONE_PLACE * mesh.diagonal
    if not same.any():
        raise CurveError(
            f"start passes {len(curve.control_nodes)} control points, {len(there)} are asked for, "
            f"and none of them is where it was{ANEW}"
        )
    arcs[same] = at_controls[nearest[same]]
    if request.order == "shortest":
        for number in np.flatnonzero(~same).tolist():
            arcs[number] = line.nearest(there[number], 0.0, line.length)
        visited = np.argsort(arcs, kind="stable")
    else:
        visited = np.arange(len(there))
        if curve.closed:
            # The polyline begins at the first of the points that are still there.
            first = int(same.argmax())
            line = line.begun_at(arcs[first])
            visited = np.roll(visited, -first)
            arcs = np.where(same, (arcs - arcs[first]) % line.length, np.nan)
        before = 0.0
        for place, number in enumerate(visited.tolist()):
            if np.isnan(arcs[number]):
                after = arcs[visited[place:]]
                end = np.append(after[~np.isnan(after)], line.length)[0]
                arcs[number] = line.nearest(there[number], before, end) if end > before else before
            before = arcs[number]
    if (np.diff(arcs[visited]) <= 0.0).any():
        raise CurveError(f"start visits the control_points in another order{ANEW}")
    return noded_curve(surface, line.with_points(arcs[visited]), WARM.levels[-1]), visited


class _Line:
    """A polyline on a mesh by arc length, from its first point on."""

    def __init__(self, mesh: Mesh, curve: NodedCurve, shift: int = 0) -> None:
        n = len(curve.polyline)
        self.mesh, self.curve = mesh, curve
        self.polyline = curve.polyline[(np.arange(n) + shift) % n]
        self.positions = self.polyline.positions(mesh)
        self.arc = arc_lengths(self.positions, curve.closed)
        self.length = float(self.arc[-1])

    def begun_at(self, arc: float) -> _Line:
        """The same closed polyline from one of its points on."""
        return _Line(self.mesh, self.curve, int(np.abs(self.arc - arc).argmin()))

    def nearest(self, position: FloatArray, low: float, high: float) -> float:
        """How far along, between two arc lengths, the polyline is nearest to a position, (3,)."""
        start = self.positions
        step = np.roll(start, -1, axis=0) - start
        start, step = start[: len(self.arc) - 1], step[: len(self.arc) - 1]
        lengths = np.maximum(np.diff(self.arc), tolerances.TINY)
        squared = (step * step).sum(axis=1)
        share = ((position - start) * step).sum(axis=1) / np.where(squared > 0.0, squared, 1.0)
        with np.errstate(over="ignore"):  # along segments of hardly any length
            begin, end = (low - self.arc[:-1]) / lengths, (high - self.arc[:-1]) / lengths
        share = np.clip(share, np.clip(begin, 0.0, 1.0), np.clip(end, 0.0, 1.0))
        distance = np.linalg.norm(start + share[:, None] * step - position, axis=1)
        distance[(begin > 1.0) | (end < 0.0)] = np.inf
        segment = int(distance.argmin())
        return float(self.arc[segment] + share[segment] * lengths[segment])

    def with_points(self, arcs: FloatArray) -> SurfaceCurve:
        """The curve with control points at ascending arc lengths; an open one ends at them."""
        n = len(self.polyline)
        apart = np.abs(self.arc[:n, None] - arcs)
        at_point = apart <= tolerances.AT_ONE_PLACE * self.mesh.diagonal
        # Rounding must not put a point of the polyline at the end of the segment before it.
        arcs = np.where(at_point.any(axis=0), self.arc[apart.argmin(axis=0)], arcs)
        segment = np.clip(np.searchsorted(self.arc, arcs, side="right") - 1, 0, len(self.arc) - 2)
        lengths = np.maximum(np.diff(self.arc)[segment], tolerances.TINY)
        share = np.clip((arcs - self.arc[segment]) / lengths, 0.0, 1.0)[:, None]
        faces = self.polyline.faces[segment]
        end = in_faces(self.mesh, self.polyline[(segment + 1) % n], faces).barycentric
        barycentric = (1.0 - share) * self.polyline.barycentric[segment] + share * end
        kept = ~at_point.any(axis=1)
        if not self.curve.closed:
            kept &= (self.arc[:n] > arcs[0]) & (self.arc[:n] < arcs[-1])
        at = np.concatenate([arcs, self.arc[:n][kept]])
        order = np.argsort(at, kind="stable")
        index = np.argsort(order, kind="stable")[: len(arcs)]
        return curve_on_mesh(
            self.mesh,
            self.curve.closed,
            np.concatenate([faces, self.polyline.faces[kept]])[order],
            np.concatenate([barycentric, self.polyline.barycentric[kept]])[order],
            index,
        )
