"""The part of a mesh on one side of a plane, whose faces are faces of the mesh or parts of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.grouping import distinct_rows
from ..geometry.mesh import Mesh
from ..geometry.mirror import ON_PLANE, Plane
from ..repair.face_parts import FaceParts


@dataclass(frozen=True)
class HalfMesh:
    """The faces of a mesh on one side of a plane; faces that the plane cuts are cut there.

    Attributes
    ----------
    mesh : Mesh
    parts : FaceParts
        Its faces as parts of those of the whole mesh.
    parents : (v,) int array
        A face of the whole mesh that contains each vertex.
    barycentric : (v, 3) float array
        Coordinates of the vertex in that face.
    on_plane : (v,) bool array
        Which vertices are on the plane.
    """

    mesh: Mesh
    parts: FaceParts
    parents: IntArray
    barycentric: FloatArray
    on_plane: BoolArray

    def weights_to(self, whole: Mesh, weights: FloatArray) -> FloatArray:
        """Weights at the vertices of the whole mesh, (V,), interpolated at those of the half."""
        result: FloatArray = (self.barycentric * weights[whole.faces[self.parents]]).sum(axis=1)
        return result


def half_mesh(mesh: Mesh, plane: Plane) -> HalfMesh | None:
    """Cut a mesh along a plane, and keep the side to which the normal of the plane points.

    None if no face has a part on this side.
    """
    heights = plane.heights(mesh.vertices)
    heights[np.abs(heights) <= ON_PLANE * mesh.diagonal] = 0.0
    faces, parent = mesh.faces, np.arange(len(mesh.faces))
    above, below = ((heights * sign > 0.0)[faces].sum(axis=1) for sign in (1.0, -1.0))
    whole = np.flatnonzero((above > 0) & (below == 0))
    # A cut face begins with the corner that is alone on its side, or next to one on the plane.
    tips = np.flatnonzero((above == 1) & (below > 0))
    stumps = np.flatnonzero((above == 2) & (below > 0))
    first = np.append(
        (heights[faces[tips]] > 0.0).argmax(axis=1), (heights[faces[stumps]] < 0.0).argmax(axis=1)
    )
    cut = np.append(tips, stumps)
    turn = (first[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(faces[cut], turn, axis=1).T
    corners = np.eye(3)[turn]
    at_b, at_c = (_crossing(heights[a], heights[end]) for end in (b, c))
    ab = (1.0 - at_b)[:, None] * corners[:, 0] + at_b[:, None] * corners[:, 1]
    ac = (1.0 - at_c)[:, None] * corners[:, 0] + at_c[:, None] * corners[:, 2]
    tip, stump = slice(0, len(tips)), slice(len(tips), None)
    b_corner, c_corner = corners[:, 1], corners[:, 2]
    pieces = [
        (parent[whole], np.broadcast_to(np.eye(3), (len(whole), 3, 3))),
        (tips, np.stack([corners[tip, 0], ab[tip], ac[tip]], axis=1)),
        (stumps, np.stack([ab[stump], b_corner[stump], c_corner[stump]], axis=1)),
        (stumps, np.stack([ab[stump], c_corner[stump], ac[stump]], axis=1)),
    ]
    parents = np.concatenate([piece[0] for piece in pieces])
    weights = np.concatenate([piece[1] for piece in pieces])
    if not len(parents):
        return None
    every, of_corner = np.repeat(parents, 3), weights.reshape(-1, 3)
    # A vertex is known by the ends of the edge on which it lies.
    ends = np.sort(np.where(of_corner > 0.0, faces[every], -1), axis=1)
    chosen, number = distinct_rows(ends)
    positions = np.einsum("nc,ncd->nd", of_corner[chosen], mesh.vertices[faces[every[chosen]]])
    on_plane = np.abs(plane.heights(positions)) <= ON_PLANE * mesh.diagonal
    half = Mesh(positions, number.reshape(-1, 3))
    parts = FaceParts(half.faces, parents, weights)
    return HalfMesh(half, parts, every[chosen], of_corner[chosen], on_plane)


def _crossing(here: FloatArray, there: FloatArray) -> FloatArray:
    """Where the height is zero between two ends of other signs, as a fraction; 1 if `there` is."""
    share: FloatArray = here / (here - there)
    return share
