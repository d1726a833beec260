"""Parts of the method one by one: problems of random points, pretraining, losses, curves."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import torch

import nicmm_core as nicmm
from nicmm_core.geometry.array_types import FloatArray, IntArray
from nicmm_core.geometry.curve import SurfaceCurve
from nicmm_core.geometry.mesh import Mesh
from nicmm_core.geometry.surface_points import locate_control_points
from nicmm_core.level_set.contour import extract_curves
from nicmm_core.level_set.losses import LossWeights, balanced
from nicmm_core.level_set.problem import Problem, build_problem
from nicmm_core.level_set.zero_set import zero_set
from nicmm_core.network.finetuning import FinetuningConfig, finetune
from nicmm_core.network.forward_pass import NetworkConfig
from nicmm_core.network.pretraining import PretrainingConfig, pretrain
from nicmm_core.network.trainable_network import CurveNetwork, load_network
from nicmm_core.path.band_refinement import PIECES
from tests.oracles.distances import distances

from .evidence import Results
from .measures import diagonal
from .samples import random_sets

PARTS_WITHOUT = ("coarsening", "courses", "outputs", "relaxation", "repair", "splines")
"""Rooms of the core of which nothing here uses anything, for the `WITHOUT` of a measurement."""

DIGITS = 6
"""Significant ones that results keep."""

FREQUENCY = 4.0
"""Of a random field: standard deviation of its wave numbers, in 1/√area."""

HARMONICS = 20


@dataclass(frozen=True)
class Sample:
    """A problem with random control points.

    Attributes
    ----------
    name : str
        Of the mesh.
    mesh : Mesh
    points : (k,) int array
        Vertices that are the control points.
    problem : Problem
    weights : LossWeights
        Those that a design takes for this problem.
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
    pieces: int = PIECES,
) -> Iterator[Sample]:
    """Problems of `random_sets`; a set without a simple path is named and skipped."""
    for name, mesh, points in random_sets(meshes, per_mesh, seed):
        located = locate_control_points(mesh, points, closed)
        try:
            problem = build_problem(mesh, located, order, closed=closed, pieces=pieces)
        except nicmm.UnreachableError as error:
            print(f"  {name}: {error}", flush=True)
            continue
        yield Sample(name, mesh, points, problem, balanced(LossWeights(), problem))


def untrained(config: NetworkConfig | None = None, seed: int = 0) -> CurveNetwork:
    """The network as pretraining starts with it."""
    torch.manual_seed(seed)
    return CurveNetwork(config or NetworkConfig())


@dataclass(frozen=True)
class Trained:
    """A network after pretraining.

    Attributes
    ----------
    network : CurveNetwork
    losses : list of float
        Mean loss of every epoch.
    preparing_seconds, training_seconds : float
        For initial loops, distances and features of all sets, and for the steps themselves.
    """

    network: CurveNetwork
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


def without_early_stop(iterations: int) -> FinetuningConfig:
    """Settings that stop after a number of steps of the optimiser and never before."""
    # The loss is taken before each step, so the last one needs a further evaluation.
    return FinetuningConfig(iterations=iterations + 1, fluctuation=-np.inf, threshold=-np.inf)


def run_networks(
    networks: Mapping[str, CurveNetwork], samples: Iterable[Sample], iterations: int
) -> Results:
    """Predict every sample with every network, in turn, so that a busy machine slows all alike.

    Returns
    -------
    Results
        By network: for each sample its mesh, the seconds of all fine-tuning, and the least loss
        before the first step and after the last one; for all samples together the mean of the least
        loss so far, by iteration.
    """
    meshes: list[str] = []
    losses: dict[str, list[FloatArray]] = {label: [] for label in networks}
    seconds: dict[str, list[float]] = {label: [] for label in networks}
    for sample in samples:
        meshes.append(sample.name)
        for label, network in networks.items():
            started = time.perf_counter()
            finetuned = finetune(
                network, sample.problem, sample.weights, without_early_stop(iterations)
            )
            seconds[label].append(time.perf_counter() - started)
            losses[label].append(_least_so_far(finetuned.losses, iterations + 1))
        last = ", ".join(
            f"{label} {of_network[-1][-1]:.3f}" for label, of_network in losses.items()
        )
        print(f"  {sample.name}: {last}", flush=True)
    if not meshes:
        raise SystemExit("No set had a simple loop through its points; there is nothing to measure")
    return {label: _run(meshes, np.array(losses[label]), seconds[label]) for label in networks}


def _run(meshes: list[str], least_losses: FloatArray, seconds: list[float]) -> Results:
    """What results keep of (samples, iterations + 1) losses: all of them would be too many."""
    return {
        "meshes": meshes,
        "seconds": [significant(value) for value in seconds],
        "first_losses": [significant(value) for value in least_losses[:, 0]],
        "last_losses": [significant(value) for value in least_losses[:, -1]],
        "mean_losses": [significant(value) for value in least_losses.mean(axis=0)],
    }


def significant(value: float, digits: int = DIGITS) -> float | None:
    """A number with so many digits; None if it is not finite."""
    return float(f"{value:.{digits}g}") if np.isfinite(value) else None


def _least_so_far(losses: list[float], length: int) -> FloatArray:
    """Running minimum; after a divergence it stays, as the field that is returned does."""
    least = np.fmin.accumulate(np.array(losses))
    return np.pad(least, (0, length - len(least)), mode="edge")


def level_set(sample: Sample, field: FloatArray) -> list[SurfaceCurve]:
    """The zero level set of φ as it is, zero at the control points."""
    problem = sample.problem
    return extract_curves(
        sample.mesh,
        problem.working,
        problem.smoother.interpolating(field),
        problem.loop.control_vertices,
        problem.bundle,
    )


def designed_curve(sample: Sample, field: FloatArray) -> tuple[SurfaceCurve, bool]:
    """The curve that a design makes of φ, and whether it was one curve by itself."""
    zeros = zero_set(sample.mesh, sample.problem, field)
    return zeros.curves[0], not zeros.breaking_vertices


def random_field(problem: Problem, seed: int) -> FloatArray:
    """A sum of waves in space with random directions, lengths and phases, of mean slope 1."""
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
    """Mean and greatest distance of two curves in percent of the bounding box's diagonal."""
    mean, greatest = distances(first, second)
    return 100 * mean / diagonal(sample.mesh), 100 * greatest / diagonal(sample.mesh)
