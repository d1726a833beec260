"""Removes vertices at which an edge is divided although it is straight there.

Cleaning divides edges at the corners of faces without area and at T-junctions. Where the two faces
on either side of such a vertex form one triangle, they are joined again. So a mesh with edges
divided in this way has the same copy as the mesh without the divisions.

Every face of the given mesh is then a part of a face of the new one. Curves are computed on the new
mesh, and get a point wherever they cross an edge of the given one.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..geometry import tolerances
from ..geometry.array_types import FloatArray, IntArray
from ..geometry.curve import (
    SurfaceCurve,
    curve_on_mesh,
    points_of,
    with_points,
    without_small_weights,
)
from ..geometry.mesh import Mesh
from ..geometry.surface_points import SurfacePoints, weights_at
from ..progress import checkpoint


@dataclass(frozen=True)
class StraightenedMesh:
    """A mesh without the vertices that divide straight edges, and its map to the given mesh.

    Attributes
    ----------
    original : Mesh
        The given mesh, a manifold.
    mesh : Mesh
        The new mesh, with the same vertices, some of which belong to no face.
    parent : (F,) int array
        Face of the new mesh that contains each face of the given one.
    corners : (F, 3, 3) float array
        Barycentric coordinates of the corners of each given face in this face.
    """

    original: Mesh
    mesh: Mesh
    parent: IntArray
    corners: FloatArray

    def points_to(self, points: SurfacePoints) -> SurfacePoints:
        """Map points of the given mesh to the new one."""
        weights = np.einsum("nc,ncd->nd", points.barycentric, self.corners[points.faces])
        return SurfacePoints(self.parent[points.faces], weights)

    def weights_to(self, weights: FloatArray) -> FloatArray:
        """Map weights at the vertices, (V,), which both meshes have in common."""
        return weights

    def curve_to(self, curve: SurfaceCurve) -> SurfaceCurve:
        """Map a curve on the given mesh to the new one."""
        return with_points(self.mesh, curve, self.points_to(points_of(curve)))

    def field_back(self, values: FloatArray) -> FloatArray:
        """Map values at the vertices of the new mesh, (V,), to the given mesh, (V,)."""
        at_corners = values[self.mesh.faces[self.parent]]
        result = values.copy()
        result[self.original.faces] = np.einsum("fcd,fd->fc", self.corners, at_corners)
        return result

    def curve_back(self, curve: SurfaceCurve) -> SurfaceCurve:
        """Map a curve on the new mesh to the given one."""
        n = len(curve.faces)
        following = np.append(np.arange(1, n), 0 if curve.closed else n - 1)
        faces = self.mesh.faces[curve.faces]
        ends = weights_at(
            self.mesh.faces[curve.faces[following]], curve.barycentric[following], faces
        )
        order, begin = self._by_parent
        count = begin[curve.faces + 1] - begin[curve.faces]
        first = order[begin[curve.faces]]
        whole = np.einsum("nd,ndc->nc", curve.barycentric, np.linalg.inv(self.corners[first]))
        parts: list[tuple[int, FloatArray]] = []
        index = np.empty(n, dtype=np.int64)
        for point, face in enumerate(curve.faces.tolist()):
            index[point] = len(parts)
            if count[point] == 1:
                parts.append((int(first[point]), whole[point]))
                continue
            within = order[begin[face] : begin[face + 1]]
            parts += self._through_parts(within, curve.barycentric[point], ends[point])
        weights = np.array([weights for _, weights in parts])
        weights = without_small_weights(weights, np.full(len(weights), tolerances.ROUNDED))
        control_index = np.where(curve.control_index >= 0, index[curve.control_index], -1)
        found = np.array([face for face, _ in parts])
        return curve_on_mesh(self.original, curve.closed, found, weights, control_index)

    def _through_parts(
        self, parts: IntArray, start: FloatArray, end: FloatArray
    ) -> list[tuple[int, FloatArray]]:
        """Divide a segment of one face at the edges between its parts.

        Parameters
        ----------
        parts : (k,) int array
            Faces of the given mesh that are the parts of the face.
        start, end : (3,) float array
            Barycentric coordinates of the ends of the segment in the face.

        Returns
        -------
        list of (int, (3,) float array)
            The start and each crossing, in the part in which the segment continues there.
        """
        inverse = np.linalg.inv(self.corners[parts])
        first, last = start @ inverse, end @ inverse  # (k, 3)
        change = last - first
        with np.errstate(divide="ignore", invalid="ignore"):
            zero = -first / change
        entry = np.where(change > 0.0, zero, np.where(first < -tolerances.ROUNDED, np.inf, 0.0))
        leave = np.where(change < 0.0, zero, np.inf)
        enters, leaves = entry.max(axis=1).clip(0.0), leave.min(axis=1).clip(max=1.0)
        result: list[tuple[int, FloatArray]] = []
        here, margin = 0.0, tolerances.SNAP
        while True:
            ahead = np.flatnonzero(enters <= here + margin)
            part = int(ahead[leaves[ahead].argmax()]) if len(ahead) else int(first.min(1).argmax())
            result.append((int(parts[part]), (first + here * change)[part].clip(0.0)))
            if leaves[part] >= 1.0 - margin or leaves[part] <= here:
                return result
            here = float(leaves[part])

    @cached_property
    def _by_parent(self) -> tuple[IntArray, IntArray]:
        """Faces of the given mesh sorted by parent, and where each parent begins."""
        counts = np.bincount(self.parent, minlength=len(self.mesh.faces))
        return np.argsort(self.parent, kind="stable"), np.cumsum([0, *counts])


def straightened(mesh: Mesh, divisions: IntArray) -> StraightenedMesh | None:
    """Remove vertices at which straight edges are divided.

    Parameters
    ----------
    mesh : Mesh
        A manifold.
    divisions : (d, 3) int array
        Vertices at which edges were divided, and the two ends of the edge of each.

    Returns
    -------
    StraightenedMesh or None
        None if no vertex can be removed.
    """
    if not len(divisions):
        return None
    ends = np.full((len(mesh.vertices), 2), -1)
    ends[divisions[:, 0]] = divisions[:, 1:]
    start, end = (np.take(mesh.vertices, of, axis=0) for of in ends.T)
    way, offset = end - start, mesh.vertices - start
    squared = np.maximum(np.einsum("vd,vd->v", way, way), tolerances.TINY)
    share = np.einsum("vd,vd->v", offset, way) / squared
    faces, parent = mesh.faces.copy(), np.arange(len(mesh.faces))
    corners = np.broadcast_to(np.eye(3), (len(faces), 3, 3)).copy()
    gone = np.zeros(len(faces), dtype=bool)
    while True:
        checkpoint()
        one, other = _joinable(np.where(gone[:, None], -1, faces), ends)
        if not len(one):
            break
        middle = one[:, 1]
        of_one, of_other = one[:, 0] // 3, other[:, 0] // 3
        at_middle, at_start = one[:, 0] % 3, one[:, 2]
        matrix = np.broadcast_to(np.eye(3), (len(faces), 3, 3)).copy()
        eye = np.eye(3)
        point = (1.0 - share[middle])[:, None] * eye[at_start]
        point += share[middle][:, None] * eye[at_middle]
        matrix[of_one, at_middle] = point
        # The other face: its corners are the vertex that is removed, the end and the tip.
        tip = 3 - at_middle - at_start
        matrix[of_other, other[:, 0] % 3] = point
        matrix[of_other, other[:, 2]] = eye[at_middle]
        matrix[of_other, 3 - other[:, 0] % 3 - other[:, 2]] = eye[tip]
        faces[of_one, at_middle] = faces[of_other, other[:, 2]]
        gone[of_other] = True
        into = np.arange(len(faces))
        into[of_other] = of_one
        touched = np.isin(parent, np.concatenate([of_one, of_other]))
        corners[touched] = corners[touched] @ matrix[parent[touched]]
        parent = into[parent]
    if not gone.any():
        return None
    number = np.cumsum(~gone) - 1
    return StraightenedMesh(mesh, Mesh(mesh.vertices, faces[~gone]), number[parent], corners)


def _joinable(faces: IntArray, ends: IntArray) -> tuple[IntArray, IntArray]:
    """Pairs of faces that can be joined, on all sides of some vertices without common faces.

    Parameters
    ----------
    faces : (F, 3) int array
        Corner indices of each triangle, -1 for faces that no longer exist.
    ends : (V, 2) int array
        Ends of the edge that each vertex divides, or -1.

    Returns
    -------
    one, other : (p, 3) int array
        For each pair, in the face at the first end and in the face at the second end: the index
        3 f + j of the corner at the vertex, the vertex, and the place of the end in its face.
    """
    corner = np.flatnonzero((faces >= 0).ravel() & (ends[faces.ravel(), 0] >= 0))
    vertex, face, place = faces.ravel()[corner], corner // 3, corner % 3
    beside = np.stack([(place + 1) % 3, (place + 2) % 3], axis=1)
    at_sides = np.take_along_axis(faces[face], beside, axis=1)
    is_end = at_sides[:, :, None] == ends[vertex][:, None, :]  # (rows, 2 sides, 2 ends)
    sound = is_end.sum(axis=(1, 2)) == 1
    side, which = is_end.any(axis=2).argmax(axis=1), is_end[:, :, 1].any(axis=1).astype(np.int64)
    tip = at_sides[np.arange(len(side)), 1 - side]
    row = np.stack([corner, vertex, beside[np.arange(len(side)), side]], axis=1)
    # Sorted so that the two faces of a pair follow each other, the one at the first end first.
    size = len(ends)
    order = np.lexsort((which, tip, vertex))
    count = np.bincount(vertex, minlength=size)
    good = (count == 2) | (count == 4)
    good[vertex[~sound]] = False
    order = order[good[vertex[order]]]
    one, other = order[0::2], order[1::2]
    matched = (which[one] == 0) & (which[other] == 1) & (tip[one] == tip[other])
    good[vertex[one[~matched]]] = False
    claims = np.full(len(faces), size)
    kept = order[good[vertex[order]]]
    np.minimum.at(claims, face[kept], vertex[kept])
    good[vertex[kept[claims[face[kept]] != vertex[kept]]]] = False
    chosen = good[vertex[one]]
    return row[one[chosen]], row[other[chosen]]
