"""The initial path (section 3.1): a closed or open path of mesh edges through the control points.

Shortest paths between consecutive points may share edges or cross, and then no signed distance to
them exists. So each leg of the path avoids all vertices of the earlier legs. Where there are too
few vertices, the leg runs through midpoints of edges, which are then split virtually.
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
from ..geometry.mesh import Mesh, edge_keys, side_keys
from ..geometry.surface_points import SurfacePoints, control_point_names
from .band_refinement import RESOLUTION, refine_along
from .legs import CrossingError
from .simple_path import find_path
from .via_points import ViaPoints, Waypoints, with_via_points
from .virtual_splits import SplitMesh, WorkingMesh
from .visiting_order import order_along_boundaries, shortest_order


@dataclass(frozen=True)
class InitialLoop:
    """A simple path of edges of a working mesh, closed or open.

    Attributes
    ----------
    vertices : (l,) int array
        Working vertices in order; the first vertex of a closed path is not repeated at the end. An
        edge of the working mesh that joins two of them is always an edge of the path.
    control_vertices : (k,) int array
        Working vertices of the control points, in order along the path.
    order : (k,) int array
        Indices of the control points in the caller's array, in the same order.
    edge_length : float
        Mean length h of the edges with at least one end on the path, in mesh units. The widths of
        the narrow band and of the Dirac delta are multiples of h.
    zigzag : float
        Step length of the path's zigzag along mesh edges, which smoothing has to remove. See
        `refine_along`.
    closed : bool
        Whether an edge joins the last vertex to the first.
    """

    vertices: IntArray
    control_vertices: IntArray
    order: IntArray
    edge_length: float
    zigzag: float
    closed: bool = True

    @property
    def edges(self) -> IntArray:
        """Pairs of consecutive vertices, shape (l, 2), or (l - 1, 2) for an open path."""
        pairs = np.stack([self.vertices, np.roll(self.vertices, -1)], axis=1)
        return pairs if self.closed else pairs[:-1]

    def neighbours(self, index: int) -> list[int]:
        """The vertices before and after the vertex at an index of the path, in either order."""
        edges = self.edges
        return edges[(edges == self.vertices[index])[:, ::-1]].tolist()


def build_initial_loop(
    mesh: Mesh,
    points: SurfacePoints,
    order: str,
    phi_fea: FloatArray | None = None,
    closed: bool = True,
    via_points: ViaPoints | None = None,
    resolution: int = RESOLUTION,
) -> tuple[WorkingMesh, InitialLoop]:
    """Insert the control points as vertices and join them by edge paths that never touch.

    Parameters
    ----------
    mesh : Mesh
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
    resolution : int
        Refinement of the mesh along the path, see `refine_along`.

    Returns
    -------
    WorkingMesh
        The component that contains the points, split so that the path runs along edges.
    InitialLoop
        The path on that mesh.

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
    path, failure = None, None
    for visit in tours.of(order):
        waypoints = Waypoints(
            points[visit], np.ones(len(points), dtype=bool), control_point_names(visit)
        )
        if via_points is not None:
            waypoints = with_via_points(mesh, points, via_points, order, closed)
        try:
            path = find_path(mesh, waypoints.points, phi_fea, closed)
            break
        except UnreachableError as error:
            failure = error
    if path is None:
        what, named = str(failure), []
        if isinstance(failure, CrossingError):
            names, leg = waypoints.names, failure.leg
            named = [names[leg], names[(leg + 1) % len(names)]]
            what = (
                f"{named[0]} cannot be joined to {named[1]} without crossing the rest of the curve"
            )
        advice = _advice(mesh, points, tours, visit, phi_fea, not waypoints.is_control.all())
        raise UnreachableError(f"{what}; {advice}", *named) from failure
    component = int(mesh.face_component[points.faces[0]])
    split = path.split
    loop, zigzag = refine_along(split, component, path.vertices, closed, resolution)
    _separate_strands(split, loop, closed)
    working, renumbered = split.assemble(component)
    vertices, controls = renumbered[loop], renumbered[path.waypoints[waypoints.is_control]]
    beside = np.isin(working.edges, vertices).any(axis=1)
    edge_length = float(working.edge_lengths[beside].mean())
    return working, InitialLoop(vertices, controls, visit, edge_length, zigzag, closed)


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
        Arguments of `build_initial_loop`.
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


def path_curve(mesh: Mesh, working: WorkingMesh, loop: InitialLoop) -> SurfaceCurve:
    """Convert the initial path to a curve, which is simple and passes exactly through the points.

    Parameters
    ----------
    mesh : Mesh
        The input mesh, from which the working mesh was made.
    working : WorkingMesh
    loop : InitialLoop

    Returns
    -------
    SurfaceCurve
    """
    path = loop.vertices
    following = np.roll(path, -1)
    if not loop.closed:
        following[-1] = path[-2]  # no segment starts at the last point, so the last one is used
    size = len(working.vertices)
    keys = side_keys(working.faces, size)
    order = np.argsort(keys, kind="stable")
    first = np.searchsorted(keys[order], edge_keys(path, following, size))
    face = working.parent_face[order[first] // 3]
    corners = mesh.faces[face]
    barycentric = np.asarray(working.interpolation[path[:, None], corners].todense())
    index = np.full(size, -1)
    index[path] = np.arange(len(path))
    return curve_on_mesh(
        mesh, loop.closed, face, barycentric.reshape(-1, 3), index[loop.control_vertices]
    )


def _separate_strands(split: SplitMesh, loop: list[int], closed: bool) -> None:
    """Insert vertices between neighbouring strands of the loop.

    An edge between two loop vertices that is not an edge of the loop is split, and so is a face
    whose three edges belong to the loop. Then the remaining vertices on the two sides of the loop
    belong to different components, which flood fill can tell apart.
    """
    on_loop = set(loop)
    onward = loop[1:] + loop[:1] if closed else loop[1:]
    loop_edges = {frozenset(edge) for edge in zip(loop, onward, strict=False)}
    for vertex in loop:
        for face in sorted(split.faces_around(vertex)):
            if face not in split.faces_around(vertex):
                continue
            a, b, c = split.corners(face)
            sides = {frozenset(side) for side in ((a, b), (b, c), (c, a))}
            if sides <= loop_edges:
                split.split_face(face)
                continue
            for side in sorted(tuple(sorted(s)) for s in sides - loop_edges):
                if on_loop.issuperset(side):
                    split.split_edge(*side)
                    break
