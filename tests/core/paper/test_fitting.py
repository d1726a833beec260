"""Tests stage 2, fitting: one curve, never worse than the start, and the same in every run."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core.geometry.distances import build_distance_surface
from nicmm_core.geometry.surface_points import locate_control_points
from nicmm_core.paper import fitting
from nicmm_core.paper.fitting import CONVERGENCE, NetworkSteps, fit
from nicmm_core.paper.level_set_solver import SolverConfig
from nicmm_core.paper.losses import LossWeights, balanced, energy_of, total_loss
from nicmm_core.paper.narrow_band import build_narrow_band, evaluate, gauss_newton_system
from nicmm_core.paper.network import (
    Network,
    NetworkConfig,
    initial_network,
    level_set,
    network_input,
    parameter_shapes,
)
from nicmm_core.paper.problem import build_problem
from nicmm_core.paper.redistancing import redistanced
from nicmm_core.paper.tangent_kernel import moved
from nicmm_core.paper.weights_file import load_network, shipped_network
from nicmm_core.paper.zero_set import is_simple_curve, zero_set
from nicmm_core.status import Status
from tests.core.checks import assert_valid_curve, circle
from tests.oracles.named_curves import nearest_vertices

WEIGHTS = LossWeights()
SMALL = NetworkConfig(width=12, depth=2, gate_rank=2)


@pytest.fixture(scope="module")
def problem(ball):
    points = locate_control_points(ball, [3, 200, 400, 600], closed=True)
    return build_problem(ball, points, "shortest")


@pytest.fixture(scope="module")
def network():
    return load_network()


def few(iterations):
    """Settings with which only the limit stops the solver."""
    return SolverConfig(iterations=iterations, tolerance=-1.0)


def loss_of(problem, field):
    """The whole energy of the zero set of a field, as a signed distance."""
    surface = build_distance_surface(problem.vertices, problem.working.faces, problem.edge_length)
    controls = problem.loop.control_vertices
    distance = redistanced(surface, field, controls, bundle=problem.bundle)
    return total_loss(energy_of(problem, distance), WEIGHTS)


def random_network(config=SMALL):
    """A network with random weights, also in the last layer."""
    generator = np.random.default_rng(1)
    shapes_of = parameter_shapes(config, 8)
    return Network(
        config,
        {k: generator.normal(0.0, 0.4, shape).astype(np.float32) for k, shape in shapes_of.items()},
    )


@pytest.mark.slow
@pytest.mark.parametrize("iterations", [1, 3, 12])
def test_never_worse_than_its_start(network, problem, iterations):
    start = fit(network, problem, WEIGHTS, few(1))
    result = fit(network, problem, WEIGHTS, few(iterations))
    assert min(result.losses) <= result.losses[0] == start.losses[0]
    assert loss_of(problem, result.field) <= loss_of(problem, start.field) * (1 + 1e-6)


def test_starts_from_the_level_set_of_the_network(network, problem):
    """It keeps the topology of φ₀ here, so the zero set is that of the network."""
    result = fit(network, problem, WEIGHTS, few(1))
    phi = level_set(network, network_input(problem, network.config))
    assert (np.sign(phi) != np.sign(problem.initial_distance)).any()
    off = np.abs(phi) > 1e-3 * problem.edge_length
    np.testing.assert_array_equal(np.sign(result.field[off]), np.sign(phi[off]))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["untrained", "random"])
def test_any_network_lowers_the_energy(problem, kind):
    network = initial_network(SMALL) if kind == "untrained" else random_network()
    result = fit(network, problem, WEIGHTS, few(8))
    assert min(result.losses) < 0.8 * result.losses[0]
    assert loss_of(problem, result.field) < 0.9 * loss_of(problem, problem.initial_distance)


@pytest.mark.slow
def test_network_given_is_not_changed(network, problem):
    before = {name: array.copy() for name, array in network.parameters.items()}
    fit(network, problem, WEIGHTS, few(3))
    assert network.parameters.keys() == before.keys()
    for name, array in network.parameters.items():
        np.testing.assert_array_equal(array, before[name])


@pytest.mark.slow
def test_repetition_gives_identical_arrays(network, problem):
    np.random.seed(1)
    state = np.random.get_state()[1].copy()
    first, second = (fit(network, problem, WEIGHTS, few(5)) for _ in range(2))
    np.testing.assert_array_equal(first.field, second.field)
    assert (first.losses, first.terms) == (second.losses, second.terms)
    np.testing.assert_array_equal(np.random.get_state()[1], state)


def test_watch_cancels(network, problem):
    seen = []

    def watch(fraction, field):
        seen.append((fraction, field.copy()))
        return len(seen) < 3

    result = fit(network, problem, WEIGHTS, few(10), watch)
    assert (result.status, result.iterations) == (Status.CANCELLED, 3)
    assert [fraction for fraction, _ in seen] == pytest.approx([0.1, 0.2, 0.3])
    shown = seen[-1][1]
    near = np.abs(shown) < problem.edge_length
    np.testing.assert_array_equal(np.sign(result.field[near]), np.sign(shown[near]))


def test_stops_at_the_limit(network, problem):
    result = fit(network, problem, WEIGHTS, few(2))
    assert (result.status, result.iterations) == (Status.ITERATION_LIMIT, 2)


@pytest.mark.slow
def test_stops_when_the_loss_hardly_falls(network, problem):
    losses, patience = fit(network, problem, WEIGHTS).losses, CONVERGENCE.patience
    settling, little = CONVERGENCE.settling, CONVERGENCE.relative_tolerance
    least = np.minimum.accumulate(losses)
    stalled = least[:-settling] - least[settling:] < little * least[settling:]
    least = least[settling + stalled.argmax() :]  # from then on, the iterations count
    assert stalled.any() and patience < len(least) and len(losses) < 100
    assert least[-1 - patience] - least[-1] < little * least[-1]
    if len(least) > patience + 1:
        assert least[-2 - patience] - least[-2] >= little * least[-2]


@pytest.mark.slow
def test_a_large_smoothness_is_fitted_in_double_precision(small_ball):
    """The kernel at the marks cancels almost entirely, so that single precision is not enough."""
    design = nicmm.design_curve(
        small_ball, [3, 60, 100, 140], order="shortest", method="nicmm", smoothness=1000.0
    )
    assert len(design.curves) == 1
    assert np.isfinite(design.curves[0].points).all()


def test_an_energy_that_is_nan_diverges(network, problem):
    result = fit(network, problem, LossWeights(smooth=float("nan")))
    assert (result.status, result.iterations) == (Status.DIVERGED, 1)
    np.testing.assert_array_equal(result.field, fit(network, problem, WEIGHTS, few(1)).field)
    assert all(np.isfinite(value) for value in result.terms.values())


def test_terms_are_those_of_the_field(network, problem):
    result = fit(network, problem, WEIGHTS, few(3))
    assert result.terms.keys() == {"sdf", "int", "smooth", "fea"}
    assert result.terms == energy_of(problem, result.field)


def assert_one_curve(mesh, problem, field, positions, closed):
    curves = zero_set(mesh, problem, field)
    assert is_simple_curve(mesh, curves, closed)
    assert_valid_curve(mesh, curves[0], positions, closed)
    return curves[0]


@pytest.mark.slow
@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize("guide", [None, "obstacles", "alignment"])
def test_result_is_one_curve_through_all_points(surface, closed, guide):
    points = np.random.default_rng(4).choice(len(surface.vertices), 4, replace=False)
    maps = {}
    if guide is not None:
        away = np.linalg.norm(surface.vertices[:, None] - surface.vertices[points], axis=2)
        maps[guide] = ((away.min(axis=1) > 0.1) & (surface.vertices[:, 0] > 0.2)).astype(float)
    located = locate_control_points(surface, points, closed=closed)
    problem = build_problem(surface, located, "shortest", closed=closed, **maps)
    fitted = fit(
        shipped_network(problem.features.shape[1]), problem, balanced(WEIGHTS, problem), few(4)
    )
    assert (fitted.terms["fea"] > 0.0) is (guide is not None)
    positions = surface.vertices[points][problem.loop.order]
    assert_one_curve(surface, problem, fitted.field, positions, closed)


@pytest.mark.slow
def test_meridian_of_a_torus(ring):
    """The loop bounds nothing, and its meridian is a geodesic."""
    angles = 2.0 * np.pi / 3.0 * np.arange(3)
    positions = [1.0 + 0.4 * np.cos(angles), 0 * angles, 0.4 * np.sin(angles)]
    chosen = nearest_vertices(ring, np.transpose(positions))
    problem = build_problem(ring, locate_control_points(ring, chosen, closed=True))
    assert problem.bundle is not None
    result = fit(shipped_network(8), problem, WEIGHTS)
    curve = assert_one_curve(ring, problem, result.field, ring.vertices[chosen], closed=True)
    assert np.abs(curve.points[:, 1]).max() < 0.05
    assert (curve.points[:, 0] > 0.5).all()


@pytest.mark.slow
@pytest.mark.parametrize("closed", [True, False])
def test_points_of_a_great_circle_give_a_great_circle(ball, network, closed):
    chosen = nearest_vertices(ball, circle([0.0, np.pi / 2, np.pi, 3 * np.pi / 2]))
    points = locate_control_points(ball, chosen, closed=closed)
    problem = build_problem(ball, points, closed=closed)
    result = fit(network, problem, WEIGHTS)
    curve = assert_one_curve(ball, problem, result.field, ball.vertices[chosen], closed)
    assert np.abs(curve.points[:, 2]).max() < 0.04
    assert result.terms["smooth"] < 0.05 * energy_of(problem, problem.initial_distance)["smooth"]


@pytest.fixture(scope="module")
def band(problem):
    return build_narrow_band(problem, problem.initial_distance, 4.0 * problem.edge_length)


class TestSteps:
    @pytest.fixture(params=[50, 10_000], ids=["few marks", "all marked"])
    def marks(self, request, monkeypatch):
        monkeypatch.setattr(fitting, "MARKS", request.param)
        return request.param

    @pytest.fixture
    def system(self, problem, band):
        values = problem.initial_distance[band.unknowns]
        hessian, gradient = gauss_newton_system(band, WEIGHTS, evaluate(band, WEIGHTS, values))
        beside = np.abs(values) < 2.0 * problem.edge_length
        return hessian, gradient, beside

    def steps(self, problem, band, system, network=None):
        network = network or random_network()
        steps = NetworkSteps(network, network_input(problem, network.config))
        steps.linearise(band, *system)
        return steps

    @pytest.mark.slow
    def test_small_steps_change_the_output_as_solved(self, problem, band, system, marks):
        steps = self.steps(problem, band, system)
        linear = steps.solve(1e-2, np.zeros(len(band.unknowns), dtype=bool))
        scale = 1e-2
        found = steps.take(scale) / scale
        assert np.abs(found - linear).max() < 0.03 * np.abs(linear).max()

    @pytest.mark.slow
    def test_step_is_downhill_and_shrinks_with_the_damping(self, problem, band, system, marks):
        hessian, gradient, _ = system
        steps = self.steps(problem, band, system)
        nothing = np.zeros(len(band.unknowns), dtype=bool)
        sizes = []
        for damping in (1e-4, 1.0, 1e4, 1e8):
            change = steps.solve(damping, nothing)
            assert gradient @ change + 0.5 * (change @ (hessian @ change)) < 0.0
            sizes.append(np.linalg.norm(change))
        assert sizes[-1] < 0.01 * sizes[0]

    @pytest.mark.slow
    def test_held_vertices_hardly_move(self, problem, band, system, marks):
        steps = self.steps(problem, band, system)
        held = np.zeros(len(band.unknowns), dtype=bool)
        free = np.abs(steps.solve(1e-2, held))
        held[np.argmax(free)] = True
        assert np.abs(steps.solve(1e-2, held))[held] < 0.05 * free[held]

    def test_next_steps_start_from_a_step_only_if_it_was_kept(self, problem, band, system):
        nothing = np.zeros(len(band.unknowns), dtype=bool)
        changes = []
        for kept in (False, True):
            steps = self.steps(problem, band, system)
            first = steps.solve(1e-2, nothing)
            steps.take(1.0)
            if kept:
                steps.keep()
            steps.linearise(band, *system)
            changes.append((first, steps.solve(1e-2, nothing)))
        (before, again), (first, after) = changes
        np.testing.assert_array_equal(before, first)
        scale = np.abs(before).max()
        assert np.abs(after - before).max() > 1e-2 * scale
        assert not np.array_equal(after, again)

    @pytest.mark.slow
    def test_step_is_the_change_of_the_networks_level_set(
        self, problem, band, system, marks, monkeypatch
    ):
        """Without attention, which steps hold, the two are the same."""
        taken = []
        monkeypatch.setattr(
            fitting, "moved", lambda *arguments: taken.append(moved(*arguments)) or taken[-1]
        )
        network = random_network(replace(SMALL, attention=False))
        steps = self.steps(problem, band, system, network)
        steps.solve(1e-2, np.zeros(len(band.unknowns), dtype=bool))
        change = steps.take(1.0)
        inputs = network_input(problem, network.config)
        before, after = (level_set(each, inputs) for each in (network, *taken))
        scale = np.abs(change).max()
        assert scale > 1e-3
        np.testing.assert_allclose(
            (after - before)[band.unknowns], change, rtol=0, atol=1e-3 * scale
        )


@pytest.mark.slow
def test_torch_is_not_imported():
    """In a process in which imports of torch fail; `test_design` tests whole designs."""
    code = (
        "import sys; sys.modules['torch'] = None; "
        "from nicmm_core.paper import fitting, level_set_design; "
        "print(len(level_set_design.shipped_network(8).parameters) > 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, "True\n"), done.stderr
