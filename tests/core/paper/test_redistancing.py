"""Tests distances to the zero set of a field against closed forms."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nicmm_core import Mesh, shapes
from nicmm_core.geometry import distances
from nicmm_core.geometry.distances import build_distance_surface
from nicmm_core.paper.redistancing import redistanced

NOTHING = np.zeros(0, dtype=np.int64)


def distance_surface(mesh):
    return build_distance_surface(mesh.vertices, mesh.faces, mesh.mean_edge_length)


def distance_to_small_circle(mesh, axis, height):
    """Exact signed distance on the unit sphere to a parallel about an axis, at a latitude."""
    return np.arcsin(np.clip(mesh.vertices @ axis, -1.0, 1.0)) - height


@pytest.mark.parametrize("limit_in_edges", [5.0, np.inf])
def test_any_field_with_the_same_zero_set_gives_the_same_distance(flat_disc, limit_in_edges):
    """Only the zero set matters, not the slope of the field; to a straight line it is exact."""
    line = flat_disc.vertices @ [0.6, 0.8, 0.0] - 0.21
    radius = np.linalg.norm(flat_disc.vertices, axis=1)
    limit = limit_in_edges * flat_disc.mean_edge_length
    surface = distance_surface(flat_disc)
    for steepness in (0.1, 1.0, 7.0):
        found = redistanced(surface, steepness * line, NOTHING, limit)
        # Farther out, the nearest point of the line may lie beyond the rim of the disc.
        near = (np.abs(line) < 0.5 * min(limit, 0.4)) & (radius < 0.7)
        np.testing.assert_allclose(found[near], line[near], rtol=0, atol=1e-9)
        assert np.abs(found).max() <= limit


def test_a_field_without_zero_set_stays_as_it_is(ball):
    field = 2.0 + ball.vertices[:, 0]
    np.testing.assert_array_equal(redistanced(distance_surface(ball), field, NOTHING), field)


def test_error_falls_with_the_mesh():
    """Plane waves have a first-order error on a curved front."""
    axis = np.array([0.36, 0.48, 0.8])
    errors = []
    for subdivisions in (3, 4, 5):
        mesh = shapes.sphere(subdivisions)
        exact = distance_to_small_circle(mesh, axis, 0.3)
        found = redistanced(distance_surface(mesh), np.sinh(exact), NOTHING)
        errors.append(np.abs(found - exact).max())
    assert errors[0] > 1.4 * errors[1] > 1.4 * 1.4 * errors[2]
    assert errors[-1] < 0.015


def test_signs_and_zeros_stay(body):
    """No vertex changes its sign, and exactly the given zero vertices are zero."""
    generator = np.random.default_rng(3)
    field = body.vertices @ generator.normal(size=3)
    field -= np.median(field)
    zero = np.array([17])
    found = redistanced(distance_surface(body), field, zero, 0.2)
    others = np.setdiff1d(np.arange(len(field)), zero)
    assert found[17] == 0.0
    np.testing.assert_array_equal(np.sign(found[others]), np.where(field[others] < 0, -1, 1))


def test_scaling_the_mesh_scales_the_distance(body):
    field = body.vertices[:, 0] - np.median(body.vertices[:, 0])
    small = redistanced(distance_surface(body), field, NOTHING)
    scaled = build_distance_surface(1e3 * body.vertices, body.faces, 1e3 * body.mean_edge_length)
    np.testing.assert_allclose(redistanced(scaled, field, NOTHING), 1e3 * small, rtol=1e-6)


@pytest.mark.slow
@given(st.integers(0, 10_000))
def test_distance_never_rises_faster_than_edges_are_long(ball, seed):
    """|d(a) - d(b)| ≤ |ab| holds on every edge, as for any distance."""
    generator = np.random.default_rng(seed)
    field = ball.vertices @ generator.normal(size=3) + 0.3 * generator.normal()
    found = np.abs(redistanced(distance_surface(ball), field, NOTHING))
    start, end = ball.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).T
    length = np.linalg.norm(ball.vertices[start] - ball.vertices[end], axis=1)
    assert (np.abs(found[start] - found[end]) <= length * (1.0 + 1e-9)).all()


def twisted_prism(around, rows, height, twist):
    """A prism of obtuse triangles: each ring of vertices is rotated against the previous one."""
    ring, place = np.divmod(np.arange(rows * around), around)
    angle = 2.0 * np.pi * (place + twist * ring) / around
    vertices = np.stack([np.cos(angle), np.sin(angle), height * ring], axis=1)
    low = np.arange((rows - 1) * around)
    beside = low - low % around + (low + 1) % around
    lower = np.stack([low, beside, low + around], axis=1)
    upper = np.stack([beside, beside + around, low + around], axis=1)
    return Mesh(vertices, np.concatenate([lower, upper]))


@pytest.mark.parametrize("twist", [3, 8])
def test_needles_in_a_ring_do_not_lower_one_anothers_distance(monkeypatch, twist):
    """One case of the hostile input once took 11,000 rounds on 3,400 vertices."""
    mesh = twisted_prism(100, 10, 0.001, twist)
    rounds = []
    monkeypatch.setattr(distances, "checkpoint", lambda: rounds.append(1))
    line = mesh.vertices[:, 0] - 0.01
    found = np.abs(redistanced(distance_surface(mesh), line, NOTHING))
    assert len(rounds) < 200
    # At most a quarter of the circle, and at least the distance to the plane.
    assert found.max() < 0.5 * np.pi + 0.05
    assert (found >= np.abs(line) - 1e-9).all()
