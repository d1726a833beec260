"""Runs single parts of the method for the benchmarks.

It builds problems from random control points, pretrains networks, records losses and extracts
curves.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import nicmm_core as nicmm
from nicmm_core.geometry.array_types import FloatArray, IntArray
from nicmm_core.geometry.curve import SurfaceCurve
from nicmm_core.geometry.mesh import Mesh
from nicmm_core.geometry.surface_points import locate_control_points
from nicmm_core.paper.contour import extract_curves
from nicmm_core.paper.fitting import CONVERGENCE, fit
from nicmm_core.paper.level_set_solver import SolverConfig
from nicmm_core.paper.losses import LossWeights, balanced
from nicmm_core.paper.network import Network, NetworkConfig
from nicmm_core.paper.pretraining import PretrainingConfig, pretrain
from nicmm_core.paper.problem import Problem, build_problem
from nicmm_core.paper.weights_file import load_network
from nicmm_core.paper.zero_set import zero_set
from tests.oracles.distances import distances

from .evidence import Results
from .measures import diagonal
from .samples import random_sets

DIGITS = 6
"""Significant digits that are kept in results."""

FREQUENCY = 4.0
"""Standard deviation of the wave numbers of a random field, in 1/√area."""

HARMONICS = 20


@dataclass(frozen=True)
class Sample:
    """A problem with random control points.

    Attributes
    ----------
    name : str
        Name of the mesh.
    mesh : Mesh
        Input mesh.
    points : (k,) int array
        Vertices that serve as control points.
    problem : Problem
        Discretised problem.
    weights : LossWeights
        Weights that a design uses for this problem.
    """

    name: str
    mesh: Mesh
    points: IntArray
    problem: Problem
    weights: LossWeights


def random_samples(
    meshes: Iterable[tuple[str, Mesh]],
    per_mesh: int,
    seed: int,
    order: str = "shortest",
    closed: bool = True,
) -> Iterator[Sample]:
    """Problems for the point sets of `random_sets`.

    A set without a simple path through its points is reported and skipped.
    """
    for name, mesh, points in random_sets(meshes, per_mesh, seed):
        located = locate_control_points(mesh, points, closed)
        try:
            problem = build_problem(mesh, located, order, closed=closed)
        except nicmm.UnreachableError as error:
            print(f"  {name}: {error}", flush=True)
            continue
        yield Sample(name, mesh, points, problem, balanced(LossWeights(), problem))


@dataclass(frozen=True)
class Trained:
    """A network after pretraining.

    Attributes
    ----------
    network : Network
        Pretrained network.
    losses : list of float
        Mean loss of every epoch.
    preparing_seconds : float
        Time for the initial loops, distances and features of all sets.
    training_seconds : float
        Time for the optimiser steps.
    """

    network: Network
    losses: list[float]
    preparing_seconds: float
    training_seconds: float


def train(
    mesh: Mesh,
    sets: int,
    epochs: int,
    seed: int,
    network_config: NetworkConfig | None = None,
) -> Trained:
    """Pretrain a network on random sets of one mesh."""
    started = prepared = time.perf_counter()

    def watch(stage: str, done: int, total: int, loss: float) -> None:
        nonlocal prepared
        if stage == "preparing":
            prepared = time.perf_counter()

    with TemporaryDirectory() as folder:
        output = Path(folder) / "weights.npz"
        config = PretrainingConfig(
            sets=sets, open_share=0.0, given_share=0.0, epochs=epochs, seed=seed
        )
        losses = pretrain([mesh], output, network_config, config, progress=watch)
        finished = time.perf_counter()
        network = load_network(output)
    print(
        f"  pretrained {sets} sets, {epochs} epochs: {finished - started:.0f} s, "
        f"loss {losses[0]:.3g} to {losses[-1]:.3g}",
        flush=True,
    )
    return Trained(network, losses, prepared - started, finished - prepared)


def without_early_stop(steps: int) -> SolverConfig:
    """Settings that stop after the given number of steps, or where no step lowers the energy."""
    # The loss is evaluated before each step, so the loss after the last step needs one more.
    return replace(CONVERGENCE, iterations=steps + 1, patience=steps + 1)


def run_networks(
    networks: Mapping[str, Network], samples: Iterable[Sample], iterations: int
) -> Results:
    """Fit every network to every sample.

    The networks take turns on each sample, so that other load on the machine slows all alike.

    Parameters
    ----------
    networks : mapping of str to Network
        Networks to compare, by label.
    samples : iterable of Sample
        Problems to solve.
    iterations : int
        Number of Gauss–Newton steps per sample.

    Returns
    -------
    Results
        By network. For each sample: its mesh, the duration of the fit in seconds, the loss
        before the first step and the lowest loss up to the last one. Over all samples: the mean
        of the lowest loss so far, by iteration.
    """
    meshes: list[str] = []
    losses: dict[str, list[FloatArray]] = {label: [] for label in networks}
    seconds: dict[str, list[float]] = {label: [] for label in networks}
    for sample in samples:
        meshes.append(sample.name)
        for label, network in networks.items():
            started = time.perf_counter()
            config = without_early_stop(iterations)
            fitted = fit(network, sample.problem, sample.weights, config)
            seconds[label].append(time.perf_counter() - started)
            losses[label].append(_least_so_far(fitted.losses, iterations + 1))
        last = ", ".join(
            f"{label} {of_network[-1][-1]:.3f}" for label, of_network in losses.items()
        )
        print(f"  {sample.name}: {last}", flush=True)
    if not meshes:
        raise SystemExit("No set had a simple loop through its points; there is nothing to measure")
    return {label: _run(meshes, np.array(losses[label]), seconds[label]) for label in networks}


def _run(meshes: list[str], least_losses: FloatArray, seconds: list[float]) -> Results:
    """Summary of one network's losses, (samples, iterations + 1), which are too many to keep."""
    return {
        "meshes": meshes,
        "seconds": [significant(value) for value in seconds],
        "first_losses": [significant(value) for value in least_losses[:, 0]],
        "last_losses": [significant(value) for value in least_losses[:, -1]],
        "mean_losses": [significant(value) for value in least_losses.mean(axis=0)],
    }


def significant(value: float, digits: int = DIGITS) -> float | None:
    """Number rounded to a number of significant digits; None if it is not finite."""
    return float(f"{value:.{digits}g}") if np.isfinite(value) else None


def _least_so_far(losses: list[float], length: int) -> FloatArray:
    """Running minimum of the losses, padded to a length.

    After the solver has ended it is constant, as is the field that is returned.
    """
    least = np.fmin.accumulate(np.array(losses))
    return np.pad(least, (0, length - len(least)), mode="edge")


def unrepaired_curves(sample: Sample, field: FloatArray) -> list[SurfaceCurve]:
    """Zero level set of φ, which is made zero at the control points; no topology is repaired."""
    problem = sample.problem
    return extract_curves(
        sample.mesh,
        problem.working,
        problem.smoother.interpolating(field),
        problem.loop.control_vertices,
        problem.bundle,
    )


def designed_curve(sample: Sample, field: FloatArray) -> SurfaceCurve:
    """Curve that a design extracts from the φ of a solver."""
    return zero_set(sample.mesh, sample.problem, field)[0]


def random_field(problem: Problem, seed: int) -> FloatArray:
    """Sum of plane waves with random directions, lengths and phases, scaled to mean slope 1."""
    generator = np.random.default_rng(seed)
    positions = problem.features[:, :3]
    waves = generator.normal(scale=FREQUENCY, size=(3, HARMONICS))
    phases = generator.uniform(0.0, 2 * np.pi, HARMONICS)
    field = np.sin(positions @ waves + phases).sum(axis=1)
    if problem.bundle is not None:
        field = field * problem.bundle.side
    slope = np.linalg.norm((problem.elements.gradient @ field).reshape(3, -1), axis=0)
    return field / slope.mean()


def relative_distances(
    sample: Sample, first: SurfaceCurve, second: SurfaceCurve
) -> tuple[float, float]:
    """Mean and greatest distance of two curves, in percent of the bounding box diagonal."""
    mean, greatest = distances(first, second)
    return 100 * mean / diagonal(sample.mesh), 100 * greatest / diagonal(sample.mesh)
