"""How often a design gives exactly one closed loop through all points, and how often by itself.

"By itself" is the paper's level set: no vertex had to keep the side that it has initially.
"""

from __future__ import annotations

import platform

import numpy as np

import nicmm_core as nicmm
from nicmm_core.curve import SurfaceCurve, geodesic_curvature, resample
from nicmm_core.design import is_one_curve
from nicmm_core.features import vertex_normals

from . import collections

SEED = 0
SETS = 2


def run(quick: bool) -> None:
    """Measure on SHREC16 after two Loop subdivisions and on closed manifold meshes."""
    print(f"seed {SEED}, {SETS} sets of 3–5 random vertices a mesh, shortest order, nicmm-paper")
    print(f"{platform.machine()}, Python {platform.python_version()}")
    _measure("shrec16", collections.shrec16(4 if quick else 48))
    _measure("clean", collections.clean(4 if quick else 36))


def _measure(name: str, meshes) -> None:
    generator = np.random.default_rng(SEED)
    outcomes, bends, times, iterations = [], [], [], []
    n_meshes = 0
    for mesh_name, mesh in meshes:
        n_meshes += 1
        designer = nicmm.Designer(mesh)
        for _ in range(SETS):
            points = generator.choice(
                np.flatnonzero(mesh.referenced), generator.integers(3, 6), replace=False
            )
            try:
                design = designer.design(points, order="shortest", method="nicmm-paper")
            except nicmm.UnreachableError as error:
                outcomes.append("refused")
                print(f"  {mesh_name}: {error}")
                continue
            finite = np.isfinite(design.field).all() and np.isfinite(design.curves[0].points).all()
            if not finite:
                outcomes.append("nan")
            elif not is_one_curve(design.curves):
                outcomes.append("several")
            else:
                outcomes.append("kept" if design.breaking_vertices else "by itself")
                bends.append(bending(mesh, design.curves[0]))
            times.append(design.seconds)
            iterations.append(design.iterations)
            print(f"  {mesh_name}: {outcomes[-1]}, {design.iterations} it, {design.status.name}")
    count = {outcome: outcomes.count(outcome) for outcome in sorted(set(outcomes))}
    print(f"{name}: {n_meshes} meshes, {len(outcomes)} sets: {count}")
    print(f"  L ∮ κ_g² ds quartiles {np.quantile(bends, [0.25, 0.5, 0.75]).round(0).tolist()}")
    print(f"  iterations median {np.median(iterations):.0f}, seconds {np.median(times):.2f}")


def bending(mesh: nicmm.Mesh, curve: SurfaceCurve, samples: int = 128) -> float:
    """Scale-free bending L ∮ κ_g² ds from evenly spaced samples (Eq. 10); a circle has 4 π²."""
    points, segment = resample(curve.points, samples)
    at_corners = vertex_normals(mesh.vertices, mesh.faces)[mesh.faces[curve.faces[segment]]]
    normals = (curve.barycentric[segment][:, :, None] * at_corners).sum(axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    curvature = geodesic_curvature(points, normals)
    return float((curvature**2).mean() * curve.length**2)
