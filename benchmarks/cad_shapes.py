"""Generates CAD-like bodies: flat and curved sides, sharp edges, and a fine triangulation.

CAD exports themselves are too coarse here. A map has its weights at vertices, so it can distinguish
an edge from the adjacent sides only where the sides have interior vertices.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.spatial import Delaunay

from nicmm_core import shapes
from nicmm_core.geometry.array_types import FloatArray
from nicmm_core.geometry.mesh import Mesh

PIECES = 36
"""Approximate number of edges along the longest side of a body."""


def cad_shapes(generator: np.random.Generator, count: int) -> Iterator[tuple[str, Mesh]]:
    """Named bodies with random proportions, cycling through the kinds."""
    makers = (_box, _bracket, _shaft, _wedge)
    for number in range(count):
        maker = makers[number % len(makers)]
        yield f"{maker.__name__[1:]} {number // len(makers)}", maker(generator)


def _box(generator: np.random.Generator) -> Mesh:
    cube = shapes.cube(PIECES * 2 // 3)
    return Mesh(cube.vertices * generator.uniform(0.5, 1.0, 3), cube.faces)


def _bracket(generator: np.random.Generator) -> Mesh:
    """An L-shaped bracket of two plates."""
    a, b = generator.uniform(0.25, 0.5, 2)
    outline = np.array([[0, 0], [1, 0], [1, a], [b, a], [b, 1], [0, 1]])
    return extruded(outline, float(generator.uniform(0.4, 0.9)))


def _wedge(generator: np.random.Generator) -> Mesh:
    """A plate with a sloping side and a rounded end."""
    angle = np.linspace(-0.5, 0.5, 13) * np.pi
    arc = np.stack([1.0 + 0.3 * np.cos(angle), 0.3 + 0.3 * np.sin(angle)], axis=1)
    top = generator.uniform(0.6, 0.9)
    outline = np.concatenate([[[0.0, 0.0]], arc, [[0.5, top], [0.0, top]]])
    return extruded(outline, float(generator.uniform(0.4, 0.9)))


def _shaft(generator: np.random.Generator) -> Mesh:
    """A stepped shaft: stacked cylinders with different radii."""
    radii = np.repeat(generator.uniform(0.2, 0.5, 3), 2)
    heights = np.repeat(np.cumsum(generator.uniform(0.3, 0.5, 4)), 2)[1:-1] - 0.5
    profile = np.concatenate(
        [[[0.0, heights[0]]], np.stack([radii, heights], axis=1), [[0.0, heights[-1]]]]
    )
    return revolved(profile)


def extruded(outline: FloatArray, height: float) -> Mesh:
    """Prism over an anticlockwise polygon (n, 2)."""
    step = float(np.ptp(outline, axis=0).max()) / PIECES
    rim = _divided(np.concatenate([outline, outline[:1]]), step)[:-1]
    grid = np.arange(-PIECES, 2 * PIECES) * step
    inner = np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2)
    # Every other row is shifted, so that the Delaunay triangles are nearly equilateral.
    inner[:, 0] += np.where(np.round(inner[:, 1] / step) % 2, 0.5 * step, 0.0)
    apart = np.linalg.norm(inner[:, None] - rim, axis=2).min(axis=1) > 0.7 * step
    flat = np.concatenate([rim, inner[apart & _inside(inner, outline)]])
    cap = Delaunay(flat).simplices.astype(np.int64)
    cap = cap[_inside(flat[cap].mean(axis=1), outline)]
    a, b, c = flat[cap].transpose(1, 0, 2)
    turned = np.cross(b - a, c - a) < 0.0
    cap[turned] = cap[turned][:, ::-1]
    levels = np.linspace(0.0, height, max(2, round(height / step)) + 1)
    count = len(rim)
    points = [np.pad(rim, ((0, 0), (0, 1)), constant_values=level) for level in levels]
    here = np.arange(count)
    onward = np.roll(here, -1)
    faces = []
    for row in range(len(levels) - 1):
        a, b, c, d = (row * count + k for k in (here, onward, onward + count, here + count))
        faces += [np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]
    size = count * len(levels)
    interior = flat[count:]
    for level, first, reverse in ((0.0, 0, True), (height, size - count, False)):
        number = np.concatenate([first + here, size + np.arange(len(interior))])
        size += len(interior)
        points.append(np.pad(interior, ((0, 0), (0, 1)), constant_values=level))
        faces.append(number[cap[:, ::-1] if reverse else cap])
    return Mesh(np.concatenate(points), np.concatenate(faces))


def revolved(profile: FloatArray) -> Mesh:
    """Body of revolution about z; the profile (n, 2) of radii and heights ends on the axis."""
    step = float(np.ptp(profile, axis=0).max()) / PIECES
    path = _divided(profile, step)[1:-1]
    around = 2 * PIECES
    angle = np.arange(around) * 2 * np.pi / around
    rings = np.stack(
        [
            path[:, :1] * np.cos(angle),
            path[:, :1] * np.sin(angle),
            np.repeat(path[:, 1:], around, axis=1),
        ],
        axis=-1,
    ).reshape(-1, 3)
    poles = np.array([[0.0, 0.0, profile[0, 1]], [0.0, 0.0, profile[-1, 1]]])
    here = np.arange(around)
    onward = np.roll(here, -1)
    faces = []
    for row in range(len(path) - 1):
        a, b, c, d = (row * around + k for k in (here, onward, onward + around, here + around))
        faces += [np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]
    low = np.full(around, len(rings))
    last = (len(path) - 1) * around
    faces.append(np.stack([onward, here, low], axis=1))
    faces.append(np.stack([last + here, last + onward, low + 1], axis=1))
    return Mesh(np.concatenate([rings, poles]), np.concatenate(faces))


def _divided(polygon: FloatArray, step: float) -> FloatArray:
    """Polyline (m, 2) whose segments are divided into pieces of about the length ``step``."""
    parts = [polygon[:1]]
    for start, end in zip(polygon[:-1], polygon[1:], strict=True):
        pieces = max(1, round(float(np.linalg.norm(end - start)) / step))
        share = np.arange(1, pieces + 1)[:, None] / pieces
        parts.append(start + share * (end - start))
    return np.concatenate(parts)


def _inside(points: FloatArray, outline: FloatArray) -> FloatArray:
    """Whether each point lies in a polygon, by counting ray crossings, shape (p,)."""
    x, y = points.T[:, :, None]
    (ax, ay), (bx, by) = outline.T, np.roll(outline, -1, axis=0).T
    across = (ay > y) != (by > y)
    at = ax + (y - ay) * (bx - ax) / np.where(by == ay, 1.0, by - ay)
    return (across & (x < at)).sum(axis=1) % 2 == 1
