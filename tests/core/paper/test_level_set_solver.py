"""Tests the solver of both methods: its steps, when it stops, and that the curve stays one."""

import numpy as np
import pytest

from nicmm_core.geometry.surface_points import locate_control_points
from nicmm_core.paper import fitting, level_set_solver, variational
from nicmm_core.paper.level_set_solver import SolverConfig, minimise
from nicmm_core.paper.losses import LossWeights, balanced, energy_of
from nicmm_core.paper.narrow_band import build_narrow_band, evaluate
from nicmm_core.paper.problem import build_problem
from nicmm_core.paper.topology import breaking_vertices
from nicmm_core.paper.variational import VertexSteps
from nicmm_core.paper.vertex_links import VertexLinks
from nicmm_core.paper.weights_file import load_network
from nicmm_core.status import Status

WEIGHTS = LossWeights()
FEW = SolverConfig(iterations=4)


@pytest.fixture(scope="module")
def problem(ball):
    points = locate_control_points(ball, [3, 200, 400, 600], closed=True)
    return build_problem(ball, points, "shortest")


def run(problem, steps=None, config=FEW, weights=WEIGHTS, watch=None):
    steps = VertexSteps() if steps is None else steps
    return minimise(problem, problem.initial_distance, steps, weights, config, watch)


def band_energy(problem, field, config=FEW):
    """The loss of a field, as the solver computes it."""
    band = build_narrow_band(problem, field, config.half_width * problem.edge_length)
    return evaluate(band, WEIGHTS, field[band.unknowns]).energy


def assert_isotopic_to_the_start(problem, field):
    """Vertices can be flipped one by one from the signs of φ₀ to those of the field."""
    links = VertexLinks(problem.working, problem.bundle)
    controls = problem.loop.control_vertices
    assert (field[controls] == 0.0).all()
    assert not len(breaking_vertices(links, problem.initial_distance, field, controls))


class OtherSteps(VertexSteps):
    """Steps of the vertices, changed in a way; `calls` has what the solver asked for."""

    def __init__(self, change=lambda step: step):
        self.change, self.calls = change, []

    def linearise(self, band, hessian, gradient, beside):
        super().linearise(band, hessian, gradient, beside)
        self.beside = beside
        self.calls.append("linearise")

    def solve(self, damping, held):
        self._step = self.change(super().solve(damping, held))
        self.calls.append("solve")
        return self._step.copy()

    def take(self, scale):
        self.taken = super().take(scale)
        self.calls.append("take")
        return self.taken

    def keep(self):
        self.calls.append("keep")


class BreakingSteps(OtherSteps):
    """Steps that reverse the sign of one vertex away from the curve unless it is held."""

    def __init__(self, problem):
        super().__init__()
        self.problem = problem

    def linearise(self, band, hessian, gradient, beside):
        super().linearise(band, hessian, gradient, beside)
        self.place = int(np.argmax(self.problem.initial_distance[band.unknowns]))
        self.vertex = band.unknowns[self.place]

    def solve(self, damping, held):
        self.held = held.copy()
        return super().solve(damping, held)

    def take(self, scale):
        taken = super().take(scale)
        if not self.held[self.place]:
            taken[self.place] = -10.0 * self.problem.edge_length
        return taken


def test_vertex_that_would_break_the_curve_is_held(problem):
    steps = BreakingSteps(problem)
    result = run(problem, steps, SolverConfig(iterations=3))
    kept = steps.calls.count("keep")
    assert kept == 2  # the loss after the last iteration needs no further step
    assert steps.held[steps.place] and steps.held.sum() == 1
    assert result.losses[-1] < result.losses[0]
    assert problem.initial_distance[steps.vertex] > 0.0 and result.field[steps.vertex] > 0.0
    assert result.held == kept
    assert_isotopic_to_the_start(problem, result.field)


def test_vertex_that_is_held_no_more_keeps_its_sign(problem, monkeypatch):
    """Even if the step is accepted: here any step is."""
    monkeypatch.setattr(level_set_solver, "LEAST_GAIN", -np.inf)
    monkeypatch.setattr(level_set_solver, "_has_stalled", lambda *_: False)
    fields = []
    steps = BreakingSteps(problem)
    config = SolverConfig(iterations=2, holds=0)
    monkeypatch.setattr(
        level_set_solver, "redistanced", recorded(level_set_solver.redistanced, fields)
    )
    result = run(problem, steps, config)
    assert steps.calls.count("keep") == 1 and not steps.held.any()
    assert result.held == 1
    assert len(fields) == 3
    for field in fields:
        assert_isotopic_to_the_start(problem, field)


def recorded(redistanced, fields):
    """The function with a list of the fields that it is given."""

    def record(surface, field, *rest, **named):
        fields.append(field)
        return redistanced(surface, field, *rest, **named)

    return record


def test_no_vertex_is_held_where_none_would_break_the_curve(problem):
    steps = OtherSteps()
    result = run(problem, steps)
    assert result.held == 0
    assert steps.calls.count("keep") == steps.calls.count("linearise") == FEW.iterations - 1


@pytest.mark.parametrize("change", [np.zeros_like, np.negative], ids=["no step", "uphill"])
def test_without_a_step_downhill_the_start_is_returned(problem, change):
    steps = OtherSteps(change)
    result = run(problem, steps)
    assert (result.status, result.iterations) == (Status.CONVERGED, 1)
    assert "keep" not in steps.calls
    near = np.abs(problem.distance) < problem.edge_length
    np.testing.assert_array_equal(
        np.sign(result.field[near]), np.sign(problem.initial_distance[near])
    )


@pytest.mark.slow
def test_rejected_steps_are_not_kept_and_are_damped_more(problem):
    """The steps promise a decrease, but what they take raises the energy."""
    dampings = []

    class Deceiving(OtherSteps):
        def solve(self, damping, held):
            dampings.append(damping)
            return super().solve(damping, held)

        def take(self, scale):
            return -super().take(scale)

    steps = Deceiving()
    result = run(problem, steps)
    assert (result.status, result.iterations) == (Status.CONVERGED, 1)
    assert "keep" not in steps.calls
    assert len(dampings) == FEW.trials
    np.testing.assert_allclose(np.divide(dampings[1:], dampings[:-1]), 4.0)


@pytest.mark.parametrize("limit", [0.5, 1.5])
def test_long_steps_are_shortened_to_the_limit(problem, limit):
    """Beside the curve; short steps are taken as they are."""
    config = SolverConfig(iterations=2, trials=1, halvings=0, longest_move=limit)
    for factor, expected in ((100.0, limit * problem.edge_length), (1e-4, None)):
        steps = OtherSteps(lambda step, factor=factor: factor * step)
        run(problem, steps, config)
        farthest = np.abs(steps.taken[steps.beside]).max()
        assert farthest == pytest.approx(expected or np.abs(steps._step[steps.beside]).max())


def test_stops_at_the_limit(problem):
    for iterations in (1, 3):
        result = run(problem, config=SolverConfig(iterations=iterations))
        assert (result.status, result.iterations) == (Status.ITERATION_LIMIT, iterations)


@pytest.mark.slow
def test_stops_when_the_loss_has_not_fallen_for_the_patience(problem):
    """With a tolerance that every decrease satisfies, it stops at the first opportunity."""
    for patience in (1, 3):
        for loose in ({"tolerance": 1e9}, {"relative_tolerance": 1e9}):
            config = SolverConfig(patience=patience, **{"tolerance": -1.0, **loose})
            result = run(problem, config=config)
            assert (result.status, result.iterations) == (Status.CONVERGED, patience + 1)


@pytest.mark.slow
def test_settles_at_the_least_loss_and_never_rises_again(problem):
    """The steps lower the energy as they should, but the signed distance may raise it."""
    config = SolverConfig(iterations=30, patience=30, tolerance=-1.0)
    free = run(problem, config=config).losses
    assert np.diff(free).max() > 0.0
    for settling in (1, 3):
        settled = SolverConfig(**{**vars(config), "settling": settling, "tolerance": 1e9})
        losses = run(problem, config=settled).losses
        assert losses[: settling + 1] == free[: settling + 1]
        after = [min(losses[: settling + 1]), *losses[settling + 1 :]]
        assert np.diff(after).max() <= 0.0
        assert after[-1] < after[0]


def test_the_field_is_that_of_the_least_loss(problem):
    result = run(problem)
    assert min(result.losses) < result.losses[0]
    assert band_energy(problem, result.field) == pytest.approx(min(result.losses), rel=0.02)
    assert result.terms == energy_of(problem, result.field)


def test_an_energy_that_is_nan_diverges_to_the_start(problem):
    result = run(problem, weights=LossWeights(smooth=float("nan")))
    assert (result.status, result.iterations) == (Status.DIVERGED, 1)
    assert_isotopic_to_the_start(problem, result.field)
    assert all(np.isfinite(value) for value in result.terms.values())
    near = np.abs(problem.distance) < 2.0 * problem.edge_length
    difference = np.abs(result.field - problem.initial_distance)[near]
    assert difference.max() < problem.edge_length


def test_watch_cancels_and_sees_the_best_field(problem):
    seen = []

    def watch(fraction, field):
        seen.append((fraction, band_energy(problem, field)))
        return len(seen) < 4

    result = run(problem, config=SolverConfig(iterations=20), watch=watch)
    assert (result.status, result.iterations) == (Status.CANCELLED, 4)
    fractions, losses = zip(*seen, strict=True)
    assert fractions == pytest.approx([0.05, 0.1, 0.15, 0.2])
    best = np.minimum.accumulate(result.losses)
    np.testing.assert_allclose(losses, best, rtol=1e-12)


def test_start_and_problem_are_not_changed(problem):
    before = problem.initial_distance.copy()
    run(problem)
    np.testing.assert_array_equal(problem.initial_distance, before)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["nicmm", "variational"])
@pytest.mark.parametrize("closed", [True, False])
def test_result_is_isotopic_to_the_start(body, method, closed):
    """On a body with thin limbs, for several sets of points."""
    config = SolverConfig(iterations=12)
    for seed in range(2):
        chosen = np.random.default_rng(seed).choice(len(body.vertices), 4, replace=False)
        points = locate_control_points(body, chosen, closed=closed)
        problem = build_problem(body, points, "shortest", closed=closed)
        weights = balanced(WEIGHTS, problem)
        if method == "nicmm":
            result = fitting.fit(load_network(), problem, weights, config)
        else:
            result = variational.solve(problem, weights, config)
        assert min(result.losses) < result.losses[0]
        assert_isotopic_to_the_start(problem, result.field)
