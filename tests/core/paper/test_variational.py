"""Tests the variational method on known curves, and against the network."""

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.surface_points import locate_control_points
from nicmm_core.paper.level_set_solver import SolverConfig
from nicmm_core.paper.losses import LossWeights
from nicmm_core.paper.problem import build_problem
from nicmm_core.paper.topology import breaking_vertices
from nicmm_core.paper.variational import CONVERGENCE, solve
from nicmm_core.paper.vertex_links import VertexLinks
from nicmm_core.status import Status
from tests.core.checks import assert_valid_curve, assert_valid_design, circle
from tests.oracles.named_curves import nearest_vertices

SAME_CURVE = 0.08
"""Greatest distance of the network's curve from the variational one in easy cases, in radii."""


def design(mesh, points, **settings):
    return nicmm.design_curve(mesh, points, method="variational", **settings)


@pytest.mark.slow
def test_points_of_a_great_circle_give_a_great_circle():
    """A great circle has no geodesic curvature; tested at two resolutions."""
    farthest = []
    for subdivisions in (3, 4):
        mesh = shapes.sphere(subdivisions)
        turned = circle([0.0, np.pi / 2, np.pi, 3 * np.pi / 2])
        curve = design(mesh, nearest_vertices(mesh, turned)).curves[0]
        farthest.append(np.abs(curve.points[:, 2]).max())
    assert max(farthest) < 0.01


@pytest.mark.slow
def test_points_of_a_circle_in_a_disc_give_that_circle():
    """The circle is the closed elastic curve of the plane."""
    mesh = shapes.disc(24)
    points = circle(np.arange(6) * np.pi / 3, radius=0.55)
    curve = design(mesh, points).curves[0]
    radii = np.linalg.norm(curve.points, axis=1)
    assert np.abs(radii - 0.55).max() < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("method", ["nicmm", "elastic"])
def test_network_and_variational_method_reach_the_same_curve(method):
    """In easy cases, within `SAME_CURVE`."""
    mesh = shapes.sphere(3)
    points = nearest_vertices(mesh, circle([0.0, 1.5, 3.0, 4.6]))
    here = design(mesh, points).curves[0].points
    there = nicmm.design_curve(mesh, points, method=method).curves[0].points
    gaps = np.linalg.norm(here[:, None] - there[None], axis=2)
    assert max(gaps.min(axis=0).max(), gaps.min(axis=1).max()) < SAME_CURVE


@pytest.mark.slow
def test_curves_are_valid_on_every_surface(surface):
    """The result is one simple loop on the surface, exactly through the points."""
    points = np.random.default_rng(4).choice(len(surface.vertices), 4, replace=False)
    result = design(surface, points, order="shortest")
    assert_valid_design(surface, result)
    assert_valid_curve(surface, result.curves[0])


@pytest.mark.slow
def test_loss_falls_far_and_the_loop_stays_one(body):
    """From the smoothed initial path to convergence, the isotopy class does not change."""
    points = locate_control_points(body, [5, 150, 300, 400], closed=True)
    problem = build_problem(body, points, "shortest")
    solution = solve(problem, LossWeights())
    assert solution.status == Status.CONVERGED
    assert min(solution.losses) < 0.5 * solution.losses[0]
    links = VertexLinks(problem.working)
    controls = problem.loop.control_vertices
    assert (solution.field[controls] == 0.0).all()
    assert not len(breaking_vertices(links, problem.initial_distance, solution.field, controls))


@pytest.mark.slow
def test_stops_by_the_papers_rule(ball):
    """It stops if the least loss changes by less than 1e-5 over ten iterations, or at the cap."""
    points = locate_control_points(ball, [3, 200, 400, 600], closed=True)
    problem = build_problem(ball, points, "shortest")
    assert (CONVERGENCE.patience, CONVERGENCE.tolerance) == (10, 1e-5)
    losses = solve(problem, LossWeights()).losses
    assert len(losses) > 10
    assert min(losses[:-10]) - min(losses) < 1e-5
    capped = solve(problem, LossWeights(), SolverConfig(iterations=3))
    assert (capped.status, capped.iterations) == (Status.ITERATION_LIMIT, 3)


@pytest.mark.slow
def test_can_be_watched_and_cancelled(ball):
    points = locate_control_points(ball, [3, 200, 400, 600], closed=True)
    problem = build_problem(ball, points, "shortest")
    seen = []

    def watch(fraction, field):
        seen.append(fraction)
        assert np.isfinite(field).all()
        return len(seen) < 4

    solution = solve(problem, LossWeights(), watch=watch)
    assert solution.status == Status.CANCELLED
    assert seen == pytest.approx([0.01, 0.02, 0.03, 0.04])


@pytest.mark.slow
def test_obstacle_is_avoided_and_alignment_followed():
    mesh = shapes.sphere(4)
    points = nearest_vertices(mesh, circle([0.0, np.pi / 2, np.pi, 3 * np.pi / 2]))
    on_the_way = circle([np.pi / 4])[0]
    offset = np.linalg.norm(mesh.vertices - on_the_way, axis=1)
    round_it = design(mesh, points, obstacles=(offset < 0.2).astype(float)).curves[0]
    assert np.linalg.norm(round_it.points - on_the_way, axis=1).min() > 0.2

    above = on_the_way + [0.0, 0.0, 0.25]
    above /= np.linalg.norm(above)
    wanted = np.linalg.norm(mesh.vertices - above, axis=1) < 0.15
    attracted = design(mesh, points, alignment=wanted.astype(float)).curves[0]
    plain = design(mesh, points).curves[0]
    assert distance_to(attracted, above) < 0.65 * distance_to(plain, above)


def distance_to(curve, place):
    return np.linalg.norm(curve.points - place, axis=1).min()


@pytest.mark.slow
def test_needs_no_pytorch(monkeypatch, small_ball):
    """The energy uses NumPy arrays only, so PyTorch may be missing."""
    import sys

    monkeypatch.setitem(sys.modules, "torch", None)
    assert len(design(small_ball, [3, 60, 100]).curves) == 1


@pytest.mark.slow
def test_same_input_gives_the_same_curve(body):
    first, second = (design(body, [5, 150, 300], order="shortest") for _ in range(2))
    np.testing.assert_array_equal(first.curves[0].points, second.curves[0].points)


@pytest.mark.slow
@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_size_of_the_model_does_not_matter(body, scale):
    plain = design(body, [5, 150, 300], order="shortest").curves[0]
    scaled = nicmm.Mesh(scale * body.vertices, body.faces)
    other = design(scaled, [5, 150, 300], order="shortest").curves[0]
    size = np.linalg.norm(np.ptp(body.vertices, axis=0))
    assert len(other.points) == len(plain.points)
    np.testing.assert_allclose(other.points / scale, plain.points, rtol=0, atol=1e-4 * size)
