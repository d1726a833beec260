"""Signs with which a zero set can be an open curve, or a loop that bounds no region.

The zero set of a function always separates the surface. The zero set of a section of a sign bundle
(a line bundle with signs ±1) need not. In every face, each corner reads the value of its vertex
with a sign, and neighbouring faces agree on their common edge up to a common sign. Around an end of
an open curve, or along a closed path that crosses a meridian of a torus once, the value returns
with the opposite sign.

The bundle is built in two steps. First it is trivial away from the initial path: faces on one side
of the path read the vertices of the path with a plus sign and faces on the other side with a minus
sign, so that |φ₀| becomes a section that changes sign across the path. Then every vertex takes the
sign of the nearest side of the path. This makes φ a smooth signed function near the path and moves
the sign changes far away from it. Only the signs of corners enter the operators, the topology and
the contour.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from ..geometry.array_types import IntArray
from ..geometry.mesh import adjacent_sides, sides_among
from ..geometry.sides import two_sides
from ..path.virtual_splits import WorkingMesh
from ..progress import checkpoint
from .initial_loop import InitialLoop


@dataclass(frozen=True)
class SignBundle:
    """Signs with which faces read the values of their corners.

    Attributes
    ----------
    corner_sign : (m, 3) int array
        Sign, ±1, of each corner of each face.
    side : (n,) int array
        Sign, ±1, of the distance to the path at each vertex.
    ends : (e,) int array
        The two end vertices of an open path; empty for a closed path.
    """

    corner_sign: IntArray
    side: IntArray
    ends: IntArray


def build_sign_bundle(working: WorkingMesh, loop: InitialLoop) -> SignBundle:
    """Build the bundle in which the distance to the path changes its sign only across the path."""
    faces = working.faces
    at_corners = sparse.csr_array(corner_matrix(faces, len(working.vertices), None).T)
    corner_sign = np.ones(faces.shape, dtype=np.int64)
    inner = range(len(loop.vertices)) if loop.closed else range(1, len(loop.vertices) - 1)
    before: dict[int, int] = {}
    for index in inner:
        vertex = int(loop.vertices[index])
        checkpoint()
        around = at_corners[[vertex]].indices // 3
        side = _sides(faces, around, vertex, loop.neighbours(index))
        # The faces shared with the previous vertex of the path keep the side they have there.
        turns = (s * before[f] for f, s in zip(around.tolist(), side, strict=True) if f in before)
        side = next(turns, 1) * side
        before = dict(zip(around.tolist(), side.tolist(), strict=True))
        corner, here = np.nonzero(faces[around] == vertex)
        corner_sign[around[corner], here] = side[corner]
    side = _nearest_side(working, loop, corner_sign)
    ends = np.zeros(0, dtype=np.int64) if loop.closed else loop.vertices[[0, -1]]
    return SignBundle(corner_sign * side[faces], side, ends)


def _sides(faces: IntArray, around: IntArray, vertex: int, path_neighbours: list[int]) -> IntArray:
    """Side, ±1, of each face at a vertex of the path; it changes across edges of the path."""
    star = faces[around]
    one, other = adjacent_sides(star)
    path = np.array([[vertex, neighbour] for neighbour in path_neighbours])
    pairs = np.stack([one, other], axis=1) // 3
    return two_sides(len(star), pairs, sides_among(star, path)[one])[1]


def _nearest_side(working: WorkingMesh, loop: InitialLoop, corner_sign: IntArray) -> IntArray:
    """Sign of the nearest side of the path for each vertex, +1 on the path, shape (n,)."""
    n_vertices = len(working.vertices)
    on_path = np.zeros(n_vertices, dtype=bool)
    on_path[loop.vertices] = True
    side = np.zeros(n_vertices, dtype=np.int64)
    side[on_path] = 1
    inner = on_path.copy()
    if not loop.closed:
        inner[loop.vertices[[0, -1]]] = False
    # A face lies on one side of the path only, and so do its corners off the path.
    sign = np.where(inner[working.faces], corner_sign, 0).sum(axis=1)
    for corner in range(3):
        vertex = working.faces[:, corner]
        beside = ~on_path[vertex] & (sign != 0)
        side[vertex[beside]] = np.sign(sign[beside])
    _, _, nearest = csgraph.dijkstra(
        working.edge_graph(),
        directed=False,
        indices=np.flatnonzero(side != 0),
        min_only=True,
        return_predecessors=True,
    )
    return np.where(nearest >= 0, side[nearest.clip(0)], 1)


def local_signs(sign: IntArray, faces: IntArray, bundle: SignBundle | None) -> IntArray:
    """Signs of a field at the corners of faces, from its signs at vertices, shape (m, 3)."""
    return sign[faces] if bundle is None else bundle.corner_sign * sign[faces]


def corner_matrix(faces: IntArray, n_vertices: int, bundle: SignBundle | None) -> sparse.csr_array:
    """Matrix that maps values at vertices to values at corners of faces, shape (3 m, n)."""
    values = np.ones(faces.size) if bundle is None else bundle.corner_sign.ravel().astype(float)
    entries = (values, (np.arange(faces.size), faces.ravel()))
    return sparse.csr_array(sparse.coo_array(entries, shape=(faces.size, n_vertices)))
