"""Closed curves of known topology: around tubes, handles and holes, and along a Möbius strip.

None of them bounds a region alone, without other curves or a boundary.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from nicmm_core import shapes
from nicmm_core.geometry.array_types import FloatArray, IntArray
from nicmm_core.geometry.mesh import Mesh


@dataclass(frozen=True)
class NamedCurve:
    """Request for a curve: vertices to visit, and the argument `order` of `design_curve`."""

    name: str
    mesh: Mesh
    points: IntArray
    order: str


def named_curves() -> Iterator[NamedCurve]:
    """All named curves, on generated shapes."""
    ring = shapes.torus(around=72, across=36)
    for name, along, across, count in (
        ("meridian of a torus", 0, 1, 3),
        ("parallel of a torus", 1, 0, 6),
        ("(1, 1) curve of a torus", 1, 1, 6),
    ):
        yield NamedCurve(name, ring, torus_points(ring, along, across, count), "given")
    double = shapes.double_torus()
    for half, side in ((-1.0, "left"), (1.0, "right")):
        points = handle_points(double, half)
        yield NamedCurve(f"{side} handle of a double torus", double, points, "shortest")
    strip = shapes.moebius_strip()
    core = nearest_vertices(strip, _circle([0.0, 2.0, 4.0], 1.0))
    yield NamedCurve("core of a Möbius strip", strip, core, "given")
    annulus = shapes.annulus()
    hole = nearest_vertices(annulus, _circle([0.0, 1.5, 3.0, 4.5], 0.6))
    yield NamedCurve("around the hole of an annulus", annulus, hole, "given")


def torus_points(mesh: Mesh, along: int, across: int, count: int) -> IntArray:
    """Vertices on a curve that winds around the axis and around the tube of a torus.

    It winds ``along`` times around the axis and ``across`` times around the tube. The mesh is
    `shapes.torus` with its default radii.
    """
    t = np.arange(count) * 2 * np.pi / count
    u, v = along * t, across * t
    radius = 1.0 + 0.4 * np.cos(v)
    return nearest_vertices(
        mesh, np.stack([radius * np.cos(u), radius * np.sin(u), 0.4 * np.sin(v)], axis=1)
    )


def handle_points(mesh: Mesh, half: float) -> IntArray:
    """Vertices of `shapes.double_torus` on a curve through a hole and back on the outside.

    ``half`` is -1 for the left handle and 1 for the right one.
    """
    plane = np.abs(mesh.vertices[:, 1]) < 0.08
    candidates = np.flatnonzero(plane & (half * mesh.vertices[:, 0] > 0.2))
    reach = np.abs(mesh.vertices[candidates, 0])
    middle = 0.5 * (reach.max() + reach[reach > 1.0].min())
    outer = candidates[np.argsort(-reach)[0]]
    tube = candidates[np.argsort(np.abs(reach - middle))]
    top = tube[mesh.vertices[tube, 2] > 0.02][0]
    bottom = tube[mesh.vertices[tube, 2] < -0.02][0]
    return np.array([outer, top, bottom])


def nearest_vertices(mesh: Mesh, positions: FloatArray) -> IntArray:
    """Index of the nearest vertex of each position."""
    offset = mesh.vertices[None] - np.asarray(positions)[:, None]
    return np.linalg.norm(offset, axis=2).argmin(axis=1)


def _circle(angles: Sequence[float], radius: float) -> FloatArray:
    return radius * np.stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))], axis=1)
