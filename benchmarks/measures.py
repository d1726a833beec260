"""What is measured of curves: bending, geodesic curvature and distances between them."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from nicmm_core.array_types import FloatArray
from nicmm_core.curve import SurfaceCurve, geodesic_curvature, resample
from nicmm_core.features import vertex_normals
from nicmm_core.mesh import Mesh

SAMPLES = 128
"""Evenly spaced points of a curve that curvature is taken at.

Polylines have short segments wherever they pass near a vertex, whose angles say nothing.
"""


def diagonal(mesh: Mesh) -> float:
    """Length of the bounding box's diagonal."""
    return float(np.linalg.norm(np.ptp(mesh.vertices[mesh.referenced], axis=0)))


def curvature_along(mesh: Mesh, curve: SurfaceCurve, samples: int = SAMPLES) -> FloatArray:
    """Geodesic curvature (Eq. 10) at evenly spaced points of a closed curve, in 1/length."""
    points, segment = resample(curve.points, samples)
    at_corners = vertex_normals(mesh.vertices, mesh.faces)[mesh.faces[curve.faces[segment]]]
    normals = (curve.barycentric[segment][:, :, None] * at_corners).sum(axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return geodesic_curvature(points, normals)


def bending(mesh: Mesh, curve: SurfaceCurve, samples: int = SAMPLES) -> float:
    """Scale-free bending L ∮ κ_g² ds; a circle in the plane has 4 π²."""
    curvature = curvature_along(mesh, curve, samples)
    return float((curvature**2).mean() * curve.length**2)


def distances(first: SurfaceCurve, second: SurfaceCurve) -> tuple[float, float]:
    """Mean and greatest distance between two closed curves, both ways, in the mesh's unit."""
    here, _ = resample(first.points, 1000)
    there, _ = resample(second.points, 1000)
    both = np.concatenate([cKDTree(here).query(there)[0], cKDTree(there).query(here)[0]])
    return float(both.mean()), float(both.max())
