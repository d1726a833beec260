"""Ablation study of the modules of the network and of its input features (Table 3, Table 4)."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from nicmm_core.geometry.curve import is_one_curve
from nicmm_core.geometry.mesh import Mesh
from nicmm_core.paper.fitting import CONVERGENCE, fit
from nicmm_core.paper.network import Network, NetworkConfig, level_set, network_input
from nicmm_core.status import Status

from . import collections, plots, report
from .evidence import NETWORK, Results
from .scale import Scale
from .solving import (
    Sample,
    random_samples,
    run_networks,
    significant,
    train,
    unrepaired_curves,
)

TITLE = "Ablation (Table 3, Table 4)"
TIMED = True
ROOMS = NETWORK

SEED = 11
TEST_SEED = 12
FEATURE_SEED = 13
ITERATIONS = 20

FULL = "NICMM"

MODULES = {
    FULL: NetworkConfig(),
    "w/o ECA": NetworkConfig(attention=False),
    "w/o Light GLU": NetworkConfig(gating=False),
    "w/o both": NetworkConfig(attention=False, gating=False),
}

PAPER_MODULES = {
    FULL: (391, 8.84),
    "w/o ECA": (290, 13.34),
    "w/o Light GLU": (301, 14.89),
    "w/o both": (262, 19.54),
}
"""Milliseconds and loss of Table 3."""

ALL_FEATURES = "all features"

FEATURES = {
    ALL_FEATURES: NetworkConfig(),
    "w/o normals": NetworkConfig(normals=False),
    "w/o φ_p": NetworkConfig(control_indicator=False),
    "w/o φ₀": NetworkConfig(distance=False),
}

PAPER_FEATURES = {ALL_FEATURES: 32.0, "w/o normals": 35.4, "w/o φ_p": 75.4, "w/o φ₀": 77.2}
"""Average iterations of Table 4."""


def measure(scale: Scale) -> Results:
    """Pretrain all variants alike on one mesh and fit them to other sets of that mesh."""
    name, mesh = next(iter(collections.surfaces(scale, 1)))
    sets, epochs = scale.choose(100, 6, 2), scale.choose(10, 2)
    networks, seconds = _pretrained({**MODULES, **FEATURES}, mesh, sets, epochs)
    runs = run_networks(
        {label: networks[label] for label in MODULES},
        random_samples([(name, mesh)], scale.choose(40, 2), TEST_SEED),
        ITERATIONS,
    )
    cap = scale.choose(CONVERGENCE.iterations, 40, 12)
    stops = _early_stops(
        {label: networks[label] for label in FEATURES}, name, mesh, scale.choose(10, 1), cap
    )
    return {
        "collection": collections.label(scale),
        "mesh": name,
        "vertices": len(mesh.vertices),
        "pretraining": {"seed": SEED, "sets": sets, "epochs": epochs, "seconds": seconds},
        "modules": {"seed": TEST_SEED, "iterations": ITERATIONS, "runs": runs},
        "features": {"seed": FEATURE_SEED, "cap": cap, "stops": stops},
    }


def section(results: Results) -> str:
    """Both tables, and whether they agree with the paper."""
    pretraining, modules, features = (
        results[part] for part in ("pretraining", "modules", "features")
    )
    seconds, runs, stops = pretraining["seconds"].values(), modules["runs"], features["stops"]
    return (
        "Variants of the network, each without a module (Table 3) or without an input feature "
        "(Table 4), were pretrained alike and compared on other sets of control points of the same "
        f"mesh. The mesh is {results['mesh']} ({results['collection']}; {results['vertices']} "
        f"vertices), and pretraining uses {pretraining['sets']} sets (seed "
        f"{pretraining['seed']}) and {pretraining['epochs']} epochs for every variant. That takes "
        f"{min(seconds):.0f} to {max(seconds):.0f} s on one core; the paper pretrains for 30 "
        "minutes (Table 3) and 2 minutes (Table 4) on an RTX 4090, which was not repeated. A set "
        "has 3–5 random vertices in the shortest order.\n\n"
        "### Modules (Table 3)\n\nEach row is a network without some of its modules, and each "
        "measured value stands beside that of the paper. Time is that of "
        f"{modules['iterations']} iterations of the fit, which are Gauss–Newton steps here and 50 "
        "steps of AdamW in the paper, and loss the lowest one up to then, both averaged over "
        f"{len(runs[FULL]['seconds'])} sets (seed {modules['seed']}); relative values are divided "
        "by those of the full network. Only relative values can be compared, since machines and "
        "units differ.\n\n"
        f"{_module_table(runs)}\n\n{_module_findings(runs)}\n\n"
        f"{report.figure('ablation.png', plots.LEAST_LOSSES)}\n\n"
        "### Input features (Table 4)\n\nEach row is a network without one of its input "
        "features, and the main value is the average number of iterations up to the early stop, "
        f"over {len(stops[ALL_FEATURES])} sets (seed {features['seed']}).\n\n"
        f"{_feature_table(stops, features['cap'])}\n\n"
        f"{_feature_findings(stops)}"
    )


def draw(results: Results, folder: Path) -> None:
    """Plot the losses of the networks with and without their modules."""
    plots.least_losses(
        {label: run["mean_losses"] for label, run in results["modules"]["runs"].items()},
        "Networks with and without their modules (Table 3)",
        folder / "ablation.png",
    )


def _pretrained(
    configs: Mapping[str, NetworkConfig], mesh: Mesh, sets: int, epochs: int
) -> tuple[dict[str, Network], dict[str, float]]:
    """Network of each variant, and its training time in seconds; equal variants share a network."""
    networks: dict[str, Network] = {}
    seconds: dict[str, float] = {}
    for label, config in configs.items():
        same = next((k for k in networks if configs[k] == config), None)
        if same is not None:
            networks[label], seconds[label] = networks[same], seconds[same]
            continue
        trained = train(mesh, sets, epochs, SEED, config)
        networks[label] = trained.network
        seconds[label] = round(trained.training_seconds, 2)
    return networks, seconds


def _module_table(runs: Mapping[str, Results]) -> str:
    rows: list[tuple[object, ...]] = []
    for label, one in runs.items():
        milliseconds, loss = PAPER_MODULES[label]
        rows.append(
            (
                label,
                f"{1000 * np.mean(one['seconds']):.0f}",
                milliseconds,
                f"{_time_ratio(runs, label):.2f}",
                f"{milliseconds / PAPER_MODULES[FULL][0]:.2f}",
                f"{np.mean(one['last_losses']):.4f}",
                f"{loss:.2f}",
                f"{_loss_ratio(runs, label):.2f}",
                f"{loss / PAPER_MODULES[FULL][1]:.2f}",
            )
        )
    header = (
        "network", "time (ms)", "paper: time (ms)", "relative time", "paper: relative time",
        "loss", "paper: loss", "relative loss", "paper: relative loss",
    )  # fmt: skip
    return report.table(header, rows)


def _time_ratio(runs: Mapping[str, Results], label: str) -> float:
    return float(np.mean(runs[label]["seconds"]) / np.mean(runs[FULL]["seconds"]))


def _loss_ratio(runs: Mapping[str, Results], label: str) -> float:
    return float(np.mean(runs[label]["last_losses"]) / np.mean(runs[FULL]["last_losses"]))


def _module_findings(runs: Mapping[str, Results]) -> str:
    """What the table of modules shows, in words, and whether it agrees with Table 3."""
    text = ""
    for label in runs:
        if label == FULL:
            continue
        loss, paper = _loss_ratio(runs, label), PAPER_MODULES[label][1] / PAPER_MODULES[FULL][1]
        higher = np.greater(runs[label]["last_losses"], runs[FULL]["last_losses"])
        text += (
            f"{label[0].upper()}{label[1:]}, the loss is {report.verdict(loss, paper)} "
            f"({loss:.2f} times that of the full network; paper: {paper:.2f}; higher on "
            f"{100 * higher.mean():.0f} % of the sets). "
        )
    faster = all(_time_ratio(runs, label) < 1.0 for label in runs if label != FULL)
    text += (
        "Each module costs time, which agrees with the paper. "
        if faster
        else "Not every network without a module is faster, which contradicts the paper. "
    )
    return text + "Each variant was pretrained only once, so small differences may be chance."


def _early_stops(
    networks: Mapping[str, Network], name: str, mesh: Mesh, count: int, cap: int
) -> dict[str, list[Results]]:
    """How the fit ends on each set, by network."""
    stops: dict[str, list[Results]] = {label: [] for label in networks}
    for sample in random_samples([(name, mesh)], count, FEATURE_SEED):
        started = time.perf_counter()
        for label, network in networks.items():
            stops[label].append(_stop(network, sample, cap))
        counts = ", ".join(f"{label} {ends[-1]['iterations']}" for label, ends in stops.items())
        print(f"  {name}: {counts}, {time.perf_counter() - started:.0f} s", flush=True)
    if not stops[ALL_FEATURES]:
        raise SystemExit("No set had a simple loop through its points; there is nothing to measure")
    return stops


def _stop(network: Network, sample: Sample, cap: int) -> Results:
    """How the fit to one set ends.

    "early" says whether the early stop ended it, and not the cap on iterations; "one_loop" whether
    the level set of the network before the fit is one closed loop through all points.
    """
    predicted = level_set(network, network_input(sample.problem, network.config))
    config = replace(CONVERGENCE, iterations=cap)
    fitted = fit(network, sample.problem, sample.weights, config)
    return {
        "iterations": fitted.iterations,
        "loss": significant(min(fitted.losses)),
        "early": fitted.status == Status.CONVERGED,
        "one_loop": bool(is_one_curve(unrepaired_curves(sample, predicted.astype(float)))),
    }


def _feature_table(stops: Mapping[str, Sequence[Results]], cap: int) -> str:
    rows = [
        (
            label,
            f"{_iterations(ends):.1f}",
            f"{PAPER_FEATURES[label]:.1f}",
            sum(not end["early"] for end in ends),
            f"{np.mean([end['loss'] for end in ends]):.4f}",
            f"{sum(end['one_loop'] for end in ends)} of {len(ends)}",
        )
        for label, ends in stops.items()
    ]
    header = (
        "features", "average iterations", "paper: average iterations",
        f"sets stopped by the cap of {cap} iterations", "final loss",
        "level sets that are one loop through all points before the fit",
    )  # fmt: skip
    return report.table(header, rows)


def _iterations(ends: Sequence[Results]) -> float:
    return float(np.mean([end["iterations"] for end in ends]))


def _feature_findings(stops: Mapping[str, Sequence[Results]]) -> str:
    """What the table of features shows, in words, and whether it agrees with Table 4."""
    full = _iterations(stops[ALL_FEATURES])
    text = ""
    for label, ends in stops.items():
        if label == ALL_FEATURES:
            continue
        ratio, paper = (
            _iterations(ends) / full,
            PAPER_FEATURES[label] / PAPER_FEATURES[ALL_FEATURES],
        )
        text += (
            f"{label[0].upper()}{label[1:]}, the number of iterations is "
            f"{report.verdict(ratio, paper)} ({ratio:.2f} times that with all features; paper: "
            f"{paper:.2f}). "
        )
    losses = {label: float(np.mean([end["loss"] for end in ends])) for label, ends in stops.items()}
    if losses[ALL_FEATURES] == min(losses.values()):
        text += (
            "Fewer iterations do not mean a better result: the early stop fires when the energy "
            "hardly decreases, whatever its value, and the final loss is lowest with all "
            "features. "
        )
    without = stops["w/o φ₀"]
    loops = sum(end["one_loop"] for end in without)
    text += (
        "A removed channel is zero in pretraining as well. Without φ₀, the output of the network "
        "is not added to φ₀ either, so nothing determines how the points are joined or which side "
        f"is inside: {loops} of {len(without)} level sets are one loop through the points before "
        "the fit. "
    )
    if loops < len(without):
        text += (
            "The fit makes the level set follow φ₀ where it must for one loop, and keeps it one "
            "loop. So φ₀ enters that row as the start, if not as a feature. The paper does not say "
            "how its curves without φ₀ get their topology. "
        )
    return text.strip()
