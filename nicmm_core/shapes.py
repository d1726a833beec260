"""Generates meshes for pretraining, tests and examples, so that no mesh files are needed.

`creature` makes random bodies with limbs, as coarse as the meshes in collections of scans, so that
the training data contain thin parts, saddles and tips.
"""

from __future__ import annotations

import igl
import numpy as np
from scipy.spatial import ConvexHull, Delaunay

from .geometry.array_types import FloatArray, IntArray
from .geometry.mesh import Mesh


def sphere(subdivisions: int = 4) -> Mesh:
    """Unit sphere from a subdivided icosahedron; each subdivision multiplies the faces by four."""
    golden = 0.5 * (1.0 + 5.0**0.5)
    corners = [(0, 1, golden), (0, -1, golden), (0, 1, -golden), (0, -1, -golden)]
    vertices = np.array([np.roll(corner, shift) for shift in range(3) for corner in corners])
    faces = _hull_faces(vertices)
    for _ in range(subdivisions):
        vertices, faces = igl.upsample(vertices, faces)
    return Mesh(vertices / np.linalg.norm(vertices, axis=1, keepdims=True), faces)


def torus(major: float = 1.0, minor: float = 0.4, around: int = 96, across: int = 48) -> Mesh:
    """Torus around the z axis.

    Parameters
    ----------
    major, minor : float
        Radius of the centre line, and radius of the tube.
    around, across : int
        Numbers of vertices along the centre line and around the tube.
    """
    u, v = np.meshgrid(
        np.arange(around) * 2 * np.pi / around,
        np.arange(across) * 2 * np.pi / across,
        indexing="ij",
    )
    radius = major + minor * np.cos(v)
    vertices = np.stack([radius * np.cos(u), radius * np.sin(u), minor * np.sin(v)], axis=-1)
    index = np.arange(around * across).reshape(around, across)
    right, up = np.roll(index, -1, axis=0), np.roll(index, -1, axis=1)
    corner = np.roll(right, -1, axis=1)
    return Mesh(vertices.reshape(-1, 3), _halved_quads(index, right, corner, up))


def cube(pieces: int = 8) -> Mesh:
    """Cube with corners at ±1 and each edge divided into equal pieces."""
    grid = np.linspace(-1.0, 1.0, pieces + 1)
    u, v = (axis.ravel() for axis in np.meshgrid(grid, grid, indexing="ij"))
    index = np.arange(u.size).reshape(pieces + 1, pieces + 1)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    side = _halved_quads(a, b, c, d)
    points: list[FloatArray] = []
    faces: list[IntArray] = []
    for axis in range(3):
        for end in (1.0, -1.0):
            # Seen from outside, the second side of each pair is reversed.
            points.append(np.roll(np.stack([np.full_like(u, end), u, v], axis=1), axis, axis=1))
            faces.append((side if end > 0.0 else side[:, ::-1]) + len(faces) * len(u))
    every = np.concatenate(points)
    vertices, place = np.unique(every, axis=0, return_inverse=True)
    return Mesh(vertices, place.reshape(-1)[np.concatenate(faces)])


def disc(rings: int = 24) -> Mesh:
    """Flat unit disc in the xy plane, with rings of 6, 12, 18 … vertices around its centre."""
    points = [np.zeros((1, 2))]
    for ring in range(1, rings + 1):
        angle = np.arange(6 * ring) * 2 * np.pi / (6 * ring)
        points.append(np.stack([np.cos(angle), np.sin(angle)], axis=1) * ring / rings)
    flat = np.concatenate(points)
    faces = Delaunay(flat).simplices
    return Mesh(np.pad(flat, ((0, 0), (0, 1))), _counter_clockwise(flat, faces))


def annulus(rings: int = 16, hole: float = 0.3) -> Mesh:
    """Flat unit disc without the vertices that are no farther from its centre than ``hole``."""
    whole = disc(rings)
    outside = np.linalg.norm(whole.vertices, axis=1) > hole
    return _used_part(whole.vertices, whole.faces[outside[whole.faces].all(axis=1)])


def moebius_strip(around: int = 48, across: int = 8) -> Mesh:
    """Strip of width 0.8 along the unit circle, with a half twist."""
    u, v = np.meshgrid(
        np.arange(around) * 2 * np.pi / around, np.linspace(-0.4, 0.4, across + 1), indexing="ij"
    )
    radius = 1.0 + v * np.cos(0.5 * u)
    vertices = np.stack([radius * np.cos(u), radius * np.sin(u), v * np.sin(0.5 * u)], axis=-1)
    index = np.arange(u.size).reshape(u.shape)
    onward = np.concatenate([index[1:], index[:1, ::-1]])
    a, b, c, d = index[:, :-1], onward[:, :-1], onward[:, 1:], index[:, 1:]
    return Mesh(vertices.reshape(-1, 3), _halved_quads(a, b, c, d))


def double_torus(faces: int = 700, subdivisions: int = 1) -> Mesh:
    """Surface of genus two: two rings side by side along the x axis.

    Parameters
    ----------
    faces : int
        Number of faces after decimation and before subdivision.
    subdivisions : int
        Number of Loop subdivisions, each of which multiplies the number of faces by four.
    """
    x, y, z = (np.linspace(-a, a, n) for a, n in ((1.7, 46), (1.0, 28), (0.5, 16)))
    grid = np.stack([g.ravel() for g in np.meshgrid(z, y, x, indexing="ij")][::-1], axis=1)
    lemniscate = (grid[:, 0] ** 2 * (1.9 - grid[:, 0] ** 2) - 1.6 * grid[:, 1] ** 2) ** 2
    vertices, triangles = igl.marching_cubes(
        lemniscate + 3.0 * grid[:, 2] ** 2 - 0.25, grid, len(x), len(y), len(z), 0.0
    )[:2]
    vertices, triangles = igl.decimate(vertices, triangles, faces)[:2]
    return Mesh(*igl.loop(vertices, triangles, subdivisions))


def creature(seed: int, resolution: int = 48, faces: int = 500, subdivisions: int = 2) -> Mesh:
    """Random body with two to five limbs, decimated and then smoothed by Loop subdivision.

    Parameters
    ----------
    seed : int
        Seed of the random shape.
    resolution : int
        Number of grid cells along the longest side of the box around the implicit surface.
    faces : int
        Number of faces after decimation and before subdivision.
    subdivisions : int
        Number of Loop subdivisions, each of which multiplies the number of faces by four.
    """
    generator = np.random.default_rng(seed)
    starts, ends, radii = [], [], []
    body = generator.normal(size=3)
    body *= generator.uniform(0.3, 0.7) / np.linalg.norm(body)
    starts.append(-body)
    ends.append(body)
    radii.append(generator.uniform(0.25, 0.4))
    for _ in range(generator.integers(2, 6)):
        joint = generator.uniform(-1.0, 1.0) * body
        for _ in range(generator.integers(1, 3)):
            bone = generator.normal(size=3)
            bone *= generator.uniform(0.4, 0.8) / np.linalg.norm(bone)
            starts.append(joint)
            ends.append(joint + bone)
            radii.append(generator.uniform(0.09, 0.18))
            joint = joint + bone
    vertices, triangles = _capsules(np.array(starts), np.array(ends), np.array(radii), resolution)
    vertices, triangles = _largest_component(vertices, triangles)
    vertices, triangles = igl.decimate(vertices, triangles, faces)[:2]
    return Mesh(*igl.loop(vertices, triangles, subdivisions))


def _capsules(
    starts: FloatArray, ends: FloatArray, radii: FloatArray, resolution: int
) -> tuple[FloatArray, IntArray]:
    """Smooth union of capsules, as the zero set of a distance sampled on a grid."""
    low = np.minimum(starts, ends).min(axis=0) - 2 * radii.max()
    high = np.maximum(starts, ends).max(axis=0) + 2 * radii.max()
    cell = (high - low).max() / resolution
    counts = np.ceil((high - low) / cell).astype(int) + 1
    axes = [low[axis] + cell * np.arange(counts[axis]) for axis in range(3)]
    # libigl orders grid points with x varying fastest.
    z, y, x = np.meshgrid(*axes[::-1], indexing="ij")
    grid = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
    blend = 12.0 / radii.mean()
    total = np.zeros(len(grid))
    for start, end, radius in zip(starts, ends, radii, strict=True):
        axis = end - start
        along = np.clip((grid - start) @ axis / (axis @ axis), 0.0, 1.0)
        distance = np.linalg.norm(grid - start - along[:, None] * axis, axis=1) - radius
        total += np.exp(-blend * np.clip(distance, -1.0, 1.0) / 6.0)
    smooth_minimum = -np.log(total)
    vertices, faces = igl.marching_cubes(smooth_minimum, grid, *counts.tolist(), 0.0)[:2]
    return vertices, faces


def _largest_component(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    mesh = Mesh(vertices, faces)
    largest = np.bincount(mesh.face_component, weights=mesh.face_areas).argmax()
    part = _used_part(vertices, faces[mesh.face_component == largest])
    return part.vertices, part.faces


def _used_part(vertices: FloatArray, faces: IntArray) -> Mesh:
    """Mesh of the given faces, with only the vertices that they use."""
    used, renumbered = np.unique(faces, return_inverse=True)
    return Mesh(vertices[used], renumbered.reshape(-1, 3).astype(np.int64))


def _halved_quads(a: IntArray, b: IntArray, c: IntArray, d: IntArray) -> IntArray:
    """Two triangles for each quad abcd, (n, 3): abc of all quads, then acd of all quads."""
    halves = [np.stack(half, axis=-1).reshape(-1, 3) for half in ((a, b, c), (a, c, d))]
    return np.concatenate(halves)


def _hull_faces(vertices: FloatArray) -> IntArray:
    """Triangles of a convex polyhedron about the origin, anticlockwise seen from outside."""
    faces = ConvexHull(vertices).simplices.astype(np.int64)
    corner = vertices[faces]
    inward = np.linalg.det(corner) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    return faces


def _counter_clockwise(flat: FloatArray, faces: IntArray) -> IntArray:
    faces = faces.astype(np.int64)
    corner = flat[faces]
    first, second = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    clockwise = first[:, 0] * second[:, 1] < first[:, 1] * second[:, 0]
    faces[clockwise] = faces[clockwise][:, ::-1]
    return faces
