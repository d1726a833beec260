"""Removes vertices at which an edge is divided although it is straight there.

Cleaning divides edges at the corners of faces without area and at T-junctions. Where the two faces
on either side of such a vertex form one triangle, they are joined again. So a mesh with edges
divided in this way has the same copy as the mesh without the divisions.

Every face of the given mesh is then a part of a face of the new one. Curves are computed on the new
mesh, and get a point wherever they cross an edge of the given one (`mapped_mesh`).
"""

from __future__ import annotations

import numpy as np

from ..geometry.array_types import IntArray
from ..geometry.mesh import Mesh, feet_on_edges
from ..progress import checkpoint
from .face_parts import FaceParts, whole_faces


def straightened(mesh: Mesh, divisions: IntArray) -> tuple[Mesh, FaceParts]:
    """Remove vertices at which straight edges are divided.

    Parameters
    ----------
    mesh : Mesh
        A manifold.
    divisions : (d, 3) int array
        Vertices at which edges were divided, and the two ends of the edge of each.

    Returns
    -------
    Mesh
        The mesh with the same vertices, some of which belong to no face; the given one if no vertex
        can be removed.
    FaceParts
        The given faces as parts of its faces.
    """
    parts = whole_faces(mesh.faces)
    if not len(divisions):
        return mesh, parts
    ends = np.full((len(mesh.vertices), 2), -1)
    ends[divisions[:, 0]] = divisions[:, 1:]
    share, _ = feet_on_edges(mesh.vertices, ends, np.arange(len(ends)))
    faces, parent, corners = mesh.faces.copy(), parts.parent, parts.corners.copy()
    while True:
        checkpoint()
        one, other, middle = _joinable(faces, ends)
        if not len(middle):
            break
        pair, middle = np.concatenate([one, other]), np.tile(middle, 2)[:, None]
        old = faces[pair]
        faces[one] = np.where(old == middle, ends[middle, 1], old)[: len(one)]
        into = np.arange(len(faces))
        into[other] = one
        new = faces[into[pair]]
        at_start, at_end = (new == ends[middle, k] for k in (0, 1))
        at_middle = (1.0 - share[middle]) * at_start + share[middle] * at_end
        matrix = np.broadcast_to(np.eye(3), (len(faces), 3, 3)).copy()
        matrix[pair] = np.where(
            (old == middle)[:, :, None], at_middle[:, None], old[:, :, None] == new[:, None]
        )
        touched = np.isin(parent, pair)
        corners[touched] = corners[touched] @ matrix[parent[touched]]
        left = into == np.arange(len(faces))
        faces, parent = faces[left], (np.cumsum(left) - 1)[into[parent]]
    if len(faces) == len(mesh.faces):
        return mesh, parts
    return Mesh(mesh.vertices, faces), FaceParts(mesh.faces, parent, corners)


def _joinable(faces: IntArray, ends: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Pairs of faces that can be joined, on all sides of some vertices without common faces.

    Parameters
    ----------
    faces : (F, 3) int array
        Corner indices of each triangle.
    ends : (V, 2) int array
        Ends of the edge that each vertex divides, or -1.

    Returns
    -------
    (p,) int array
        The face of each pair at the first end of the edge.
    (p,) int array
        Its face at the second end.
    (p,) int array
        The vertex that divides the edge.
    """
    face, corner = np.nonzero(ends[faces, 0] >= 0)
    vertex = faces[face, corner]
    beside = np.stack([faces[face, corner - 2], faces[face, corner - 1]], axis=1)
    at_start, at_end = ((beside == ends[vertex, k, None]).any(axis=1) for k in (0, 1))
    tip = beside.sum(axis=1) - ends[vertex, at_end.astype(np.int64)]
    # Sorted so that the two faces of a pair follow each other, the one at the first end first.
    row = np.flatnonzero(at_start != at_end)
    row = row[np.lexsort((at_end[row], tip[row], vertex[row]))]
    one, other = row[:-1], row[1:]
    matched = (vertex[one] == vertex[other]) & (tip[one] == tip[other])
    matched &= at_start[one] & at_end[other]
    one, other = one[matched], other[matched]
    size = len(ends)
    in_pairs = 2 * np.bincount(vertex[one], minlength=size)
    good = in_pairs == np.bincount(vertex, minlength=size)
    # Of vertices with a common face, the first one is removed now.
    claims = np.full(len(faces), size)
    kept = good[vertex]
    np.minimum.at(claims, face[kept], vertex[kept])
    good[vertex[kept & (claims[face] != vertex)]] = False
    chosen = good[vertex[one]]
    return face[one[chosen]], face[other[chosen]], vertex[one[chosen]]
