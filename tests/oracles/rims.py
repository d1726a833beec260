"""Bodies with a rim that is known in closed form: prepared teeth, and machine parts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import Delaunay, cKDTree

import nicmm_core as nicmm
from nicmm_core.geometry.array_types import FloatArray

SLOPE, WIDTH = 0.9, 0.03
"""Slope on both sides of the margin of a tooth, and the width over which it changes."""


@dataclass(frozen=True)
class Rim:
    """A body and dense points of its rim, a closed loop, (n, 3)."""

    mesh: nicmm.Mesh
    points: FloatArray

    @property
    def edge(self) -> float:
        """Mean length of the edges at the rim."""
        away = cKDTree(self.points).query(self.mesh.vertices)[0]
        near = away <= 2.0 * self.mesh.mean_edge_length
        sides = self.mesh.faces[:, [[1, 2], [2, 0], [0, 1]]].reshape(-1, 2)
        sides = sides[near[sides].any(axis=1)]
        steps = self.mesh.vertices[sides[:, 0]] - self.mesh.vertices[sides[:, 1]]
        return float(np.linalg.norm(steps, axis=1).mean())

    def distance(self, curve: nicmm.SurfaceCurve) -> float:
        """Greatest distance between a closed curve and the rim, in both directions."""
        there = np.concatenate([curve.points, 0.5 * (curve.points + np.roll(curve.points, -1, 0))])
        one, other = cKDTree(self.points).query(there)[0], cKDTree(there).query(self.points)[0]
        return float(max(one.max(), other.max()))


def tooth(seed: int, vertices: int = 3000, noise: float = 0.0) -> Rim:
    """A prepared tooth: a stump inside of a wavy ridge, the margin.

    It is a surface of heights over a disc. The noise is relative to the mean edge length.
    """
    generator = np.random.default_rng(seed)
    waves = generator.uniform(-1.0, 1.0, (3, 2)) * np.array([[0.12], [0.06], [0.03]])

    def margin(angle: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Radius and height of the margin at angles."""
        radius = 0.6 * np.ones_like(angle)
        height = np.zeros_like(angle)
        for order, (a, b) in enumerate(waves, start=2):
            radius = radius + 0.5 * a * np.cos(order * angle)
            height = height + 0.5 * b * np.sin(order * angle)
        return radius, height

    flat = _disc(generator, vertices)
    angle, size = np.arctan2(flat[:, 1], flat[:, 0]), np.linalg.norm(flat, axis=1)
    radius, height = margin(angle)
    outside = size - radius
    # A roof with a rounded crest; a stump rises inside of it.
    roof = -SLOPE * (np.hypot(outside, WIDTH) - WIDTH)
    stump = 0.5 / (1.0 + np.exp((outside + 0.33) / 0.05))
    z = height + roof + stump
    mesh = _surface(flat, z)
    if noise:
        moved = mesh.vertices.copy()
        moved += noise * mesh.mean_edge_length * generator.normal(size=moved.shape) / np.sqrt(3.0)
        mesh = nicmm.Mesh(moved, mesh.faces)
    turn = np.linspace(-np.pi, np.pi, 2000, endpoint=False)
    radius, height = margin(turn)
    rim = np.stack([radius * np.cos(turn), radius * np.sin(turn), height], axis=1)
    return Rim(mesh, rim)


def shaft(seed: int, around: int = 40) -> Rim:
    """A stepped shaft with random steps; the rim is the upper edge of one of them."""
    generator = np.random.default_rng(seed)
    radii = np.cumsum(generator.uniform(0.35, 0.5, 3))[::-1]
    heights = np.cumsum(generator.uniform(0.3, 0.6, 3))
    profile = [(0.0, 0.0)]
    bottom = 0.0
    for radius, top in zip(radii, heights, strict=True):
        profile += [(radius, bottom), (radius, top)]
        bottom = top
    profile.append((0.0, bottom))
    rings, spacing = [], 2.0 * np.pi * radii[1] / around
    for (r0, z0), (r1, z1) in zip(profile[:-1], profile[1:], strict=True):
        pieces = max(int(np.ceil(np.hypot(r1 - r0, z1 - z0) / spacing)), 1)
        share = np.linspace(0.0, 1.0, pieces + 1)[:-1]
        rings += list(zip(r0 + share * (r1 - r0), z0 + share * (z1 - z0), strict=True))
    rings.append(profile[-1])
    mesh = _turned(np.array(rings), around)
    turn = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)
    corners = np.stack([np.cos(turn), np.sin(turn)], axis=1) * radii[1]
    dense = _along(corners)
    return Rim(mesh, np.column_stack([dense, np.full(len(dense), heights[1])]))


def _along(corners: FloatArray, pieces: int = 40) -> FloatArray:
    """Points along a closed polygon."""
    share = np.linspace(0.0, 1.0, pieces, endpoint=False)[None, :, None]
    following = np.roll(corners, -1, axis=0)
    return ((1.0 - share) * corners[:, None] + share * following[:, None]).reshape(
        -1, corners.shape[1]
    )


def _disc(generator: np.random.Generator, count: int) -> FloatArray:
    """Random, fairly even points of the unit disc, with its boundary, (n, 2)."""
    spacing = np.sqrt(np.pi / count)
    rim = np.linspace(0.0, 2.0 * np.pi, int(2.0 * np.pi / spacing), endpoint=False)
    line = np.arange(-1.0, 1.0, spacing)
    grid = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    grid += generator.uniform(-0.35, 0.35, grid.shape) * spacing
    grid = grid[np.linalg.norm(grid, axis=1) < 1.0 - 0.6 * spacing]
    return np.concatenate([np.stack([np.cos(rim), np.sin(rim)], axis=1), grid])


def _surface(flat: FloatArray, z: FloatArray) -> nicmm.Mesh:
    """The surface of heights over points of a plane, with normals upwards."""
    faces = Delaunay(flat).simplices.astype(np.int64)
    one, other = flat[faces[:, 1]] - flat[faces[:, 0]], flat[faces[:, 2]] - flat[faces[:, 0]]
    down = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0] < 0.0
    faces[down] = faces[down][:, [0, 2, 1]]
    return nicmm.Mesh(np.column_stack([flat, z]), faces)


def _turned(profile: FloatArray, around: int) -> nicmm.Mesh:
    """A body of revolution about the z axis; the profile, (n, 2), begins and ends on the axis."""
    turn = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)
    inner = profile[1:-1]
    rings = np.stack(
        [
            inner[:, :1] * np.cos(turn),
            inner[:, :1] * np.sin(turn),
            np.repeat(inner[:, 1:], around, axis=1),
        ],
        axis=-1,
    ).reshape(-1, 3)
    index = np.arange(len(rings)).reshape(len(inner), around)
    following = np.roll(index, -1, axis=1)
    a, b, c, d = index[:-1], following[:-1], following[1:], index[1:]
    sides = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)]).reshape(-1, 3)
    low, high = len(rings), len(rings) + 1
    floor = np.stack([np.full(around, low), following[0], index[0]], axis=1)
    roof = np.stack([np.full(around, high), index[-1], following[-1]], axis=1)
    ends = np.array([[0.0, 0.0, profile[0, 1]], [0.0, 0.0, profile[-1, 1]]])
    return nicmm.Mesh(np.concatenate([rings, ends]), np.concatenate([sides, floor, roof]))
