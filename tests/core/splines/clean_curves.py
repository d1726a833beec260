"""Polylines, designed curves and distances for the tests of clean curves."""

from functools import cache

import numpy as np
from scipy.spatial import cKDTree

import nicmm_core as nicmm
from nicmm_core import shapes
from tests.core.checks import random_surface_points

SQUARE = np.array([[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0], [0.5, 0.5, 0.0], [-0.5, 0.5, 0.0]])
"""Corners of a square."""

DESIGNS = ("ball", "ring", "cube", "open")


@cache
def designed(name):
    """A mesh and a curve designed on it; on the coarse ring and on the cube it has corners."""
    mesh, count = {
        "ball": (shapes.sphere(3), 5),
        "ring": (shapes.torus(around=12, across=8), 4),
        "cube": (shapes.cube(4), 4),
        "open": (shapes.sphere(2), 4),
    }[name]
    points = random_surface_points(mesh, count, seed=3)
    design = nicmm.design_curve(mesh, points, closed=name != "open")
    return mesh, design.curves[0]


@cache
def designed_square():
    """A curve designed in the plane through four corners."""
    design = nicmm.design_curve(shapes.disc(16), SQUARE, corners=[0, 1, 2, 3])
    return design.curves[0]


def irregular(count, seed):
    """Sorted parameters in [0, 1) with very uneven gaps."""
    return np.sort(np.random.default_rng(seed).random(count))


def square(pieces):
    """Unit square that starts at the middle of a side, with ``pieces`` points per half side."""
    corners = np.array([[0.5, 0], [1, 0], [1, 1], [0, 1], [0, 0], [0.5, 0]])
    at = np.arange(8 * pieces) / (2 * pieces)
    flat = [np.interp(at, [0, 0.5, 1.5, 2.5, 3.5, 4], corners[:, axis]) for axis in range(2)]
    return np.stack([*flat, np.zeros(len(at))], axis=1)


def strays(points, polyline, closed):
    """Greatest distance from points (k, 3) to a polyline."""
    line = np.concatenate([polyline, polyline[:1]]) if closed else polyline
    line = line[np.concatenate([[True], np.diff(line, axis=0).any(axis=1)])]
    if len(line) == 1:
        return float(np.linalg.norm(points - line, axis=1).max())
    lengths = np.linalg.norm(np.diff(line, axis=0), axis=1)
    # With short segments of similar length, the nearest one is among those with nearest midpoints.
    pieces = np.ceil(lengths * 2000 / lengths.sum()).astype(int)
    arc = np.concatenate([[0.0], np.cumsum(lengths)])
    starts = zip(arc[:-1], arc[1:], pieces, strict=True)
    at = np.concatenate([np.linspace(a, b, k, endpoint=False) for a, b, k in starts] + [arc[-1:]])
    line = np.stack([np.interp(at, arc, line[:, k]) for k in range(3)], axis=1)
    start, step = line[:-1], np.diff(line, axis=0)
    near = cKDTree(start + 0.5 * step).query(points, k=min(8, len(start)))[1]
    near = near.reshape(len(points), -1)
    offset, step = points[:, None] - start[near], step[near]
    along = np.clip((offset * step).sum(axis=2) / (step**2).sum(axis=2), 0.0, 1.0)
    return float(np.linalg.norm(offset - along[:, :, None] * step, axis=2).min(axis=1).max())


def subdivided(polyline, closed, parts=8):
    """Points on a polyline, ``parts`` per segment."""
    line = np.concatenate([polyline, polyline[:1]]) if closed else polyline
    at = np.arange(parts * (len(line) - 1) + 1) / parts
    return np.stack([np.interp(at, np.arange(len(line)), line[:, k]) for k in range(3)], axis=1)
