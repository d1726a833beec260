"""Makes manifolds, on which curves are computed, from clean surfaces.

- At an edge of more than two faces, the faces are joined in pairs, and a face that is left over is
  detached. Parts of the surface that have only a vertex in common are separated. The vertices
  there are duplicated.
- If that separates control points, such an edge is divided into pieces, on which different pairs of
  its faces are joined, so that all of its faces are connected.
- Faces are turned over so that every orientable part is consistently oriented.
- Vertices at the same position, such as copies of a vertex, are moved apart, each towards the faces
  around it, by a thousandth of its shortest edge of non-zero length. Vertices of faces without area
  that remain are moved in random directions by about as much, so that every face has an area.
"""

from __future__ import annotations

import numpy as np

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.grouping import components, distinct_rows, grouped
from ..geometry.mesh import Mesh, joined_corners, side_corners, side_keys
from ..geometry.orientation import turned_faces
from ..progress import checkpoint
from .clean_surface import CleanSurface
from .degenerate_faces import degenerate_faces, moved_apart, perturbed
from .edge_subdivision import subdivided
from .face_parts import FaceParts
from .mapped_mesh import MappedMesh
from .straight_edges import straightened

SEGMENTS = 2
"""Number of segments of each piece of an edge. Each copy of the point between them belongs to only
one pair of faces, so no two edges of the result have the same ends."""

WEIGHTS_OF_COORDINATES = (1.0, 0.7320508, 0.4142136)
"""Weights with which the sums of the coordinates of hardly any two positions are equal."""

MOST_COMPARED = 32
"""Number of faces at an edge up to which all pairs of them are compared."""


def manifold(clean: CleanSurface, usable: IntArray, connected: bool) -> MappedMesh | None:
    """Make a manifold from a clean surface.

    Parameters
    ----------
    clean : CleanSurface
    usable : (u,) int array
        Faces of the given mesh that may be used, ascending.
    connected : bool
        Whether all faces at an edge of more than two faces are connected. Otherwise the straightest
        pairs are joined there.

    Returns
    -------
    MappedMesh or None
        The manifold with its map; None if all faces are connected even without `connected`, or if
        no face remains.
    """
    mesh, parts = clean.mesh, clean.parts
    vertices, place = mesh.vertices, np.arange(len(mesh.vertices))
    several: list[IntArray] = []
    if len(usable) < len(clean.original.faces):
        parts = parts.taken(np.isin(parts.parent, usable))
    if not len(parts.faces):
        return None
    if len(parts.faces) < len(mesh.faces) or not is_manifold(mesh):
        pairs, several = sides_by_edge(parts.faces)
        if several:
            parts, vertices, pairs = _with_pieces(parts, vertices, several, connected)
        faces, place = cut(parts.faces, pairs, len(vertices))
        vertices, parts = vertices[place], parts.with_faces(faces)
    if connected and not several:
        return None
    short = tolerances.SAME_POSITION * clean.original.diagonal
    flat = degenerate_faces(vertices, parts.faces, short)
    shared = at_shared_positions(vertices, parts.faces)
    origin, moved = np.zeros(3), bool(flat.any() or shared.any())
    if moved:
        # Far from the origin, rounding would remove small moves. Vertices at the same position are
        # moved, too: a straight trace from one of them would pass exactly through another.
        origin = vertices[parts.faces[0, 0]]
        vertices = moved_apart(vertices - origin, parts.faces, short, shared)
        still = at_shared_positions(vertices, parts.faces)
        vertices = perturbed(vertices, parts.faces, short, flat, still)
    if moved or not np.array_equal(parts.faces, mesh.faces):
        mesh = Mesh(vertices, parts.faces)
    turned = turned_faces(mesh)
    if turned.any():
        parts = parts.turned(turned)
        mesh = Mesh(vertices, parts.faces)
    repairs = clean.repairs | {
        "faces turned": int(turned.sum()),
        "non-manifold edges separated": len(several),
    }
    repairs = {name: count for name, count in repairs.items() if count}
    straight, in_straight = straightened(mesh, clean.divisions)
    return MappedMesh(
        clean=clean,
        manifold=mesh,
        in_given=parts,
        mesh=straight,
        in_mesh=in_straight,
        place=place,
        origin=origin,
        moved=moved,
        repairs=repairs,
    )


def at_shared_positions(vertices: FloatArray, faces: IntArray) -> BoolArray:
    """Whether each vertex of the faces is at the position of another one of them, (V,)."""
    used = np.zeros(len(vertices), dtype=bool)
    used[faces] = True
    used = np.flatnonzero(used)
    # Numbers sort faster than rows. Equal positions have equal sums; those of a matrix product
    # might be rounded otherwise in its last rows.
    sums = sum(weight * vertices[used, axis] for axis, weight in enumerate(WEIGHTS_OF_COORDINATES))
    order = np.argsort(sums, kind="stable")
    same = sums[order[1:]] == sums[order[:-1]]
    alike = used[order[np.append(same, False) | np.append(False, same)]]
    shared = np.zeros(len(vertices), dtype=bool)
    if len(alike):
        _, group = distinct_rows(vertices[alike])
        shared[alike] = np.bincount(group)[group] > 1
    return shared


def is_manifold(mesh: Mesh) -> bool:
    """Whether a mesh is an oriented manifold, so that its faces need no pairing.

    At every edge there are at most two faces, which are consistently oriented, and the faces at
    each vertex form one fan.
    """
    if not mesh.is_oriented or mesh.has_nonmanifold_edges:
        return False
    # The next corner around the vertex of each corner is across the side after it.
    corner, across = np.arange(mesh.faces.size), mesh.opposite_sides
    after = corner - corner % 3 + (corner + 1) % 3
    following = np.where(across[after] == after, corner, after[across[after]])
    n_fans, _ = components(len(corner), corner, following)
    return n_fans == np.count_nonzero(mesh.referenced)


def sides_by_edge(faces: IntArray) -> tuple[IntArray, list[IntArray]]:
    """The two sides of each edge of two faces, (p, 2), and all sides of each edge of more faces.

    Side 3 f + j is opposite corner j of face f.
    """
    order, first, count = grouped(side_keys(faces))
    two = first[count == 2]
    several = np.stack([first, first + count], axis=1)[count > 2]
    pairs = np.stack([order[two], order[two + 1]], axis=1)
    return pairs, [order[begin:end] for begin, end in several]


def cut(faces: IntArray, pairs: IntArray, n_vertices: int) -> tuple[IntArray, IntArray]:
    """Duplicate vertices so that faces share them only where pairs of sides join the faces.

    Returns
    -------
    (f, 3) int array
        New corner indices of each triangle.
    (v,) int array
        Original vertex of each vertex.
    """
    checkpoint()
    one, other = side_corners(faces)[pairs.T]
    group, source = joined_corners(faces, one.ravel(), other.ravel())
    # One of the copies keeps the index of the vertex.
    order, begin, _ = grouped(source)
    new = np.delete(np.arange(len(source)), order[begin])
    number = source.copy()
    number[new] = n_vertices + np.arange(len(new))
    return number[group], np.concatenate([np.arange(n_vertices), source[new]])


def _with_pieces(
    parts: FaceParts, vertices: FloatArray, several: list[IntArray], connected: bool
) -> tuple[FaceParts, FloatArray, IntArray]:
    """Divide edges of more than two faces into pieces, on which different sides are joined.

    Returns
    -------
    FaceParts
        The triangles, those at such edges divided.
    (v, 3) float array
        Positions of their vertices.
    (p, 2) int array
        The pairs of sides that are joined.
    """
    joins = [_joins(parts.faces, at_edge, vertices, connected) for at_edge in several]
    edge = np.full(parts.faces.size, -1)
    for number, at_edge in enumerate(several):
        edge[at_edge] = number
    segments = np.array([SEGMENTS * len(pieces) for pieces in joins])
    divided, child = subdivided(parts.faces, edge, segments, len(vertices))
    positions = np.empty((int(divided.faces.max()) + 1, 3))
    positions[: len(vertices)] = vertices
    at_corners = vertices[parts.faces[divided.parent]]
    positions[divided.faces] = np.einsum("fcd,fdk->fck", divided.corners, at_corners)
    pairs = [sides_by_edge(divided.faces)[0]]
    for at_edge, pieces in zip(several, joins, strict=True):
        checkpoint()
        for piece, joined in enumerate(pieces):
            for segment in range(SEGMENTS * piece, SEGMENTS * (piece + 1)):
                pairs.append(3 * (child[at_edge[joined]] + segment) + 2)
    corners = divided.corners @ parts.corners[divided.parent]
    result = FaceParts(divided.faces, parts.parent[divided.parent], corners)
    return result, positions, np.concatenate(pairs)


def _joins(
    faces: IntArray, at_edge: IntArray, vertices: FloatArray, connected: bool
) -> list[IntArray]:
    """For each piece of an edge, the pairs of its sides that are joined there, (p, 2).

    Sides are given by their positions in `at_edge`. On the first piece, the straightest pairs are
    joined. If all sides are to be connected, further pieces join these pairs with one another, like
    the corners of a hypercube, along a different axis on each piece. So q faces need about log₂ q
    pieces.
    """
    checkpoint()
    straight = _straightest(faces, at_edge, vertices)
    pieces = [straight]
    if not connected:
        return pieces
    single = np.setdiff1d(np.arange(len(at_edge)), straight)
    groups = [*straight.tolist(), *([place] for place in single.tolist())]
    for bit in range((len(groups) - 1).bit_length()):
        pairs = []
        for here, group in enumerate(groups):
            there = here ^ (1 << bit)
            if there >= len(groups):
                pairs += [group] if len(group) == 2 else []
            elif here < there:
                pairs += [list(pair) for pair in zip(group, groups[there], strict=False)]
        pieces.append(np.array(pairs))
    return pieces


def _straightest(faces: IntArray, sides: IntArray, vertices: FloatArray) -> IntArray:
    """Pairs of positions in `sides`, which belong to one edge, the straightest pair first.

    At most one side is left over.
    """
    tip = vertices[faces.ravel()[sides]]
    low, high = np.sort(np.delete(faces[sides[0] // 3], sides[0] % 3))
    edge, outward = vertices[high] - vertices[low], tip - vertices[low]
    squared = max(float((edge * edge).sum()), tolerances.TINY)
    outward -= (outward * edge).sum(axis=1, keepdims=True) / squared * edge
    length = np.linalg.norm(outward, axis=1, keepdims=True)
    outward /= np.maximum(length, tolerances.TINY)
    if len(sides) > MOST_COMPARED:  # about opposite directions, by the order of their angles
        axes = np.linalg.svd(outward, full_matrices=False)[2][:2]
        order = np.argsort(np.arctan2(outward @ axes[1], outward @ axes[0]), kind="stable")
        half = len(order) // 2
        return np.stack([order[:half], order[half : 2 * half]], axis=1)
    straight = outward @ outward.T
    np.fill_diagonal(straight, np.inf)
    pairs = []
    for _ in range(len(sides) // 2):
        pair = np.array(np.unravel_index(straight.argmin(), straight.shape))
        pairs.append(pair)
        straight[pair] = straight[:, pair] = np.inf
    return np.array(pairs)
