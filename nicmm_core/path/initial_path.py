"""The initial path (section 3.1): a closed or open path of edges through the control points.

Shortest paths between consecutive points may share edges or cross, and then no curve follows them.
So each leg of the path avoids all vertices of the earlier legs. Where there are too few vertices,
the leg runs through midpoints of edges, which are then split virtually.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice

import igl
import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from ..errors import UnreachableError
from ..geometry.array_types import FloatArray, IntArray
from ..geometry.curve import SurfaceCurve, curve_on_mesh
from ..geometry.mesh import Mesh
from ..geometry.surface_points import SurfacePoints, control_point_names
from .legs import CrossingError
from .simple_path import find_path
from .via_points import ViaPoints, Waypoints, with_via_points
from .virtual_splits import SplitMesh
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
    orders = _orders(mesh, points, closed)
    failed: list[list[int]] = []
    for visit in islice(orders, 1) if order == "given" else islice(orders, 1, None):
        waypoints = Waypoints(
            points[visit], np.ones(len(points), dtype=bool), control_point_names(visit)
        )
        if via_points:
            waypoints = with_via_points(mesh, points, via_points, order, closed)
        try:
            legs = find_path(mesh, waypoints.points, phi_fea, closed)
        except UnreachableError as error:
            failure = error
            failed.append(visit.tolist())
            continue
        controls = np.array(legs.waypoints)[waypoints.is_control]
        return InitialPath(legs.split, legs.vertices, controls, visit, closed)
    what, named = str(failure), []
    if isinstance(failure, CrossingError):
        names, leg = waypoints.names, failure.leg
        named = [names[leg], names[(leg + 1) % len(names)]]
        what = f"{named[0]} cannot be joined to {named[1]} without crossing the rest of the curve"
    raise UnreachableError(
        f"{what}; {_advice(mesh, points, phi_fea, closed, bool(via_points), failed)}", *named
    ) from failure


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


def _orders(mesh: Mesh, points: SurfacePoints, closed: bool) -> Iterator[IntArray]:
    """Orders of the points, (k,) each: as given, short, and possible with points on boundaries."""
    yield np.arange(len(points))
    split = SplitMesh(mesh)
    inserted = split.insert_points(points)
    working, renumbered = split.assemble(int(mesh.face_component[points.faces[0]]))
    vertices = renumbered[inserted]
    along_edges = csgraph.dijkstra(working.edge_graph(), directed=False, indices=vertices)
    distance = along_edges[:, vertices]
    yield shortest_order(distance, closed)
    index = np.full(len(working.vertices), -1)
    index[vertices] = np.arange(len(vertices))
    loops = [index[loop] for loop in boundary_loops(working.faces)]
    yield order_along_boundaries(distance, [loop[loop >= 0] for loop in loops], closed)


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
    rim = sides[count[edge.ravel()] == 1]
    size = int(faces.max()) + 1
    graph = sparse.csr_array((np.ones(len(rim)), (rim[:, 0], rim[:, 1])), shape=(size, size))
    seen = np.zeros(size, dtype=bool)
    loops = []
    for start, end in rim.tolist():
        if not seen[start]:
            loop = csgraph.depth_first_order(graph, start, False, return_predecessors=False)
            loops.append(loop if loop[1] == end else np.roll(loop[::-1], 1))
            seen[loop] = True
    return loops


def _advice(
    mesh: Mesh,
    points: SurfacePoints,
    phi_fea: FloatArray | None,
    closed: bool,
    via: bool,
    failed: list[list[int]],
) -> str:
    """Advice for the error message: another order that works, or what else to change.

    Parameters
    ----------
    mesh, points, phi_fea, closed
        Arguments of `find_initial_path`.
    via : bool
        Whether the path had via points. If so, the same order is tried without them.
    failed : list of (k,) lists of int
        Orders in which no path has been found.
    """
    failed = [] if via else failed
    for order in _orders(mesh, points, closed):
        if order.tolist() not in failed:
            failed.append(order.tolist())
            with suppress(UnreachableError):
                find_path(mesh, points[order], phi_fea, closed)
                leave_out = "leave the via points out and " if via else ""
                return f"{leave_out}visit the points in the order {order.tolist()}, which works"
    return (
        "no order works, not even the shortest; use fewer points, or move points off the boundary"
    )
