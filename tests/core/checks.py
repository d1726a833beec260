"""What every curve must fulfil, as assertions, and helpers that several tests share.

`benchmarks.checker` is the one definition of what is right.
"""

import numpy as np

import nicmm_core as nicmm
from benchmarks.checker import judge_curve
from benchmarks.named_curves import nearest_vertices  # noqa: F401 - several tests take it from here


def assert_valid_curve(mesh, curve, control_positions=None, closed=True):
    """A curve on the surface, simple, through the control points in order."""
    assert not judge_curve(mesh, curve, control_positions, closed).faults


def assert_valid_design(mesh, design, control_positions=None, closed=True):
    """A usable result: one valid curve, a finite field and every term of the energy."""
    assert design.status in (nicmm.Status.CONVERGED, nicmm.Status.ITERATION_LIMIT), design.status
    assert len(design.curves) == 1
    assert_valid_curve(mesh, design.curves[0], control_positions, closed)
    assert design.field.shape == (len(mesh.vertices),)
    assert np.isfinite(design.field).all()
    assert set(design.energy) == {"sdf", "int", "smooth", "fea"}
    assert all(np.isfinite(value) and value >= 0.0 for value in design.energy.values())
    assert isinstance(design.iterations, int) and design.iterations > 0
    assert design.seconds > 0.0


def assert_lies_on_surface(mesh, curve):
    """Points are what their barycentrics say, and neighbours share a face."""
    assert not judge_curve(mesh, curve).off_surface


def assert_does_not_touch_itself(mesh, curve):
    """No point twice and no two strands that cross or touch."""
    verdict = judge_curve(mesh, curve)
    assert verdict.readable
    assert not verdict.not_simple


def assert_visits(mesh, curve, control_positions):
    """Control points are polyline points, met in the order of the positions given."""
    verdict = judge_curve(mesh, curve, control_positions, curve.closed)
    assert verdict.readable
    assert not verdict.not_through_points


def random_surface_points(mesh, count, seed):
    """Points strictly inside random faces, no two in one face."""
    generator = np.random.default_rng(seed)
    faces = generator.choice(len(mesh.faces), size=count, replace=False)
    barycentric = generator.dirichlet([2.0, 2.0, 2.0], size=count)
    return nicmm.SurfacePoints(faces, barycentric)


def euler_characteristic(faces):
    """V - E + F of the vertices that faces use."""
    sides = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    return len(np.unique(faces)) - len(np.unique(sides, axis=0)) + len(faces)


def circle(angles, radius=1.0):
    """Points of a circle about the origin in the xy plane."""
    angles = np.asarray(angles)
    return radius * np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=1)


def apart(first, second):
    """Farthest that either closed polyline (n, 3) strays from the other."""
    return max(_farthest(first, second), _farthest(second, first))


def _farthest(points, polyline):
    start = polyline[None]
    step = np.roll(polyline, -1, axis=0)[None] - start
    offset = points[:, None] - start
    along = np.clip((offset * step).sum(axis=2) / (step**2).sum(axis=2), 0.0, 1.0)
    return np.linalg.norm(offset - along[:, :, None] * step, axis=2).min(axis=1).max()


def mean_edge_length(mesh):
    """Mean length of the sides of all faces."""
    corners = mesh.vertices[mesh.faces]
    return float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean())


def joined(*meshes):
    """Several meshes as one with several components."""
    offsets = np.cumsum([0, *[len(mesh.vertices) for mesh in meshes[:-1]]])
    return nicmm.Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + o for mesh, o in zip(meshes, offsets, strict=True)]),
    )
