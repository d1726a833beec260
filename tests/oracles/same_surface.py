"""Changes a mesh in ways that keep its surface: defects of exports, other triangulations, places.

Every change keeps all vertices at their positions, up to a similarity and to gaps of less than a
millionth of the diagonal, and says where each of them has gone. So the same control points can be
asked for on both meshes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from nicmm_core.geometry.array_types import FloatArray, IntArray
from nicmm_core.geometry.mesh import Mesh, adjacent_sides

SHARE = 0.1
"""Share of the edges, or faces, that a change concerns if it does not concern all."""

PATCHES = 3
"""Number of patches that have vertices of their own, on meshes with gaps."""

GAP = 2.5e-7
"""Greatest move of a vertex beside a gap along each axis, in diagonals."""

FAR = 1e3
"""Distance from the origin of a mesh far away, in diagonals."""

FLATTEST = np.cos(np.radians(20.0))
"""Least cosine between the normals of two triangles that count as a quadrilateral."""

LEAST_SINE = 0.2
"""Least sine of the angles of triangles that another diagonal of a quadrilateral creates."""


@dataclass(frozen=True)
class Changed:
    """A mesh with the surface of another one.

    Attributes
    ----------
    vertices, faces : (V', 3) float array, (F', 3) int array
        The changed mesh.
    number : (V,) int array
        Vertex of the changed mesh at the place of each vertex of the other one.
    factor : float
        Length in the changed mesh of a unit of length in the other one.
    shift : (3,) float array
        Position of the other one's origin.
    """

    vertices: FloatArray
    faces: IntArray
    number: IntArray
    factor: float
    shift: FloatArray

    @property
    def mesh(self) -> Mesh:
        """The changed mesh, checked."""
        return Mesh(self.vertices, self.faces)

    def undone(self, positions: FloatArray) -> FloatArray:
        """Map positions, (n, 3), to the space of the other mesh."""
        return (positions - self.shift) / self.factor


Change = Callable[[Changed, np.random.Generator], Changed]


def unchanged(mesh: Mesh) -> Changed:
    """The mesh itself."""
    number = np.arange(len(mesh.vertices))
    return Changed(mesh.vertices.copy(), mesh.faces.copy(), number, 1.0, np.zeros(3))


def half_turned(one: Changed, generator: np.random.Generator) -> Changed:
    """Half of the faces turned over, at random."""
    return _turned(one, generator.random(len(one.faces)) < 0.5)


def patch_turned(one: Changed, generator: np.random.Generator) -> Changed:
    """The faces on one side of a random plane turned over."""
    return _turned(one, _beside_plane(one, generator) < 0.35)


def all_turned(one: Changed, _: np.random.Generator) -> Changed:
    """Every face turned over."""
    return _turned(one, np.ones(len(one.faces), dtype=bool))


def soup(one: Changed, generator: np.random.Generator) -> Changed:
    """Every face with vertices of its own, as in a file in the format STL."""
    faces = np.arange(one.faces.size).reshape(-1, 3)
    source = one.faces.ravel()
    number = np.full(len(one.vertices), -1)
    order = generator.permutation(len(source))
    number[source[order]] = order
    return _with(one, one.vertices[source], faces, number[one.number])


def doubled(one: Changed, generator: np.random.Generator) -> Changed:
    """Some faces twice, in either orientation."""
    again = one.faces[generator.random(len(one.faces)) < SHARE]
    back = generator.random(len(again)) < 0.5
    again = np.where(back[:, None], again[:, ::-1], again)
    return _with(one, one.vertices, np.concatenate([one.faces, again]), one.number)


def with_loose_vertices(one: Changed, generator: np.random.Generator) -> Changed:
    """Vertices that belong to no face, anywhere near the mesh, numbered before all others."""
    low, high = one.vertices.min(axis=0), one.vertices.max(axis=0)
    loose = generator.uniform(2.0 * low - high, 2.0 * high - low, (20, 3))
    vertices = np.concatenate([loose, one.vertices])
    return _with(one, vertices, one.faces + len(loose), one.number + len(loose))


def far_away(one: Changed, generator: np.random.Generator) -> Changed:
    """Moved far from the origin."""
    direction = generator.standard_normal(3)
    move = FAR * _diagonal(one) * direction / np.linalg.norm(direction)
    return Changed(one.vertices + move, one.faces, one.number, one.factor, one.shift + move)


def a_million_times_as_large(one: Changed, _: np.random.Generator) -> Changed:
    """Scaled by 1e6."""
    return _scaled(one, 1e6)


def a_millionth_as_large(one: Changed, _: np.random.Generator) -> Changed:
    """Scaled by 1e-6."""
    return _scaled(one, 1e-6)


def with_flat_faces(one: Changed, generator: np.random.Generator) -> Changed:
    """Some edges divided on one side only; a face without area joins both sides."""
    return _divided(one, generator, closed_by_faces=True)


def with_t_junctions(one: Changed, generator: np.random.Generator) -> Changed:
    """Some edges divided on one side only, and not joined to the other side."""
    return _divided(one, generator, closed_by_faces=False)


def with_gaps(one: Changed, generator: np.random.Generator) -> Changed:
    """Patches with vertices of their own, between which there are tiny gaps."""
    patch = (PATCHES * _beside_plane(one, generator)).astype(np.int64).clip(max=PATCHES - 1)
    size = len(one.vertices)
    keys = one.faces + size * patch[:, None]
    used, faces = np.unique(keys, return_inverse=True)
    source = used % size
    shared = np.bincount(source, minlength=size)[source] > 1
    move = GAP * _diagonal(one) * generator.uniform(-1.0, 1.0, (len(used), 3))
    number = np.full(size, -1)
    number[source] = np.arange(len(used))
    vertices = one.vertices[source] + np.where(shared[:, None], move, 0.0)
    return _with(one, vertices, faces.reshape(-1, 3), number[one.number])


def other_diagonals(one: Changed, generator: np.random.Generator) -> Changed:
    """Pairs of triangles that form nearly flat quadrilaterals, divided along the other diagonal."""
    side, other = adjacent_sides(one.faces)
    pairs = generator.permutation(len(side))
    faces, used = one.faces.copy(), np.zeros(len(one.faces), dtype=bool)
    for s, t in zip(side[pairs].tolist(), other[pairs].tolist(), strict=True):
        if used[s // 3] or used[t // 3]:
            continue
        tip, start, end = (int(one.faces[s // 3, (s + k) % 3]) for k in range(3))
        far = int(one.faces[t // 3, t % 3])
        if int(one.faces[t // 3, (t % 3 + 1) % 3]) != end:
            continue  # the two faces have different orientations
        new = np.array([[tip, start, far], [far, end, tip]])
        if _is_flat(one.vertices, np.array([[tip, start, end], [far, end, start]]), new):
            faces[[s // 3, t // 3]] = new
            used[[s // 3, t // 3]] = True
    return _with(one, one.vertices, faces, one.number)


SAME_CURVE: dict[str, Change] = {
    "half of the faces turned": half_turned,
    "one patch turned": patch_turned,
    "all faces turned": all_turned,
    "soup": soup,
    "doubled faces": doubled,
    "loose vertices": with_loose_vertices,
    "far away": far_away,
    "a million times as large": a_million_times_as_large,
    "a millionth as large": a_millionth_as_large,
}
"""Changes that keep the curve."""

SIMILAR_CURVE: dict[str, Change] = {
    "faces without area": with_flat_faces,
    "T-junctions": with_t_junctions,
    "gaps": with_gaps,
    "other diagonals": other_diagonals,
}
"""Changes of the triangulation, which keep the curve nearly."""

CHAINS: dict[str, tuple[str, ...]] = {
    "turned, doubled soup": ("doubled faces", "half of the faces turned", "soup"),
    "loose vertices, patch turned, far away": (
        "loose vertices",
        "one patch turned",
        "far away",
    ),
    "turned soup with faces without area": (
        "faces without area",
        "half of the faces turned",
        "soup",
    ),
    "gaps, patch turned, a millionth as large": (
        "gaps",
        "one patch turned",
        "a millionth as large",
    ),
}
"""Several changes, one after another."""

CHANGES: dict[str, Change] = SAME_CURVE | SIMILAR_CURVE


def changed(mesh: Mesh, name: str, seed: int) -> Changed:
    """Apply a change, or a chain of changes, by name."""
    result = unchanged(mesh)
    for number, step in enumerate(CHAINS.get(name, (name,))):
        result = CHANGES[step](result, np.random.default_rng([seed, number]))
    return result


def keeps_curve(name: str) -> bool:
    """Whether a change, or every change of a chain, keeps the curve."""
    return all(step in SAME_CURVE for step in CHAINS.get(name, (name,)))


def _with(one: Changed, vertices: FloatArray, faces: IntArray, number: IntArray) -> Changed:
    return Changed(vertices, faces, number, one.factor, one.shift)


def _turned(one: Changed, turned: np.ndarray) -> Changed:
    faces = np.where(turned[:, None], one.faces[:, ::-1], one.faces)
    return _with(one, one.vertices, faces, one.number)


def _scaled(one: Changed, factor: float) -> Changed:
    return Changed(
        factor * one.vertices, one.faces, one.number, factor * one.factor, factor * one.shift
    )


def _diagonal(one: Changed) -> float:
    return float(np.linalg.norm(np.ptp(one.vertices[one.faces].reshape(-1, 3), axis=0)))


def _beside_plane(one: Changed, generator: np.random.Generator) -> FloatArray:
    """Position of each face along a random direction, from 0 to 1, (F,)."""
    along = one.vertices[one.faces].mean(axis=1) @ generator.standard_normal(3)
    return (along - along.min()) / np.ptp(along)


def _divided(one: Changed, generator: np.random.Generator, closed_by_faces: bool) -> Changed:
    """Some edges divided at a point on one side, with at most one such edge per face."""
    side, other = adjacent_sides(one.faces)
    chosen = generator.permutation(len(side))[: int(SHARE * len(side))]
    used = np.zeros(len(one.faces), dtype=bool)
    vertices, faces, added = [one.vertices], one.faces.copy(), []
    size = len(one.vertices)
    for s, t in zip(side[chosen].tolist(), other[chosen].tolist(), strict=True):
        if used[s // 3] or used[t // 3]:
            continue
        used[[s // 3, t // 3]] = True
        tip, start, end = (int(one.faces[s // 3, (s + k) % 3]) for k in range(3))
        share = generator.uniform(0.3, 0.7)
        vertices.append((1.0 - share) * one.vertices[[start]] + share * one.vertices[[end]])
        faces[s // 3] = tip, start, size
        added.append((tip, size, end))
        if closed_by_faces:
            added.append((start, end, size))
        size += 1
    return _with(
        one,
        np.concatenate(vertices),
        np.concatenate([faces, np.array(added, dtype=np.int64).reshape(-1, 3)]),
        one.number,
    )


def _is_flat(vertices: FloatArray, old: IntArray, new: IntArray) -> bool:
    """Whether two old triangles form a flat, convex quadrilateral with the diagonal of the new."""
    corners = vertices[np.concatenate([old, new])]
    vectors = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(vectors, axis=1)
    if not (length > 0.0).all():
        return False
    normals = vectors / length[:, None]
    if (normals @ normals[0]).min() < FLATTEST:
        return False
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    return bool((length[2:] >= LEAST_SINE * sides[2:].max(axis=1) ** 2 * 0.5).all())
