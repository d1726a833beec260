"""What the ninth input channel, φ_fea, gives the paper's method where there are maps."""

from __future__ import annotations

import zlib
from collections.abc import Iterator

import numpy as np

import nicmm_core as nicmm
from nicmm_core.geometry.surface_points import locate_control_points
from nicmm_core.level_set.losses import LossWeights, balanced
from nicmm_core.level_set.problem import build_problem
from nicmm_core.maps.guidance import BASELINE
from nicmm_core.network.forward_pass import NetworkWeights
from nicmm_core.network.trainable_network import build_network
from nicmm_core.network.training_maps import random_maps
from nicmm_core.network.weights_file import shipped_weights

from . import collections, report
from .samples import random_sets
from .scale import Scale
from .solving import Sample, least_losses_figure, run_networks

SEED = 17
ITERATIONS = 50
CHANNEL = 8

SEEN, NEUTRAL, WITHOUT = "with φ_fea", "the same, φ_fea neutral", "trained without maps"


def run(scale: Scale) -> None:
    """Predict sets with maps by networks that see φ_fea and by those that do not."""
    with_maps, without = shipped_weights(CHANNEL + 1), shipped_weights(CHANNEL)
    networks = {
        SEEN: build_network(with_maps),
        NEUTRAL: build_network(blind(with_maps)),
        WITHOUT: build_network(_padded(without)),
    }
    runs = run_networks(networks, _samples(scale), ITERATIONS)
    figure = least_losses_figure(runs, "The ninth channel, φ_fea", "ninth_channel", scale)
    best = runs[SEEN].least_losses
    rows = []
    for label, one in runs.items():
        losses = one.least_losses
        worse = "–" if label == SEEN else f"{np.mean(losses[:, -1] > best[:, -1]):.0%}"
        means = [f"{losses[:, place].mean():.4f}" for place in (0, 10, ITERATIONS)]
        rows.append((label, *means, worse))
    header = (
        "network", "loss at the start", "after 10 iterations", f"after {ITERATIONS}",
        "higher than with φ_fea",
    )  # fmt: skip
    body = (
        f"{len(best)} sets on {collections.label(scale)} (seed {SEED}), 3–5 random vertices, "
        "shortest order, each with one to three random obstacles or lanes. The energy of Eq. 2 "
        "with Eq. 7, means, least so far. The network with nine channels was pretrained on sets "
        "with maps; in the second row it is shown the neutral value everywhere, in the third "
        "stands the network that ships for curves without maps.\n\n"
        f"{report.table(header, rows)}\n\n{figure}"
    )
    report.write_section("ninth_channel", "The ninth channel (section 3.3)", body, scale)


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


def blind(weights: NetworkWeights) -> NetworkWeights:
    """The same network, to which φ_fea is neutral everywhere."""
    parameters = dict(weights.parameters)
    stem = parameters["stem.weight"].copy()
    parameters["stem.bias"] = parameters["stem.bias"] + BASELINE * stem[:, CHANNEL]
    stem[:, CHANNEL] = 0.0
    parameters["stem.weight"] = stem
    return NetworkWeights(weights.config, parameters)


def _padded(weights: NetworkWeights) -> NetworkWeights:
    """A network without the channel as one that has it and does not look."""
    stem = weights.parameters["stem.weight"]
    wider = {"stem.weight": np.pad(stem, ((0, 0), (0, CHANNEL + 1 - stem.shape[1])))}
    return NetworkWeights(weights.config, {**weights.parameters, **wider})
