"""Quality measures of curves: geodesic curvature and bending."""

from __future__ import annotations

import numpy as np

from nicmm_core.geometry.array_types import FloatArray
from nicmm_core.geometry.curve import SurfaceCurve, resample
from nicmm_core.geometry.geodesic_curvature import geodesic_curvature
from nicmm_core.geometry.mesh import Mesh
from nicmm_core.geometry.normals import vertex_normals

SAMPLES = 128
"""Number of evenly spaced points of a curve at which curvature is measured.

The vertices of the polyline itself are unsuitable: it has short segments wherever it passes near a
mesh vertex, and the turning angles between them are meaningless.
"""


def diagonal(mesh: Mesh) -> float:
    """Length of the bounding box's diagonal."""
    return float(np.linalg.norm(np.ptp(mesh.vertices[mesh.referenced], axis=0)))


def curvature_along(mesh: Mesh, curve: SurfaceCurve, samples: int = SAMPLES) -> FloatArray:
    """Geodesic curvature (Eq. 10) at evenly spaced points of a curve, in 1/length.

    For an open curve the points include both ends, where the curvature is zero.
    """
    points, segment = resample(curve.points, samples, curve.closed)
    at_corners = vertex_normals(mesh.vertices, mesh.faces)[mesh.faces[curve.faces[segment]]]
    normals = (curve.barycentric[segment][:, :, None] * at_corners).sum(axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return geodesic_curvature(points, normals, curve.closed)


def squared_curvature(mesh: Mesh, curve: SurfaceCurve, samples: int = SAMPLES) -> float:
    """∫ κ_g² ds along a curve, in 1/length."""
    steps = samples if curve.closed else samples - 1
    return float((curvature_along(mesh, curve, samples) ** 2).sum() * curve.length / steps)


def bending(mesh: Mesh, curve: SurfaceCurve, samples: int = SAMPLES) -> float:
    """Scale-free bending L ∫ κ_g² ds; a circle in the plane has 4π²."""
    return curve.length * squared_curvature(mesh, curve, samples)
