"""Generates one mesh for each kind of defect that is found in third-party meshes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from nicmm_core import shapes
from nicmm_core.geometry.array_types import FloatArray, IntArray
from nicmm_core.geometry.mesh import Mesh

SEED = 0


def defective_meshes() -> Iterator[tuple[str, Mesh]]:
    """Names and meshes; on most of them a curve exists through any of the vertices."""
    ball = shapes.sphere(3)
    vertices, faces = ball.vertices, ball.faces
    generator = np.random.default_rng(SEED)
    yield "sphere", ball
    yield "hole", Mesh(vertices, faces[(vertices[faces][:, :, 2] < 0.6).all(axis=1)])
    yield "many holes", Mesh(vertices, faces[generator.random(len(faces)) < 0.9])
    turned = generator.random((len(faces), 1)) < 0.3
    yield "faces turned over", Mesh(vertices, np.where(turned, faces[:, ::-1], faces))
    yield "duplicate faces", Mesh(vertices, np.concatenate([faces, faces[::7], faces[::11, ::-1]]))
    yield "Möbius strip", shapes.moebius_strip()
    yield "collapsed edges", Mesh(_collapsed(vertices, faces, 20), faces)
    yield "collapsed faces", Mesh(_collapsed_faces(vertices, faces, 20), faces)
    yield "caps", Mesh(*_with_caps(vertices, faces, faces[::9]))
    yield "fans without area", Mesh(*with_fans(vertices, faces, 12))
    yield "soup", Mesh(vertices[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3))
    yield "seam", _seam(ball)
    yield "touching boxes", _touching_boxes()
    yield "three sheets along an edge", _sheets(3)
    yield "four sheets along an edge", _sheets(4)
    yield "fins", Mesh(*_with_fins(vertices, faces, 15))
    yield "hour glass", _hour_glass(ball)
    yield "touching at vertices", _touching(ball)
    yield "components", _together(ball, Mesh(0.5 * vertices + 3.0, faces))
    yield "through itself", _together(ball, Mesh(vertices + [0.7, 0, 0], faces))
    yield "needles", Mesh(vertices * [1.0, 1.0, 1e-7], faces)
    yield "needles at vertices", Mesh(*_with_needles(vertices, faces, faces[::9]))
    for height in (1e-13, 1e-10, 1e-7, 1e-4):
        yield f"caps of height {height:g}", Mesh(*_slivers(vertices, faces, height))
    yield "millionths", Mesh(1e-6 * vertices, faces)
    yield "millions", Mesh(1e6 * vertices, faces)
    yield "far away", Mesh(vertices + 1e6, faces)
    caps, capped = _with_caps(vertices, faces, faces[::9])
    yield "caps far away", Mesh(caps + 1e5, capped)
    yield "loose vertices", Mesh(np.concatenate([[[1e9, 0, 0]], vertices]), faces + 1)


def _collapsed(vertices: FloatArray, faces: IntArray, count: int) -> FloatArray:
    """Vertices with some edges collapsed to length zero, by moving one end onto the other."""
    vertices = vertices.copy()
    for a, b, _ in faces[:: max(1, len(faces) // count)]:
        vertices[a] = vertices[b]
    return vertices


def _collapsed_faces(vertices: FloatArray, faces: IntArray, count: int) -> FloatArray:
    """Vertices with the three corners of some faces moved to the same place."""
    vertices = vertices.copy()
    for face in faces[:: max(1, len(faces) // count)]:
        vertices[face] = vertices[face].mean(axis=0)
    return vertices


def _with_caps(
    vertices: FloatArray, faces: IntArray, chosen: IntArray
) -> tuple[FloatArray, IntArray]:
    """Mesh with vertices at edge midpoints that split one side; a cap closes the other side."""
    new_vertices, new_faces = [vertices], [faces]
    for number, (a, b, c) in enumerate(chosen):
        middle = len(vertices) + number
        new_vertices.append(0.5 * (vertices[[a]] + vertices[[b]]))
        same = (new_faces[0] == [a, b, c]).all(axis=1)
        new_faces[0] = new_faces[0][~same]
        new_faces.append(np.array([[a, middle, c], [middle, b, c], [a, b, middle]]))
    return np.concatenate(new_vertices), np.concatenate(new_faces)


def _with_needles(
    vertices: FloatArray, faces: IntArray, chosen: IntArray
) -> tuple[FloatArray, IntArray]:
    """Mesh with a vertex inserted into some faces, so close to a corner that two needles arise."""
    middles = vertices[chosen].mean(axis=1)
    added = (1.0 - 1e-8) * vertices[chosen[:, 0]] + 1e-8 * middles
    number = len(vertices) + np.arange(len(chosen))
    corners = [chosen, np.roll(chosen, -1, axis=1), np.roll(chosen, -2, axis=1)]
    around = [np.column_stack([each[:, :2], number]) for each in corners]
    same = (faces[:, None] == chosen[None]).all(axis=2).any(axis=1)
    return np.concatenate([vertices, added]), np.concatenate([faces[~same], *around])


def with_fans(vertices: FloatArray, faces: IntArray, size: int) -> tuple[FloatArray, IntArray]:
    """Mesh with an edge subdivided on one side only; a fan of faces without area closes the gap."""
    a, b, c = faces[0]
    along = np.linspace(0.0, 1.0, size + 2)[1:-1, None]
    inner = len(vertices) + np.arange(size)
    chain = np.concatenate([[a], inner, [b]])
    beside = np.stack([chain[:-1], chain[1:], np.full(size + 1, c)], axis=1)
    fan = np.stack([np.full(size, b), chain[1:-1], chain[:-2]], axis=1)
    added = (1.0 - along) * vertices[a] + along * vertices[b]
    return np.concatenate([vertices, added]), np.concatenate([faces[1:], beside, fan])


def _seam(ball: Mesh) -> Mesh:
    """Two halves with duplicate vertices along the equator, as at a texture seam."""
    upper = ball.vertices[ball.faces].mean(axis=1)[:, 2] > 0.0
    faces = ball.faces.copy()
    faces[upper] += len(ball.vertices)
    return Mesh(np.concatenate([ball.vertices, ball.vertices]), faces)


def _touching_boxes(size: int = 4) -> Mesh:
    """Two closed boxes side by side, with coinciding vertices where they touch."""
    box = _box(size)
    return _together(box, Mesh(box.vertices + [1.0, 0.0, 0.0], box.faces))


def _box(size: int) -> Mesh:
    """A unit cube whose sides are grids."""
    step = np.arange(size + 1)
    a, b = (each.ravel() for each in np.meshgrid(step, step, indexing="ij"))
    grids = []
    for axis in range(3):
        for level in (0, size):
            points = np.zeros((len(a), 3), dtype=np.int64)
            points[:, axis], points[:, (axis + 1) % 3], points[:, (axis + 2) % 3] = level, a, b
            grids.append(points)
    corner = (step[:-1, None] * (size + 1) + step[:-1]).ravel()
    one = np.stack([corner, corner + size + 1, corner + 1], axis=1)
    other = np.stack([corner + 1, corner + size + 1, corner + size + 2], axis=1)
    side = np.concatenate([one, other])
    faces = np.concatenate([side + number * len(a) for number in range(6)])
    places, number = np.unique(np.concatenate(grids), axis=0, return_inverse=True)
    return Mesh(places / size, number.reshape(-1)[faces])


def _sheets(count: int, size: int = 8) -> Mesh:
    """Half-planes that meet along the z axis."""
    step = np.linspace(0.0, 1.0, size + 1)
    axis = np.stack([0 * step, 0 * step, step], axis=1)
    vertices, faces, first = [axis], [], size + 1
    for angle in np.arange(count) * 2 * np.pi / count:
        outward = np.array([np.cos(angle), np.sin(angle), 0.0])
        columns = [axis + s * outward for s in step[1:]]
        numbers = np.arange(size + 1) + np.arange(-1, size)[:, None] * (size + 1)
        index = np.concatenate([np.arange(size + 1)[None], first + numbers[1:]])
        a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
        faces += [np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)]
        vertices += columns
        first += size * (size + 1)
    return Mesh(np.concatenate(vertices), np.concatenate([f.reshape(-1, 3) for f in faces]))


def _with_fins(vertices: FloatArray, faces: IntArray, count: int) -> tuple[FloatArray, IntArray]:
    """Mesh with extra faces that stand on its edges."""
    edges = faces[:: len(faces) // count, :2]
    tips = 1.2 * vertices[edges].mean(axis=1)
    fins = np.column_stack([edges, len(vertices) + np.arange(len(tips))])
    return np.concatenate([vertices, tips]), np.concatenate([faces, fins])


def _hour_glass(ball: Mesh) -> Mesh:
    """Two surfaces that meet only at one vertex."""
    bottom = int(ball.vertices[:, 2].argmin())
    other = ball.faces + len(ball.vertices)
    other = np.where(other == bottom + len(ball.vertices), bottom, other)
    mirrored = ball.vertices * [1, 1, -1] + 2.0 * ball.vertices[bottom]
    return Mesh(np.concatenate([ball.vertices, mirrored]), np.concatenate([ball.faces, other]))


def _touching(ball: Mesh) -> Mesh:
    """A surface that touches itself at a few vertices."""
    faces = ball.faces.copy()
    upper = np.flatnonzero(ball.vertices[:, 2] > 0.5)[:3]
    lower = np.flatnonzero(ball.vertices[:, 2] < -0.5)[:3]
    for a, b in zip(upper, lower, strict=True):
        faces[faces == b] = a
    return Mesh(ball.vertices, faces)


def _slivers(vertices: FloatArray, faces: IntArray, height: float) -> tuple[FloatArray, IntArray]:
    """Mesh with caps of a very small but nonzero area."""
    n_vertices = len(vertices)
    vertices, faces = _with_caps(vertices, faces, faces[::9])
    vertices = vertices.copy()
    vertices[n_vertices:] *= 1.0 + height
    return vertices, faces


def _together(*meshes: Mesh) -> Mesh:
    offsets = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + o for mesh, o in zip(meshes, offsets, strict=True)]),
    )
