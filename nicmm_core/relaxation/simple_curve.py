"""Joins nodes to a simple curve on a mesh.

Nodes are joined by straight traces. Where the surface is too rough for a trace, the shortest path
along edges replaces it. Where neighbouring nodes have changed places, as at ridges that a coarser
mesh has cut off, the curve crosses itself in small loops; their nodes are removed.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.crossings import crossing_segments
from ..geometry.grouping import path_between
from ..geometry.mesh import Mesh, unique_edges
from ..geometry.surface_points import SurfacePoints, joined
from ..geometry.tracing import strictly_inside
from ..progress import checkpoint
from .curve_nodes import CurveSurface, Nodes
from .discrete_curve import DiscreteCurve, noded, traced_polyline

ROUNDS = 4
"""Rounds in which loops are removed; traces between the remaining nodes may cross again."""

RINGS = (2, 4, 8)
"""Numbers of rings of faces around two nodes in which a path between them is searched for."""

Paths = dict[tuple[int, int], SurfacePoints]
"""Paths along edges by the numbers of their two nodes."""

Neighbourhoods = Callable[[IntArray], Iterator[IntArray]]
"""Yields growing sets of faces around the faces of two nodes, (2,)."""


def simple_curve(
    surface: CurveSurface,
    places: SurfacePoints,
    control_nodes: IntArray,
    controls: SurfacePoints,
    closed: bool,
    normals: FloatArray | None = None,
    neighbourhoods: Neighbourhoods | None = None,
    corners: BoolArray | None = None,
) -> DiscreteCurve | None:
    """Join nodes to a simple curve through control points.

    Parameters
    ----------
    surface : CurveSurface
    places : SurfacePoints
        Places of n nodes.
    control_nodes : (k,) int array
        Indices of the nodes at control points; the first one is 0.
    controls : SurfacePoints
        The k control points, which replace the places of these nodes.
    closed : bool
    normals : (n, 3) float array, optional
        Normals at the nodes, which the planes of traces contain; by default those of the surface.
    neighbourhoods : Neighbourhoods, optional
        Where a path along edges is searched for; by default in rings of faces.
    corners : (k,) bool array, optional
        Control points at which the curve may turn freely.

    Returns
    -------
    DiscreteCurve or None
        A simple curve through the control points and most of the other nodes. None if a step cannot
        be traced or replaced by a path, or if crossings remain after `ROUNDS` rounds.
    """
    faces, barycentric = places.faces.copy(), strictly_inside(places.barycentric)
    faces[control_nodes], barycentric[control_nodes] = controls.faces, controls.barycentric
    places = SurfacePoints(faces, barycentric)
    if neighbourhoods is None:
        neighbourhoods = _rings(surface.mesh)
    numbers, paths = np.arange(len(places)), Paths()
    for _ in range(ROUNDS):
        checkpoint()
        bare = noded(surface, places, control_nodes, closed)
        curve = _joined(surface, bare, normals, neighbourhoods, numbers, paths)
        if curve is None:
            return None
        crossings = crossing_segments(surface.mesh.faces, curve.polyline, closed)
        if not len(crossings):
            return curve if corners is None else curve.with_corners(corners)
        outside = _outside_loops(curve, crossings)
        if outside.all():
            return None
        places, numbers = places[outside], numbers[outside]
        normals = None if normals is None else normals[outside]
        control_nodes = (np.cumsum(outside) - 1)[control_nodes]
    return None


def _joined(
    surface: CurveSurface,
    curve: DiscreteCurve,
    normals: FloatArray | None,
    neighbourhoods: Neighbourhoods,
    numbers: IntArray,
    paths: Paths,
) -> DiscreteCurve | None:
    """The curve through the nodes of a curve, simple or not; None if a gap remains.

    New paths along edges are added to `paths`, with the numbers of the nodes, (n,).
    """
    nodes = curve.nodes
    traced = nodes
    if normals is not None:
        traced = Nodes(nodes.places, nodes.closed, nodes.positions, normals, nodes.phi_fea)
    polyline, node_index, lost = traced_polyline(surface, curve, traced)
    bypasses: dict[int, SurfacePoints] = {}
    for node in np.flatnonzero(lost).tolist():
        checkpoint()
        following = (node + 1) % len(lost)
        pair = int(numbers[node]), int(numbers[following])
        if pair not in paths:
            for inside in neighbourhoods(nodes.places.faces[[node, following]]):
                path = _path_along_edges(surface.mesh, inside, nodes, node, following)
                if path is not None:
                    paths[pair] = path
                    break
            else:
                return None
        bypasses[node] = paths[pair]
    return _with_paths(curve, polyline, node_index, bypasses)


def _outside_loops(curve: DiscreteCurve, crossings: IntArray) -> BoolArray:
    """Which nodes, (n,), lie outside the loops between crossing segments, (p, 2).

    Of the two parts of a closed curve, the one with fewer nodes is the loop. A loop with a control
    point cannot be removed; its two neighbours are removed instead, which changes its traces.
    """
    n = len(curve.node_index)
    control = np.zeros(n, dtype=bool)
    control[curve.control_nodes] = True
    steps = np.searchsorted(curve.node_index, crossings, side="right") - 1
    outside = np.ones(n, dtype=bool)
    for low, high in np.unique(np.sort(steps, axis=1), axis=0).tolist():
        first, last = low, high
        if curve.closed and 2 * (high - low) > n:
            first, last = high, low + n
        loop = np.arange(first + 1, last + 1) % n
        if control[loop].any():
            loop = np.array([first, last + 1]) % n
        outside[loop] = False
    return outside | control


def _rings(mesh: Mesh) -> Neighbourhoods:
    """Rings of faces around two faces."""

    def neighbourhoods(faces: IntArray) -> Iterator[IntArray]:
        count = 0
        for rings in RINGS:
            while count < rings:
                faces = mesh.faces_at(np.unique(mesh.faces[faces]))
                count += 1
            yield faces

    return neighbourhoods


def _path_along_edges(
    mesh: Mesh, inside: IntArray, nodes: Nodes, start: int, end: int
) -> SurfacePoints | None:
    """The shortest path along edges of given faces from one node to another, without its end.

    None if there is no such path.
    """
    vertices, faces = np.unique(mesh.faces[inside], return_inverse=True)
    edges, _ = unique_edges(faces.reshape(-1, 3))
    ends = nodes.places[np.array([start, end])]
    place = {vertex: number for number, vertex in enumerate(vertices.tolist())}
    here, there = len(vertices), len(vertices) + 1
    links = [
        (node, place[vertex], ends.faces[number], weight)
        for number, node in enumerate((here, there))
        for vertex, weight in zip(
            mesh.faces[ends.faces[number]].tolist(), ends.barycentric[number], strict=True
        )
        if vertex in place
    ]
    positions = np.concatenate([mesh.vertices[vertices], nodes.positions[[start, end]]])
    arcs = np.concatenate([edges, np.array([link[:2] for link in links]).reshape(-1, 2)])
    length = np.linalg.norm(positions[arcs[:, 0]] - positions[arcs[:, 1]], axis=1)
    size = len(positions)
    # A sparse graph has no arc where the length is zero.
    length = np.maximum(length, tolerances.TINY)
    graph = sparse.csr_array((length, (arcs[:, 0], arcs[:, 1])), shape=(size, size))
    _, previous = csgraph.dijkstra(graph, directed=False, indices=here, return_predecessors=True)
    if previous[there] < 0:
        return None
    path = path_between(previous, here, there)[1:-1]
    return _points_of_path(mesh, ends, vertices[path].tolist())


def _points_of_path(mesh: Mesh, ends: SurfacePoints, path: list[int]) -> SurfacePoints | None:
    """A path along vertices as points, each in the face of the segment after it.

    The first of the two ends is included, the second is not. None if a segment lies in no face.
    """
    weights = [
        {vertex: weight for vertex, weight in zip(*point, strict=True) if weight > 0.0}
        for point in zip(mesh.faces[ends.faces].tolist(), ends.barycentric.tolist(), strict=True)
    ]
    # An end that lies at a vertex of the path must not be repeated.
    inner = [{vertex: 1.0} for vertex in path]
    inner = inner[weights[0].keys() == {path[0]} :]
    if inner and weights[1].keys() == {path[-1]}:
        inner.pop()
    stops = [weights[0], *inner, weights[1]]
    faces, barycentric = [], []
    for here, there in itertools.pairwise(stops):
        common = mesh.faces_with(np.array([*here, *there]))
        if not len(common):
            return None
        faces.append(common[0])
        barycentric.append([here.get(corner, 0.0) for corner in mesh.faces[common[0]].tolist()])
    return SurfacePoints(np.array(faces, dtype=np.int64), np.array(barycentric))


def _with_paths(
    curve: DiscreteCurve,
    polyline: SurfacePoints,
    node_index: IntArray,
    paths: dict[int, SurfacePoints],
) -> DiscreteCurve:
    """The polyline with paths along edges in place of failed traces."""
    if not paths:
        return DiscreteCurve(curve.nodes, curve.control_nodes, polyline, node_index)
    bounds = np.append(node_index, len(polyline)).tolist()
    parts = [
        paths.get(node, polyline[slice(*bounds[node : node + 2])])
        for node in range(len(node_index))
    ]
    lengths = np.array([len(part) for part in parts])
    return DiscreteCurve(
        curve.nodes, curve.control_nodes, joined(parts), np.cumsum(lengths) - lengths
    )
