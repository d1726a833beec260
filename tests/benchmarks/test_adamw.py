"""Tests stage 2 by AdamW: never worse than the start, and stopped by the right rule."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from benchmarks.adamw import (
    AdamWConfig,
    fit_by_adamw,
    loss_terms,
    narrow_band_energy,
    smoothness_density,
)
from nicmm_core import shapes
from nicmm_core.geometry.curve import is_one_curve
from nicmm_core.geometry.surface_points import locate_control_points
from nicmm_core.paper.losses import LossWeights, total_loss
from nicmm_core.paper.network import NetworkConfig, initial_network
from nicmm_core.paper.problem import build_problem
from nicmm_core.paper.tensors import surface_tensors
from nicmm_core.paper.weights_file import load_network
from nicmm_core.paper.zero_set import zero_set
from nicmm_core.status import Status

pytestmark = pytest.mark.slow

CPU = torch.device("cpu")
WEIGHTS = LossWeights()
NEVER = {"fluctuation": -1.0, "threshold": -1.0}
"""Settings with which only the cap stops the training."""


@pytest.fixture(scope="module")
def ball():
    return shapes.sphere(2)


@pytest.fixture(scope="module")
def problem(ball):
    points = locate_control_points(ball, [3, 60, 100, 140], closed=True)
    return build_problem(ball, points, "shortest")


@pytest.fixture(scope="module")
def network():
    return load_network()


def loss_of(problem, field):
    phi = torch.as_tensor(field, dtype=torch.float32)
    return total_loss(loss_terms(surface_tensors(problem, CPU), phi), WEIGHTS).item()


def run(network, problem, watch=None, weights=WEIGHTS, **settings):
    return fit_by_adamw(network, problem, weights, AdamWConfig(**settings), watch)


@pytest.mark.parametrize("iterations", [1, 2, 20])
def test_loss_never_exceeds_that_of_the_start(network, problem, iterations):
    start = run(network, problem, iterations=1)
    result = run(network, problem, iterations=iterations, **NEVER)
    assert min(result.losses) <= start.losses[0] * (1 + 1e-6)
    assert loss_of(problem, result.field) <= loss_of(problem, start.field) * (1 + 1e-6)


def test_iterations_lower_the_loss_of_an_untrained_network(problem):
    untrained = initial_network(NetworkConfig(width=16, depth=1))
    result = run(untrained, problem, iterations=40, **NEVER)
    assert loss_of(problem, result.field) < 0.98 * loss_of(problem, problem.initial_distance)


def test_zero_set_is_one_curve_through_the_points_and_terms_are_of_its_field(
    ball, network, problem
):
    result = run(network, problem, iterations=10)
    assert (result.field[problem.loop.control_vertices] == 0.0).all()
    assert is_one_curve(zero_set(ball, problem, result.field))
    assert total_loss(result.terms, WEIGHTS) == pytest.approx(loss_of(problem, result.field))


def test_topology_of_a_wrong_field_is_repaired_and_counted(ball, problem):
    """Without φ₀ the output of an untrained network has nothing to do with the initial loop."""
    blind = initial_network(NetworkConfig(width=16, depth=1, distance=False))
    result = run(blind, problem, iterations=1)
    assert result.held > 0
    assert is_one_curve(zero_set(ball, problem, result.field))


def test_stops_when_the_energy_has_been_still_for_the_patience(network, problem):
    """With a fluctuation that every energy satisfies, it stops at the first opportunity."""
    for patience, least, expected in ((3, 1, 3), (7, 1, 7), (3, 12, 12)):
        result = run(
            network,
            problem,
            patience=patience,
            least_iterations=least,
            fluctuation=1e9,
            threshold=-1.0,
        )
        assert (result.status, result.iterations) == (Status.CONVERGED, expected)


def test_stops_at_once_when_the_energy_is_low_enough(network, problem):
    result = run(network, problem, fluctuation=-1.0, threshold=1e9)
    assert (result.status, result.iterations) == (Status.CONVERGED, 1)


def test_stops_at_the_cap(network, problem):
    result = run(network, problem, iterations=4, **NEVER)
    assert (result.status, result.iterations) == (Status.ITERATION_LIMIT, 4)


def test_watch_cancels_and_sees_the_best_field(network, problem):
    seen = []

    def watch(fraction, field):
        seen.append((fraction, loss_of(problem, field)))
        return len(seen) < 6

    result = run(network, problem, watch, iterations=50, **NEVER)
    assert (result.status, result.iterations) == (Status.CANCELLED, 6)
    fractions, losses = zip(*seen, strict=True)
    assert all(a < b for a, b in zip(fractions, fractions[1:], strict=False))
    assert all(b <= a * (1 + 1e-6) for a, b in zip(losses, losses[1:], strict=False))
    assert min(result.losses) == pytest.approx(losses[-1])


def test_an_energy_without_value_diverges_to_the_initial_field(network, problem):
    result = run(network, problem, weights=LossWeights(smooth=float("nan")))
    assert result.status == Status.DIVERGED
    np.testing.assert_allclose(result.field, problem.initial_distance, rtol=0, atol=1e-12)


def test_network_given_is_not_changed(network, problem):
    before = {name: value.copy() for name, value in network.parameters.items()}
    run(network, problem, iterations=5, **NEVER)
    for name, value in network.parameters.items():
        np.testing.assert_array_equal(value, before[name])


def test_repetition_gives_identical_numbers(network, problem):
    first, second = (run(network, problem, iterations=15) for _ in range(2))
    np.testing.assert_array_equal(first.field, second.field)
    assert (first.iterations, first.terms) == (second.iterations, second.terms)


def test_smoothness_of_a_scaled_distance_grows_with_the_square_of_the_scale(problem):
    """Eq. 6 is quadratic in φ where the Gaussian does not change; Eq. 5 is not."""
    surface = surface_tensors(problem, CPU)
    phi = torch.as_tensor(problem.initial_distance, dtype=torch.float32)
    wide = replace(surface, delta_width=1e3)
    once, twice = (smoothness_density(wide, factor * phi).sum().item() for factor in (1.0, 2.0))
    assert once > 0.0
    assert twice == pytest.approx(4.0 * once, rel=1e-4)


def test_band_energy_of_a_distance_sees_the_band_only(problem):
    """Changes far from the zero set do not affect it."""
    surface = surface_tensors(problem, CPU)
    phi = torch.as_tensor(problem.initial_distance, dtype=torch.float32)
    far = phi.abs() > 0.5 * phi.max()
    assert far.any()
    changed = torch.where(far, 3.0 * phi, phi)
    energies = [
        narrow_band_energy(surface, field, WEIGHTS, problem.edge_length) for field in (phi, changed)
    ]
    assert energies[0] > 0.0
    assert energies[1] == pytest.approx(energies[0], rel=1e-6)
