"""Tests stage 2, fine-tuning: never worse than the start, and stopped by the right rule."""

import numpy as np
import pytest
import torch

from nicmm_core.geometry.surface_points import locate_control_points
from nicmm_core.paper.finetuning import FinetuningConfig, finetune, narrow_band_energy
from nicmm_core.paper.losses import LossWeights, loss_terms, total_loss
from nicmm_core.paper.network import CurveNetwork, NetworkConfig
from nicmm_core.paper.problem import build_problem
from nicmm_core.paper.tensors import surface_tensors
from nicmm_core.paper.weights_file import load_network
from nicmm_core.status import Status

CPU = torch.device("cpu")
WEIGHTS = LossWeights()
NEVER = {"fluctuation": -1.0, "threshold": -1.0}
"""Settings with which only the cap stops fine-tuning."""


@pytest.fixture(scope="module")
def problem(small_ball):
    points = locate_control_points(small_ball, [3, 60, 100, 140], closed=True)
    return build_problem(small_ball, points, "shortest")


@pytest.fixture(scope="module")
def network():
    return load_network()


def loss_of(problem, field):
    phi = torch.as_tensor(field, dtype=torch.float32)
    return total_loss(loss_terms(surface_tensors(problem, CPU), phi), WEIGHTS).item()


def run(network, problem, watch=None, weights=WEIGHTS, **settings):
    return finetune(network, problem, weights, FinetuningConfig(**settings), watch)


@pytest.mark.slow
@pytest.mark.parametrize("iterations", [1, 2, 5, 20])
def test_loss_never_exceeds_that_of_the_start(network, problem, iterations):
    start = run(network, problem, iterations=1)
    result = run(network, problem, iterations=iterations, **NEVER)
    assert loss_of(problem, result.field) <= loss_of(problem, start.field) * (1 + 1e-6)


@pytest.mark.slow
def test_iterations_lower_the_loss_of_an_untrained_network(problem):
    torch.manual_seed(0)
    untrained = CurveNetwork(NetworkConfig(width=16, depth=1))
    result = run(untrained, problem, iterations=40, **NEVER)
    assert loss_of(problem, result.field) < 0.98 * loss_of(problem, problem.initial_distance)


@pytest.mark.slow
def test_terms_are_those_of_the_field_returned(network, problem):
    result = run(network, problem, iterations=10)
    surface = surface_tensors(problem, CPU)
    expected = loss_terms(surface, torch.as_tensor(result.field, dtype=torch.float32))
    assert set(result.terms) == {"sdf", "int", "smooth", "fea"}
    for name, value in expected.items():
        assert result.terms[name] == pytest.approx(value.item(), rel=1e-5, abs=1e-9)


@pytest.mark.slow
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


@pytest.mark.slow
def test_looser_fluctuation_stops_no_later(network, problem):
    counts = [
        run(network, problem, fluctuation=fluctuation, threshold=-1.0).iterations
        for fluctuation in (0.3, 0.03)
    ]
    assert counts[0] <= counts[1]


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
    assert 0.0 <= fractions[0] and fractions[-1] <= 1.0
    assert all(b <= a * (1 + 1e-6) for a, b in zip(losses, losses[1:], strict=False))
    assert loss_of(problem, result.field) == pytest.approx(losses[-1])


def test_an_energy_without_value_diverges_to_the_initial_field(network, problem):
    result = run(network, problem, weights=LossWeights(smooth=float("nan")))
    assert result.status == Status.DIVERGED
    np.testing.assert_array_equal(result.field, problem.initial_distance)
    assert set(result.terms) == {"sdf", "int", "smooth", "fea"}


def test_network_given_is_not_changed(network, problem):
    before = {name: value.clone() for name, value in network.state_dict().items()}
    run(network, problem, iterations=5, **NEVER)
    for name, value in network.state_dict().items():
        assert torch.equal(value, before[name])


def test_repetition_gives_identical_numbers(network, problem):
    first, second = (run(network, problem, iterations=15) for _ in range(2))
    np.testing.assert_array_equal(first.field, second.field)
    assert (first.iterations, first.terms) == (second.iterations, second.terms)


def test_number_of_threads_does_not_matter_and_stays(network, problem):
    before = torch.get_num_threads()
    try:
        fields = []
        for threads in (1, 2):
            torch.set_num_threads(threads)
            fields.append(run(network, problem, iterations=15).field)
            assert torch.get_num_threads() == threads
    finally:
        torch.set_num_threads(before)
    np.testing.assert_allclose(fields[0], fields[1], rtol=0, atol=1e-4)


def test_random_state_of_the_caller_does_not_matter_and_stays(network, problem):
    fields = []
    for seed in (1, 2):
        torch.manual_seed(seed)
        np.random.seed(seed)
        state = torch.get_rng_state(), np.random.get_state()[1].copy()
        fields.append(run(network, problem, iterations=5).field)
        assert torch.equal(torch.get_rng_state(), state[0])
        np.testing.assert_array_equal(np.random.get_state()[1], state[1])
    np.testing.assert_array_equal(*fields)


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
