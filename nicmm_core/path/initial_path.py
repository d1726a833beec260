"""The initial path (section 3.1): a closed or open path of edges through the control points.

Shortest paths between consecutive points may share edges or cross, and then no curve follows them.
So each leg of the path avoids all vertices of the earlier legs. Where there are too few vertices,
the leg runs through midpoints of edges, which are then split virtually.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import igl
import numpy as np
from scipy.sparse import csgraph

from ..errors import UnreachableError
from ..geometry.array_types import FloatArray, IntArray
from ..geometry.curve import SurfaceCurve, curve_on_mesh
from ..geometry.mesh import Mesh
from ..geometry.surface_points import SurfacePoints, control_point_names
from .legs import CrossingError
from .simple_path import find_path
from .via_points import ViaPoints, Waypoints, with_via_points
from .virtual_splits import SplitMesh, WorkingMesh
from .visiting_order import order_along_boundaries, shortest_order


@dataclass(frozen=True)
class InitialPath:
    """A simple path of edges of a split mesh through the control points.

    Attributes
    ----------
    split : SplitMesh
        The mesh, split so that the path runs along edges.
    vertices : list of int
        Vertices of the path in order; the first vertex of a closed path is not repeated.
    control_vertices : (k,) int array
        Vertices of the control points, in order along the path.
    order : (k,) int array
        Indices of the control points in the caller's array, in the same order.
    closed : bool
        Whether an edge joins the last vertex to the first.
    """

    split: SplitMesh
    vertices: list[int]
    control_vertices: IntArray
    order: IntArray
    closed: bool


def find_initial_path(
    mesh: Mesh,
    points: SurfacePoints,
    order: str,
    phi_fea: FloatArray | None = None,
    closed: bool = True,
    via_points: ViaPoints | None = None,
) -> InitialPath:
    """Insert the control points as vertices and join them by edge paths that never touch.

    Parameters
    ----------
    mesh : Mesh
        A manifold.
    points : SurfacePoints
        At least three control points, or two for an open path, on one connected component.
    order : {"given", "shortest"}
        Whether the points are visited as given or in the shortest order.
    phi_fea : (V,) float array, optional
        φ_fea at the input vertices. Lengths are weighted by its square, as in Eq. 7, but with at
        least `guidance.LEAST_WEIGHT`. So the path avoids obstacles and follows alignment from the
        start.
    closed : bool
        Whether the path returns from the last point to the first.
    via_points : mapping, optional
        Mapping from the index of a control point to via points on the leg that starts there.

    Raises
    ------
    UnreachableError
        If no simple path through the points in this order is found, or only one with too many
        windings. The message names an order that works, if one is found.
    ArgumentError
        If a key of the via points is not the index of a leg, or the order is not "given".
    ControlPointError
        If a via point cannot be used.
    """
    tours = _Tours(mesh, points, closed)
    failure = None
    for visit in tours.of(order):
        waypoints = Waypoints(
            points[visit], np.ones(len(points), dtype=bool), control_point_names(visit)
        )
        if via_points:
            waypoints = with_via_points(mesh, points, via_points, order, closed)
        try:
            path = find_path(mesh, waypoints.points, phi_fea, closed)
        except UnreachableError as error:
            failure = error
            continue
        controls = np.array(path.waypoints)[waypoints.is_control]
        return InitialPath(path.split, path.vertices, controls, visit, closed)
    what, named = str(failure), []
    if isinstance(failure, CrossingError):
        names, leg = waypoints.names, failure.leg
        named = [names[leg], names[(leg + 1) % len(names)]]
        what = f"{named[0]} cannot be joined to {named[1]} without crossing the rest of the curve"
    advice = _advice(mesh, points, tours, visit, phi_fea, not waypoints.is_control.all())
    raise UnreachableError(f"{what}; {advice}", *named) from failure


def path_curve(mesh: Mesh, path: InitialPath) -> SurfaceCurve:
    """Convert the initial path to a curve, which is simple and passes exactly through the points.

    Parameters
    ----------
    mesh : Mesh
        The input mesh, in which the path was found.
    path : InitialPath
    """
    vertices = path.vertices
    following = [*vertices[1:], vertices[0] if path.closed else vertices[-2]]
    edges = zip(vertices, following, strict=True)
    faces = np.array([path.split.input_face_with(start, end) for start, end in edges])
    weights = [path.split.weights(vertex) for vertex in vertices]
    barycentric = [
        [at_point.get(corner, 0.0) for corner in corners]
        for at_point, corners in zip(weights, mesh.faces[faces].tolist(), strict=True)
    ]
    index = {vertex: number for number, vertex in enumerate(vertices)}
    controls = np.array([index[vertex] for vertex in path.control_vertices.tolist()])
    return curve_on_mesh(mesh, path.closed, faces, np.array(barycentric), controls)


class _Tours:
    """Possible orders of the control points along the curve, each computed on first use."""

    def __init__(self, mesh: Mesh, points: SurfacePoints, closed: bool) -> None:
        self._mesh, self._points, self.closed = mesh, points, closed
        self.given = np.arange(len(points))

    def of(self, order: str) -> Iterator[IntArray]:
        """Orders to try for a request, the preferred one first."""
        if order == "given":
            yield self.given
        else:
            yield self.shortest
            yield self.along_boundaries

    @cached_property
    def shortest(self) -> IntArray:
        """The shortest order by distances along edges, (k,)."""
        return shortest_order(self._on_mesh[2], self.closed)

    @cached_property
    def along_boundaries(self) -> IntArray:
        """A short order that is possible even if points lie on boundaries, (k,)."""
        working, vertices, distance = self._on_mesh
        index = np.full(len(working.vertices), -1)
        index[vertices] = np.arange(len(vertices))
        loops = [index[loop] for loop in boundary_loops(working.faces)]
        return order_along_boundaries(distance, [loop[loop >= 0] for loop in loops], self.closed)

    @cached_property
    def _on_mesh(self) -> tuple[WorkingMesh, IntArray, FloatArray]:
        """The working mesh with all points inserted, their vertices and their edge distances."""
        split = SplitMesh(self._mesh)
        controls = split.insert_points(self._points)
        component = int(self._mesh.face_component[self._points.faces[0]])
        working, renumbered = split.assemble(component)
        vertices = renumbered[controls]
        distance = csgraph.dijkstra(working.edge_graph(), directed=False, indices=vertices)
        return working, vertices, distance[:, vertices]


def boundary_loops(faces: IntArray) -> list[IntArray]:
    """Vertices of each boundary loop of a manifold, with the surface on the same side of all loops.

    On a non-orientable surface the direction of each loop is arbitrary.

    Parameters
    ----------
    faces : (m, 3) int array
    """
    oriented = igl.bfs_orient(faces)[0]
    sides = oriented[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    _, edge, count = np.unique(
        np.sort(sides, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    around: dict[int, list[int]] = {}
    for start, end in sides[count[edge.ravel()] == 1].tolist():
        around.setdefault(start, []).insert(0, end)
        around.setdefault(end, []).append(start)
    loops = []
    while around:
        here, (onward, *_) = next(iter(around.items()))
        loop = [here]
        del around[here]
        while onward in around:
            here, beside = onward, around.pop(onward)
            onward = next(vertex for vertex in beside if vertex != loop[-1])
            loop.append(here)
        loops.append(np.array(loop, dtype=np.int64))
    return loops


def _advice(
    mesh: Mesh,
    points: SurfacePoints,
    tours: _Tours,
    visited: IntArray,
    phi_fea: FloatArray | None,
    via: bool,
) -> str:
    """Advice for the error message: an order that was tried and works, or what else to change.

    Parameters
    ----------
    mesh, points, phi_fea
        Arguments of `find_initial_path`.
    tours : _Tours
        Orders to try.
    visited : (k,) int array
        The order that failed.
    via : bool
        Whether the failed path had via points. If so, the same order is tried without them.
    """
    tried = [] if via else [visited.tolist()]
    for order in (tours.given, tours.shortest, tours.along_boundaries):
        if order.tolist() in tried:
            continue
        tried.append(order.tolist())
        try:
            find_path(mesh, points[order], phi_fea, tours.closed)
        except UnreachableError:
            continue
        leave_out = "leave the via points out and " if via else ""
        return f"{leave_out}visit the points in the order {order.tolist()}, which works"
    return (
        "no order works, not even the shortest; use fewer points, or move points off the boundary"
    )
