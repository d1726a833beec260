"""Faces without area: finds them, removes them, or moves their corners to give them an area.

They are removed so that the faces around them meet. Where two corners of such a face coincide, they
become one vertex. Where a corner lies on the opposite side, the face beyond that side is divided at
this corner. Both close the surface again, since the face that is removed has no width.
"""

from __future__ import annotations

import numpy as np

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.grouping import components, first_of_components
from ..geometry.mesh import edge_lengths, feet_on_edges, triangle_areas, unique_edges
from ..progress import checkpoint
from .face_parts import FaceParts

ROUNDS = 1_000
"""Greatest number of rounds. In each, faces that do not affect one another are removed, so faces
that lie over one another, such as a fan without area, need several."""

ATTEMPTS = 4
"""Maximum number of attempts to move vertices so that every face has an area."""

SEED = 0
"""Seed of the random moves, so that the same mesh always gets the same moves."""


def degenerate_faces(vertices: FloatArray, faces: IntArray, short: float) -> BoolArray:
    """Find faces without area, in which two corners coincide or one lies on the opposite edge.

    A needle has an area, however thin it is, since its shortest edge is transverse to its longest.

    Parameters
    ----------
    vertices : (v, 3) float array
        Positions of the vertices.
    faces : (f, 3) int array
        Corner indices of each triangle.
    short : float
        Length up to which the ends of an edge coincide, in the unit of the positions.

    Returns
    -------
    (f,) bool array
        Whether each face is degenerate.
    """
    lengths = [edge_lengths(vertices, faces[:, [k - 1, k]]) for k in range(3)]
    shortest, longest = np.minimum.reduce(lengths), np.maximum.reduce(lengths)
    twice_area = 2.0 * triangle_areas(vertices, faces)
    return (twice_area <= tolerances.DEGENERATE_SINE * shortest * longest) | (shortest <= short)


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
    place, divisions = np.arange(len(vertices)), np.zeros((0, 3), dtype=np.int64)
    flat = degenerate_faces(vertices, parts.faces, short)
    if not flat.any():
        return parts, place, divisions
    # Nothing changes but these faces and those that share a vertex with them.
    touched = np.zeros(len(vertices), dtype=bool)
    touched[parts.faces[flat]] = True
    near = touched[parts.faces].any(axis=1)
    others, parts = parts.taken(~near), parts.taken(near)
    for _ in range(ROUNDS):
        checkpoint()
        flat = degenerate_faces(vertices, parts.faces, short)
        if not flat.any():
            break
        sides = parts.faces[flat][:, [[1, 2], [2, 0], [0, 1]]].reshape(-1, 2)
        sides = sides[edge_lengths(vertices, sides) <= short]
        if len(sides):
            merged = first_of_components(len(vertices), *sides.T)
            place, divisions = merged[place], merged[divisions]
            parts = parts.with_faces(merged[parts.faces])
        else:
            parts, divided = _without_caps(vertices, parts, flat)
            divisions = np.concatenate([divisions, divided])
        parts = parts.distinct()
    return others.joined(parts), place, divisions


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
    corners = vertices[parts.faces[caps]]
    sides = corners[:, [2, 0, 1]] - corners[:, [1, 2, 0]]
    tip = np.einsum("fcd,fcd->fc", sides, sides).argmax(axis=1)  # opposite the longest side
    divisions = np.stack([parts.faces[caps, tip - k] for k in (0, 2, 1)], axis=1)
    rank, beyond = parts.at_edges(*divisions[:, 1:].T)
    other = beyond != caps[rank]
    rank, beyond = rank[other], beyond[other]
    waits = np.zeros(len(caps), dtype=bool)
    waits[rank[flat[beyond]]] = True
    removed = ~waits | waits.all()
    rank, beyond = rank[removed[rank]], beyond[removed[rank]]
    claims = np.full(len(flat), len(caps))
    np.minimum.at(claims, caps[removed], np.flatnonzero(removed))
    np.minimum.at(claims, beyond, rank)
    removed &= claims[caps] == np.arange(len(caps))
    removed[rank[claims[beyond] != rank]] = False
    rank, beyond = rank[removed[rank]], beyond[removed[rank]]
    # A face beyond that has the tip as its corner has the same corners, and takes the place.
    apart = ~(parts.faces[beyond] == divisions[rank, :1]).any(axis=1)
    beyond, divisions = beyond[apart], divisions[rank[apart]]
    middle, start, end = divisions.T
    share, _ = feet_on_edges(vertices, divisions[:, 1:], middle)
    divided = parts.divided(beyond, start, end, middle, share.clip(0.0, 1.0))
    left = np.ones(len(divided.faces), dtype=bool)
    left[caps[removed]] = False
    return divided.taken(left), divisions


def moved_apart(
    vertices: FloatArray, faces: IntArray, short: float, moving: BoolArray
) -> FloatArray:
    """Move some vertices towards the faces around them, by a thousandth of their shortest edge.

    So vertices at the same position come apart, wherever the mesh is and however it is numbered.
    For the arguments see `perturbed`.
    """
    if not moving.any():
        return vertices
    around = np.flatnonzero(moving[faces].any(axis=1))
    corners = faces[around]
    centres = vertices[corners].mean(axis=1)
    total, count = np.zeros_like(vertices), np.bincount(corners.ravel(), minlength=len(vertices))
    np.add.at(total, corners, centres[:, None])
    inward = total[moving] / np.maximum(count[moving], 1)[:, None] - vertices[moving]
    length = np.linalg.norm(inward, axis=1, keepdims=True)
    reach = tolerances.PERTURBATION * _shortest_edges(vertices, faces, short)[moving, None]
    result = vertices.copy()
    result[moving] += reach * inward / np.maximum(length, tolerances.TINY)
    return result


def perturbed(
    vertices: FloatArray,
    faces: IntArray,
    short: float,
    flat: BoolArray,
    moving: BoolArray | None = None,
) -> FloatArray:
    """Move vertices so that every face has an area if possible.

    Corners of degenerate faces are moved randomly, along each axis by at most a thousandth of their
    shortest edge of non-zero length.

    Parameters
    ----------
    vertices : (v, 3) float array
        Positions near the origin; far from it, rounding would remove small moves.
    faces : (f, 3) int array
        Corner indices of each triangle.
    short : float
        Length up to which the ends of an edge coincide, in the unit of the positions.
    flat : (f,) bool array
        Result of `degenerate_faces`.
    moving : (v,) bool array, optional
        Whether each vertex is moved in any case.

    Returns
    -------
    (v, 3) float array
        New positions.
    """
    start, still = vertices, flat
    reach = tolerances.PERTURBATION * _shortest_edges(vertices, faces, short)
    generator = np.random.default_rng(SEED)
    for _ in range(ATTEMPTS):
        moves = np.zeros(len(vertices), dtype=bool) if moving is None else moving.copy()
        moves[faces[still]] = True
        checkpoint()
        move = generator.uniform(-1.0, 1.0, start.shape) * reach[:, None]
        vertices = np.where(moves[:, None], start + move, vertices)
        still = degenerate_faces(vertices, faces, short)
        if not still.any():
            break
    return vertices


def _shortest_edges(vertices: FloatArray, faces: IntArray, short: float) -> FloatArray:
    """Length of the shortest edge longer than ``short`` at each vertex, shape (v,).

    Vertices joined by shorter edges count as one vertex. The length is 0 if no edge is longer.
    """
    edges, _ = unique_edges(faces)
    lengths = edge_lengths(vertices, edges)
    n_places, place = components(len(vertices), *edges[lengths <= short].T)
    shortest = np.full(n_places, np.inf)
    for end in edges[lengths > short].T:
        np.minimum.at(shortest, place[end], lengths[lengths > short])
    return np.where(np.isfinite(shortest), shortest, 0.0)[place]
