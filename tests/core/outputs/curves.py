"""Surfaces with designed curves, for the tests of outputs."""

from functools import cache

import numpy as np

import nicmm_core as nicmm
from tests.core.test_guarantee import surface

KINDS = ("sphere", "torus", "creature", "disc", "Möbius strip", "annulus")


@cache
def designed(kind, seed, noisy, closed, method):
    """A surface and a curve through random points on it, or None if no such curve exists."""
    mesh = surface(kind, seed, noisy)
    generator = np.random.default_rng(seed)
    faces = generator.choice(len(mesh.faces), 4, replace=False)
    # At corners, on edges and inside faces.
    weights = generator.dirichlet([1.0] * 3, size=4) * (generator.random((4, 3)) < 0.7)
    weights[weights.sum(axis=1) == 0.0] = [1.0, 0.0, 0.0]
    points = nicmm.SurfacePoints(faces, weights / weights.sum(axis=1, keepdims=True))
    try:
        design = nicmm.design_curve(mesh, points, closed=closed, order="shortest", method=method)
    except nicmm.NicmmError:
        return mesh, None
    return mesh, design.curves[0]
