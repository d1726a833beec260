"""Measures what the ninth input channel, φ_fea, contributes to `nicmm` on sets with maps."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

import nicmm_core as nicmm
from nicmm_core.geometry.surface_points import locate_control_points
from nicmm_core.maps.guidance import BASELINE
from nicmm_core.paper.losses import LossWeights, balanced
from nicmm_core.paper.network import Network
from nicmm_core.paper.problem import build_problem
from nicmm_core.paper.training_maps import random_maps
from nicmm_core.paper.weights_file import load_network, shipped_network

from . import collections, plots, report
from .evidence import NETWORK, Results
from .samples import random_sets
from .scale import Scale
from .solving import Sample, run_networks

TITLE = "The ninth input channel, φ_fea (section 3.3)"
ROOMS = NETWORK

SEED = 17
ITERATIONS = 20
ALSO_AFTER = 5
"""Earlier iteration that is shown as well."""

CHANNEL = 8

SEEN, NEUTRAL, WITHOUT_MAPS = "with φ_fea", "the same, φ_fea neutral", "trained without maps"


def measure(scale: Scale) -> Results:
    """Fit networks with and without φ_fea to sets with maps."""
    with_maps = shipped_network(CHANNEL + 1)
    networks = {
        SEEN: with_maps,
        NEUTRAL: blind(with_maps),
        WITHOUT_MAPS: load_network(channels=CHANNEL + 1),  # its weights of φ_fea are zero
    }
    return {
        "seed": SEED,
        "collection": collections.label(scale),
        "iterations": ITERATIONS,
        "runs": run_networks(networks, _samples(scale), ITERATIONS),
    }


def section(results: Results) -> str:
    """The losses of each network."""
    runs, iterations = results["runs"], results["iterations"]
    best = runs[SEEN]["last_losses"]
    rows = []
    for label, run in runs.items():
        worse = np.greater(run["last_losses"], best).mean()
        means = [f"{run['mean_losses'][place]:.4f}" for place in (0, ALSO_AFTER, iterations)]
        rows.append((label, *means, "–" if label == SEEN else f"{100 * worse:.0f} %"))
    header = (
        "network", "initial loss", f"after {ALSO_AFTER} iterations",
        f"after {iterations} iterations", "sets with a higher final loss than with φ_fea",
    )  # fmt: skip
    last = {label: run["mean_losses"][iterations] for label, run in runs.items()}
    return (
        "Three networks were fitted as in `nicmm` to sets with maps, to see what the "
        f"input channel φ_fea contributes. There are {len(best)} sets on {results['collection']} "
        f"(seed {results['seed']}), each of 3–5 random vertices in the shortest order with one to "
        "three random obstacles or lanes. The first row is the network with nine channels, which "
        "was pretrained on sets with maps; in the second row the same network gets the neutral "
        "value of φ_fea everywhere; the third row is the network that is shipped for curves "
        "without maps. The loss is the energy of Eq. 2 including Eq. 7 in the band around the "
        f"curve, lowest so far, averaged over the sets.\n\n{report.table(header, rows)}\n\n"
        f"After {iterations} iterations the mean loss with φ_fea is "
        f"{last[SEEN] / last[NEUTRAL]:.2f} times that with the neutral value and "
        f"{last[SEEN] / last[WITHOUT_MAPS]:.2f} times that of the network trained without maps. "
        "The paper introduces the channel in section 3.3 but does not measure its effect.\n\n"
        f"{report.figure('ninth_channel.png', plots.LEAST_LOSSES)}"
    )


def summary(results: Results) -> str:
    """What the documents say of it."""
    runs, iterations = results["runs"], results["iterations"]
    names = {
        SEEN: "`nicmm-maps.npz`",
        NEUTRAL: "the same with a neutral φ_fea everywhere",
        WITHOUT_MAPS: "`nicmm.npz`, trained without maps",
    }
    means = {
        label: np.array(run["mean_losses"])[[0, ALSO_AFTER, iterations]]
        for label, run in runs.items()
    }
    rows = [(names[label], *(f"{mean:.3f}" for mean in means[label])) for label in runs]
    seen, neutral = means[SEEN], means[NEUTRAL]
    other = means[WITHOUT_MAPS]
    text = (
        "Compared with a network trained without maps, the mean energy is "
        f"{seen[0] / other[0]:.2f} times as high at the start of the fit, and "
        f"{seen[2] / other[2]:.2f} times after {iterations} iterations. The channel itself "
        "contributes little: with the neutral value everywhere the energies are "
        f"{neutral[0] / seen[0]:.2f} and {neutral[2] / seen[2]:.2f} times as high. A network that "
        "processes one vertex at a time learns the average effect of maps on the energy, and the "
        "local information of φ_fea is already in φ₀, whose path runs around obstacles and along "
        "lanes."
    )
    header = (
        "network",
        "start of the fit",
        f"after {ALSO_AFTER} iterations",
        f"after {iterations}",
    )
    return f"{report.table(header, rows)}\n\n{report.paragraph(text)}"


def draw(results: Results, folder: Path) -> None:
    """Plot the losses against the iteration."""
    plots.least_losses(
        {label: run["mean_losses"] for label, run in results["runs"].items()},
        "The ninth channel, φ_fea",
        folder / "ninth_channel.png",
    )


def _samples(scale: Scale) -> Iterator[Sample]:
    meshes = collections.surfaces(scale, scale.choose(12, 4, 1))
    for name, mesh, points in random_sets(meshes, 1, SEED):
        generator = np.random.default_rng([SEED, zlib.crc32(name.encode())])
        obstacles, alignment = random_maps(mesh, points, generator)
        located = locate_control_points(mesh, points, closed=True)
        try:
            problem = build_problem(mesh, located, "shortest", obstacles, alignment)
        except nicmm.UnreachableError as error:
            print(f"  {name}: {error}", flush=True)
            continue
        yield Sample(name, mesh, points, problem, balanced(LossWeights(), problem))


def blind(network: Network) -> Network:
    """Network that computes what the given one computes for a neutral φ_fea everywhere."""
    weight, bias = network.parameters["stem.weight"].copy(), network.parameters["stem.bias"]
    bias = bias + BASELINE * weight[:, CHANNEL]
    weight[:, CHANNEL] = 0.0
    return replace(
        network, parameters=network.parameters | {"stem.weight": weight, "stem.bias": bias}
    )
