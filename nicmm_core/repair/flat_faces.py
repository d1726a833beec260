"""Removes faces without area, so that the faces around them meet.

Where two corners of such a face coincide, they become one vertex. Where a corner lies on the
opposite side, the face beyond that side is divided at this corner. Both close the surface again,
since the face that is removed has no width.
"""

from __future__ import annotations

import numpy as np

from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.grouping import first_of_components, occurrences
from ..geometry.mesh import side_keys
from ..progress import checkpoint
from .degenerate_faces import degenerate_faces
from .face_parts import FaceParts

ROUNDS = 1_000
"""Greatest number of rounds. In each, faces that do not affect one another are removed, so faces
that lie over one another, such as a fan without area, need several."""


def without_flat_faces(
    vertices: FloatArray, parts: FaceParts, short: float
) -> tuple[FaceParts, IntArray, IntArray]:
    """Remove faces without area.

    Faces that remain without area after `ROUNDS` rounds are kept.

    Parameters
    ----------
    vertices : (v, 3) float array
    parts : FaceParts
        Faces with different corners each.
    short : float
        Length up to which the ends of an edge coincide, in the unit of the positions.

    Returns
    -------
    FaceParts
        The remaining faces, some of them divided.
    (v,) int array
        The vertex that takes the place of each vertex.
    (d, 3) int array
        Vertices at which sides of faces were divided, and the two ends of the side of each.
    """
    flat = degenerate_faces(vertices, parts.faces, short)
    if not flat.any():
        return parts, np.arange(len(vertices)), np.zeros((0, 3), dtype=np.int64)
    # Nothing changes but these faces and those that share a vertex with them.
    touched = np.zeros(len(vertices), dtype=bool)
    touched[parts.faces[flat]] = True
    near = touched[parts.faces].any(axis=1)
    changed, place, divisions = _without_flat_faces(vertices, parts.taken(near), short)
    return parts.taken(~near).joined(changed), place, divisions


def _without_flat_faces(
    vertices: FloatArray, parts: FaceParts, short: float
) -> tuple[FaceParts, IntArray, IntArray]:
    """`without_flat_faces`, with work in proportion to the faces and the rounds."""
    divisions = [np.zeros((0, 3), dtype=np.int64)]
    place = np.arange(len(vertices))
    for _ in range(ROUNDS):
        checkpoint()
        flat = degenerate_faces(vertices, parts.faces, short)
        if not flat.any():
            break
        merged = _merged(vertices, parts.faces[flat], short)
        if merged is not None:
            place = merged[place]
            divisions = [merged[each] for each in divisions]
            parts = parts.renumbered(merged)
        else:
            parts, divided = _without_caps(vertices, parts, flat)
            divisions.append(divided)
        parts = parts.distinct()
    return parts, place, np.concatenate(divisions)


def _merged(vertices: FloatArray, faces: IntArray, short: float) -> IntArray | None:
    """The first vertex at the place of each vertex, if sides of faces have no length, else None."""
    start, end = faces[:, [1, 2, 0]].ravel(), faces[:, [2, 0, 1]].ravel()
    none = np.linalg.norm(vertices[end] - vertices[start], axis=1) <= short
    if not none.any():
        return None
    return first_of_components(len(vertices), start[none], end[none])


def _without_caps(
    vertices: FloatArray, parts: FaceParts, flat: BoolArray
) -> tuple[FaceParts, IntArray]:
    """Remove flat faces with a corner on the opposite side, and divide the faces beyond it.

    Of flat faces that concern the same face, only one is removed. Those beyond which there is
    another flat face wait until that one has been removed.

    Returns
    -------
    FaceParts
        The remaining faces.
    (d, 3) int array
        Vertices at which sides were divided, and the two ends of the side of each.
    """
    caps = np.flatnonzero(flat)
    tip = _opposite_longest_side(vertices, parts.faces[caps])
    rank, beyond = _faces_beyond(parts.faces, caps, tip)
    waits = np.zeros(len(caps), dtype=bool)
    waits[rank[flat[beyond]]] = True
    if not waits.all():
        caps, tip = caps[~waits], tip[~waits]
        rank, beyond = _faces_beyond(parts.faces, caps, tip)
    claims = np.full(len(flat), len(caps))
    np.minimum.at(claims, caps, np.arange(len(caps)))
    np.minimum.at(claims, beyond, rank)
    removed = claims[caps] == np.arange(len(caps))
    removed[rank[claims[beyond] != rank]] = False
    kept = removed[rank]
    rank, beyond = rank[kept], beyond[kept]
    middle = parts.faces[caps, tip][rank]
    start, end = parts.faces[caps, tip - 2][rank], parts.faces[caps, tip - 1][rank]
    along, offset = vertices[end] - vertices[start], vertices[middle] - vertices[start]
    share = np.einsum("kd,kd->k", offset, along) / np.einsum("kd,kd->k", along, along)
    # A face beyond that has the tip as its corner has the same corners, and takes the place.
    apart = ~(parts.faces[beyond] == middle[:, None]).any(axis=1)
    divided = parts.divided(
        beyond[apart], start[apart], end[apart], middle[apart], share[apart].clip(0.0, 1.0)
    )
    left = np.ones(len(divided.faces), dtype=bool)
    left[caps[removed]] = False
    return divided.taken(left), np.stack([middle, start, end], axis=1)[apart]


def _opposite_longest_side(vertices: FloatArray, faces: IntArray) -> IntArray:
    """The corner opposite the longest side of each face, (f,)."""
    corners = vertices[faces]
    sides = corners[:, [2, 0, 1]] - corners[:, [1, 2, 0]]
    return np.einsum("fcd,fcd->fc", sides, sides).argmax(axis=1)


def _faces_beyond(faces: IntArray, chosen: IntArray, corner: IntArray) -> tuple[IntArray, IntArray]:
    """The other faces at the sides opposite given corners of some faces.

    Returns
    -------
    (p,) int array
        Position among the chosen faces.
    (p,) int array
        A face beyond its side.
    """
    at_ends = np.zeros(faces.max() + 1, dtype=bool)
    at_ends[faces[chosen]] = True
    near = np.flatnonzero(at_ends[faces].sum(axis=1) >= 2)
    size = len(at_ends)
    keys = side_keys(faces[near], size)
    own = side_keys(faces[chosen], size).reshape(-1, 3)[np.arange(len(chosen)), corner]
    rank, side = occurrences(keys, own)
    found = near[side // 3]
    others = found != chosen[rank]
    return rank[others], found[others]
