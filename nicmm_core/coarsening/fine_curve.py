"""Maps a curve from the coarse mesh to the fine mesh.

Nodes of the coarse curve are projected to the fine faces of their cells and joined by straight
traces, as in the relaxation. Where the fine surface is too rough for a trace, the shortest path
along edges replaces it. Cells and paths follow the surface, so a curve on one side of a thin limb
stays on that side.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from ..geometry.array_types import IntArray
from ..geometry.curve import SurfaceCurve
from ..geometry.grouping import path_between
from ..geometry.mesh import Mesh, unique_edges
from ..geometry.surface_points import SurfacePoints, joined, nearest_points
from ..geometry.tracing import strictly_inside
from ..progress import checkpoint
from ..relaxation.curve_nodes import CurveSurface, Nodes, nodes_at
from ..relaxation.noded_curve import NodedCurve, is_simple, noded_curve, straight_traces
from .coarse_mesh import CoarseMesh

NODES = (256, 512, 128)
"""Numbers of nodes that are tried, in this order.

Finer detail of the coarse curve would come from the coarse mesh and not from the surface. Where
strands are close together, traces between other nodes may avoid a crossing.
"""

MOST_RINGS = 3
"""Number of rings of cells around two nodes in which a path between them is searched for."""


def curve_on_fine_mesh(
    surface: CurveSurface,
    coarse: CoarseMesh,
    coarse_surface: CurveSurface,
    curve: SurfaceCurve,
    controls: SurfacePoints,
) -> SurfaceCurve | None:
    """Map a curve on the coarse mesh to a curve nearby on the fine mesh.

    Parameters
    ----------
    surface, coarse_surface : CurveSurface
        Surfaces of the fine mesh and of ``coarse.mesh``.
    coarse : CoarseMesh
    curve : SurfaceCurve
        A simple curve on the coarse mesh.
    controls : SurfacePoints
        k points of the fine mesh, in the order in which the curve visits them.

    Returns
    -------
    SurfaceCurve or None
        A simple curve exactly through the control points; None if no such curve is found.
    """
    for count in NODES:
        checkpoint()
        coarse_curve = noded_curve(coarse_surface, curve, count)
        result = nodes_on_fine_mesh(surface, coarse, coarse_curve, controls)
        if result is not None:
            return result.surface_curve(surface.mesh)
    return None


def nodes_on_fine_mesh(
    surface: CurveSurface, coarse: CoarseMesh, coarse_curve: NodedCurve, controls: SurfacePoints
) -> NodedCurve | None:
    """The curve on the fine mesh through the nodes of a coarse curve; None if it is not simple.

    Only the nodes of `coarse_curve` are used. The other parameters are those of
    `curve_on_fine_mesh`.
    """
    result = _through_nodes(surface, coarse, coarse_curve, controls)
    return result if result is not None and is_simple(surface, result) else None


def _through_nodes(
    surface: CurveSurface, coarse: CoarseMesh, coarse_curve: NodedCurve, controls: SurfacePoints
) -> NodedCurve | None:
    """The curve through the nodes of a coarse curve, simple or not; None if a gap remains."""
    fine = surface.mesh
    places, cell = _nearest_points(fine, coarse, coarse_curve.nodes.places)
    faces, barycentric = places.faces.copy(), places.barycentric.copy()
    faces[coarse_curve.control_nodes] = controls.faces
    barycentric[coarse_curve.control_nodes] = controls.barycentric
    nodes = nodes_at(surface, SurfacePoints(faces, barycentric), coarse_curve.closed)
    # Normals of the coarse mesh, since they ignore small dents that a trace has to cross.
    smooth = replace(nodes, normals=coarse_curve.nodes.normals)
    polyline, node_place, lost = straight_traces(surface, coarse_curve, smooth)
    bridges: dict[int, SurfacePoints] = {}
    for node in np.flatnonzero(lost).tolist():
        checkpoint()
        following = (node + 1) % len(cell)
        around, bridge = np.unique(cell[[node, following]]), None
        for _ in range(MOST_RINGS):
            around = coarse.cells_around(around)
            inside = coarse.faces_of_cells(fine, around)
            bridge = _path_along_edges(fine, inside, nodes, node, following)
            if bridge is not None:
                break
        if bridge is None:
            return None
        bridges[node] = bridge
    return _with_bridges(coarse_curve, nodes, polyline, node_place, bridges)


def _nearest_points(
    fine: Mesh, coarse: CoarseMesh, points: SurfacePoints
) -> tuple[SurfacePoints, IntArray]:
    """Coarse points projected strictly inside faces of the fine mesh, and their cells, (p,)."""
    positions = points.positions(coarse.mesh)
    cell = coarse.mesh.faces[points.faces, points.barycentric.argmax(axis=1)]
    faces, barycentric = np.zeros(len(points), np.int64), np.zeros((len(points), 3))
    for one in np.unique(cell).tolist():
        checkpoint()
        here = np.flatnonzero(cell == one)
        found, _ = nearest_points(
            fine, positions[here], coarse.faces_of_cells(fine, np.array([one]))
        )
        faces[here], barycentric[here] = found.faces, found.barycentric
    return SurfacePoints(faces, strictly_inside(barycentric)), cell


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
    length = np.maximum(length, np.finfo(float).tiny)
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


def _with_bridges(
    curve: NodedCurve,
    nodes: Nodes,
    polyline: SurfacePoints,
    node_place: IntArray,
    bridges: dict[int, SurfacePoints],
) -> NodedCurve:
    """The polyline with paths along edges in place of failed traces."""
    bounds = np.append(node_place, len(polyline))
    parts = [
        bridges.get(node, polyline[np.arange(bounds[node], bounds[node + 1])])
        for node in range(len(node_place))
    ]
    lengths = np.array([len(part) for part in parts])
    return NodedCurve(nodes, curve.control_nodes, joined(parts), np.cumsum(lengths) - lengths)
