"""The zero level set of φ as curves on the input mesh.

φ is linear in every working face, so its zero set crosses each face in one straight segment, and
the polyline lies on the surface by construction. Control points are vertices where φ is exactly
zero. A vertex close to the contour counts as zero too, if that only collapses a few tiny segments
into one point. At all other vertices a value of 0 counts as positive; otherwise the contour would
branch.
"""

from __future__ import annotations

import numpy as np

from ..geometry import tolerances
from ..geometry.array_types import FloatArray, IntArray
from ..geometry.curve import SurfaceCurve, curve_on_mesh
from ..geometry.mesh import Mesh
from ..path.virtual_splits import WorkingMesh
from ..progress import checkpoint
from .sign_bundle import SignBundle, local_signs
from .vertex_links import VertexLinks

SNAP_MARGIN = 0.03
"""Fraction of an edge's length, from a vertex, within which the contour may snap to the vertex.

Every edge at the vertex that the contour crosses has to be crossed within this fraction.
"""

CROSSING_MARGIN = 1e-6
"""Least distance of a crossing from the ends of its edge, as a fraction of the edge's length.

It keeps neighbouring points of the polyline apart where φ is almost zero at a vertex.
"""


def signs_with_zeros(field: FloatArray, zero_vertices: IntArray) -> IntArray:
    """Sign of φ at every vertex: 0 at ``zero_vertices``, +1 or -1 elsewhere, shape (n,)."""
    sign = np.where(field >= 0.0, 1, -1)
    sign[zero_vertices] = 0
    return sign


def extract_curves(
    mesh: Mesh,
    working: WorkingMesh,
    field: FloatArray,
    control_vertices: IntArray,
    bundle: SignBundle | None = None,
) -> list[SurfaceCurve]:
    """Extract the zero level set of a field that is linear in each face.

    Parameters
    ----------
    mesh : Mesh
        The input mesh.
    working : WorkingMesh
        The working mesh of the input mesh, with n vertices.
    field : (n,) float array
        φ at the working vertices; its values at the control vertices count as zero.
    control_vertices : (k,) int array
        Working vertices of the control points, in the order visited, no two of them neighbours.
    bundle : SignBundle, optional
        Signs with which faces read the values of their corners.

    Returns
    -------
    list of SurfaceCurve
        Curves sorted by number of control points, then by length, both descending. A curve that
        ends at the boundary of the mesh, or at an end of the bundle, is open.
    """
    snapped = _snap_vertices(working, field, control_vertices, bundle)
    through = np.concatenate([control_vertices, snapped])
    segment_face, ends = _crossings(working.faces, signs_with_zeros(field, through), bundle)
    # A node is the pair of ends of an edge on which φ changes sign, smaller vertex first, or a zero
    # vertex twice.
    nodes, index = np.unique(ends.reshape(-1, 2), axis=0, return_inverse=True)
    curves = []
    for chain, along, closed in _chains(index.reshape(-1, 2), len(nodes)):
        chain, along = _directed(chain, along, closed, nodes, control_vertices)
        parent = working.parent_face[segment_face[along]]
        # No segment starts at the last point of an open chain, so it gets the last segment's face.
        parent = parent if closed else np.append(parent, parent[-1])
        barycentric = _barycentric(mesh, working, field, nodes[chain], parent)
        visited = _positions_in(nodes[chain], control_vertices)
        curves.append(curve_on_mesh(mesh, closed, parent, barycentric, visited))
    curves.sort(key=lambda curve: (-(curve.control_index >= 0).sum(), -curve.length))
    return curves


def _snap_vertices(
    working: WorkingMesh,
    field: FloatArray,
    control_vertices: IntArray,
    bundle: SignBundle | None,
) -> IntArray:
    """Vertices to which the contour snaps, besides the control vertices.

    They are simple vertices, and not neighbours of one another or of control vertices.
    """
    sign = signs_with_zeros(field, control_vertices)
    _, ends = _crossings(working.faces, sign, bundle)
    start, end = np.unique(ends[ends[:, :, 0] != ends[:, :, 1]], axis=0).T
    fraction = _crossing_fraction(field, start, end)
    farthest = np.zeros(len(field))
    np.maximum.at(farthest, start, fraction)
    np.maximum.at(farthest, end, 1.0 - fraction)
    crossed = np.unique(np.concatenate([start, end]))
    near = crossed[farthest[crossed] < SNAP_MARGIN]
    links = VertexLinks(working, bundle)
    taken = set(control_vertices.tolist())
    snapped = []
    for vertex in near[np.argsort(farthest[near], kind="stable")].tolist():
        checkpoint()
        if taken.isdisjoint(links.neighbours(vertex)) and links.is_simple(vertex, sign):
            taken.add(vertex)
            snapped.append(vertex)
    return np.array(snapped, dtype=np.int64)


def segment_ends(
    vertices: FloatArray,
    faces: IntArray,
    field: FloatArray,
    sign: IntArray,
    bundle: SignBundle | None = None,
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Find the faces that the zero set crosses, and the ends of its segment in each.

    Parameters
    ----------
    vertices : (n, 3) float array
    faces : (m, 3) int array
    field : (n,) float array
        φ at the vertices.
    sign : (n,) int array
        Signs of φ, from `signs_with_zeros`.
    bundle : SignBundle, optional
        Signs with which faces read the values of their corners.

    Returns
    -------
    crossed : (s,) int array
        Indices of the crossed faces.
    start, end : (s, 3) float array
        Positions of the two ends of each segment.
    """
    crossed, ends = _crossings(faces, sign, bundle)
    first, second = ends.transpose(2, 0, 1)
    fraction = _crossing_fraction(field, first, second)[..., None]
    points = (1.0 - fraction) * vertices[first] + fraction * vertices[second]
    return crossed, points[:, 0], points[:, 1]


def _crossings(
    faces: IntArray, sign: IntArray, bundle: SignBundle | None
) -> tuple[IntArray, IntArray]:
    """Faces that the zero set crosses, (s,), and the two ends of its segments, (s, 2, 2).

    An end is an edge on which the sign changes, smaller vertex first, or a zero vertex twice.
    """
    corner_sign = local_signs(sign, faces, bundle)
    crossed = np.flatnonzero((corner_sign == 1).any(axis=1) & (corner_sign == -1).any(axis=1))
    faces, corner_sign = faces[crossed], corner_sign[crossed]
    ends = []
    for first, second in ((0, 1), (1, 2), (2, 0)):
        changes = corner_sign[:, first] * corner_sign[:, second] < 0
        edge = np.sort(faces[:, [first, second]], axis=1)
        ends.append(np.where(changes[:, None], edge, -1))
    for corner in range(3):
        at_zero = corner_sign[:, [corner]] == 0
        ends.append(np.where(at_zero, faces[:, [corner, corner]], -1))
    candidates = np.stack(ends, axis=1)  # (s, 6, 2), exactly two of the six are ends
    return crossed, candidates[candidates[:, :, 0] >= 0].reshape(-1, 2, 2)


def _crossing_fraction(field: FloatArray, first: IntArray, second: IntArray) -> FloatArray:
    """Position of the zero of φ on each edge, as a fraction from the first end; 0 at a vertex."""
    here, there = np.abs(field[first]), np.abs(field[second])
    fraction = here / np.maximum(here + there, tolerances.TINY)
    return np.where(first == second, 0.0, fraction)


def _chains(segments: IntArray, n_nodes: int) -> list[tuple[IntArray, IntArray, bool]]:
    """Join segments into chains: (nodes, segments between them, closed), using each segment once.

    A chain ends where more than two segments meet. On a manifold that happens only at a vertex
    through which two strands pass.
    """
    at_node: list[list[int]] = [[] for _ in range(n_nodes)]
    for segment, (a, b) in enumerate(segments.tolist()):
        at_node[a].append(segment)
        at_node[b].append(segment)
    unused = np.ones(len(segments), dtype=bool)
    chains = []

    def walk(start: int, segment: int) -> tuple[list[int], list[int]]:
        chain, along = [start], []
        while True:
            unused[segment] = False
            along.append(segment)
            a, b = segments[segment]
            chain.append(int(b if a == chain[-1] else a))
            onward = [s for s in at_node[chain[-1]] if unused[s]]
            if chain[-1] == start or len(at_node[chain[-1]]) != 2 or not onward:
                return chain, along
            segment = onward[0]

    irregular = [node for node in range(n_nodes) if len(at_node[node]) != 2]
    for start in [*irregular, *range(n_nodes)]:
        for segment in at_node[start]:
            if unused[segment]:
                chain, along = walk(start, segment)
                closed = chain[0] == chain[-1]
                nodes = chain[:-1] if closed else chain
                chains.append((np.array(nodes), np.array(along), closed))
    return chains


def _directed(
    chain: IntArray, along: IntArray, closed: bool, nodes: IntArray, control_vertices: IntArray
) -> tuple[IntArray, IntArray]:
    """Direct a chain and its segments so that it passes the control points in their order.

    A closed chain starts at its first control point and runs towards the second. An open chain
    keeps its two ends, and passes its first control point before its last one.
    """
    where = _positions_in(nodes[chain], control_vertices)
    where = where[where >= 0]
    if closed and len(where):
        chain, along = np.roll(chain, -where[0]), np.roll(along, -where[0])
        onward = (where - where[0]) % len(chain)
        if len(onward) > 2 and onward[1] > onward[2]:
            chain, along = np.roll(chain[::-1], 1), along[::-1]
    elif len(where) > 1 and where[0] > where[-1]:
        chain, along = chain[::-1], along[::-1]
    return chain, along


def _positions_in(nodes: IntArray, control_vertices: IntArray) -> IntArray:
    """Index of each control vertex among the nodes, or -1 if it is not a node, shape (k,)."""
    at_vertex = np.flatnonzero(nodes[:, 0] == nodes[:, 1])
    found = {int(nodes[i, 0]): int(i) for i in at_vertex}
    return np.array([found.get(int(vertex), -1) for vertex in control_vertices], dtype=np.int64)


def _barycentric(
    mesh: Mesh, working: WorkingMesh, field: FloatArray, nodes: IntArray, parent: IntArray
) -> FloatArray:
    """Barycentric coordinates of contour nodes in the input faces ``parent``, shape (p, 3)."""
    first, second = nodes.T
    fraction = _crossing_fraction(field, first, second)
    fraction = np.clip(fraction, CROSSING_MARGIN, 1.0 - CROSSING_MARGIN)[:, None]
    corners = mesh.faces[parent]
    weights = working.interpolation
    start = np.asarray(weights[first[:, None], corners].todense()).reshape(-1, 3)
    end = np.asarray(weights[second[:, None], corners].todense()).reshape(-1, 3)
    return np.where((first == second)[:, None], start, (1.0 - fraction) * start + fraction * end)
