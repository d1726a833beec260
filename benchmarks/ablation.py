"""What the network's modules and input features are worth (Table 3, Table 4)."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from nicmm_core.geometry.curve import is_one_curve
from nicmm_core.geometry.mesh import Mesh
from nicmm_core.network.finetuning import FinetuningConfig, finetune
from nicmm_core.network.forward_pass import NetworkConfig
from nicmm_core.network.trainable_network import CurveNetwork
from nicmm_core.status import Status

from . import collections, plots, report
from .evidence import Results
from .scale import Scale
from .solving import (
    PARTS_WITHOUT,
    Sample,
    level_set,
    random_samples,
    run_networks,
    significant,
    train,
)

TITLE = "Ablation (Table 3, Table 4)"
TIMED = True
WITHOUT = PARTS_WITHOUT

SEED = 11
TEST_SEED = 12
FEATURE_SEED = 13
ITERATIONS = 50

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

LOSS_WITHOUT_CURVE = 0.5
"""Of φ = 0 on a surface of unit area, by Eq. 8."""

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
    """Pretrain every variant alike on one mesh and fine-tune for other sets of that mesh."""
    name, mesh = next(iter(collections.surfaces(scale, 1)))
    sets, epochs = scale.choose(100, 6, 4), scale.choose(10, 2)
    networks, seconds = _pretrained({**MODULES, **FEATURES}, mesh, sets, epochs)
    runs = run_networks(
        {label: networks[label] for label in MODULES},
        random_samples([(name, mesh)], scale.choose(40, 2), TEST_SEED),
        ITERATIONS,
    )
    cap = scale.choose(FinetuningConfig.iterations, 100, 40)
    stops = _early_stops(
        {label: networks[label] for label in FEATURES}, name, mesh, scale.choose(10, 1), cap
    )
    return {
        "collection": collections.label(scale),
        "mesh": name,
        "vertices": len(mesh.vertices),
        "pretraining": {"seed": SEED, "sets": sets, "epochs": epochs, "seconds": seconds},
        "modules": {"seed": TEST_SEED, "iterations": ITERATIONS, "runs": runs},
        "features": {
            "seed": FEATURE_SEED,
            "cap": cap,
            "least_iterations": FinetuningConfig.least_iterations,
            "stops": stops,
        },
    }


def section(results: Results) -> str:
    """Both tables, and whether they agree with the paper's."""
    pretraining, modules, features = (
        results[part] for part in ("pretraining", "modules", "features")
    )
    seconds, runs, stops = pretraining["seconds"].values(), modules["runs"], features["stops"]
    return (
        f"Mesh {results['mesh']} ({results['collection']}), {results['vertices']} vertices. Every "
        f"variant is pretrained on the same {pretraining['sets']} sets (seed "
        f"{pretraining['seed']}) × {pretraining['epochs']} epochs; that takes "
        f"{min(seconds):.0f} to {max(seconds):.0f} s on one core, where the "
        "paper has 30 minutes (Table 3) and 2 minutes (Table 4) on an RTX 4090, out of reach "
        "here. Sets have 3–5 random vertices, shortest order.\n\n"
        f"### Modules (Table 3)\n\n{len(runs[FULL]['seconds'])} sets (seed {modules['seed']}), "
        f"{modules['iterations']} iterations.\n\n{_module_table(runs)}\n\n"
        f"{_module_findings(runs)}\n\n"
        f"{report.figure('ablation.png', plots.LEAST_LOSSES)}\n\n"
        f"### Input features (Table 4)\n\n{len(stops[ALL_FEATURES])} sets (seed "
        f"{features['seed']}), with early stop.\n\n{_feature_table(stops, features['cap'])}\n\n"
        f"{_feature_findings(stops, features['least_iterations'])}"
    )


def draw(results: Results, folder: Path) -> None:
    """Draw the losses of the networks without their modules."""
    plots.least_losses(
        {label: run["mean_losses"] for label, run in results["modules"]["runs"].items()},
        "Networks without their modules (Table 3)",
        folder / "ablation.png",
    )


def _pretrained(
    configs: Mapping[str, NetworkConfig], mesh: Mesh, sets: int, epochs: int
) -> tuple[dict[str, CurveNetwork], dict[str, float]]:
    """A network for each variant, and the seconds of its training; equal variants share one."""
    networks: dict[str, CurveNetwork] = {}
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
        "network", "time (ms)", "paper", "relative", "paper", "loss", "paper", "relative", "paper",
    )  # fmt: skip
    return report.table(header, rows)


def _time_ratio(runs: Mapping[str, Results], label: str) -> float:
    return float(np.mean(runs[label]["seconds"]) / np.mean(runs[FULL]["seconds"]))


def _loss_ratio(runs: Mapping[str, Results], label: str) -> float:
    return float(np.mean(runs[label]["last_losses"]) / np.mean(runs[FULL]["last_losses"]))


def _module_findings(runs: Mapping[str, Results]) -> str:
    """What Table 3 says, in words."""
    text = ""
    for label in runs:
        if label == FULL:
            continue
        loss, paper = _loss_ratio(runs, label), PAPER_MODULES[label][1] / PAPER_MODULES[FULL][1]
        higher = np.greater(runs[label]["last_losses"], runs[FULL]["last_losses"])
        if loss < 1.0:
            verdict = "lower, which contradicts the paper"
        elif loss - 1.0 < 0.25 * (paper - 1.0):
            verdict = "hardly higher, which contradicts the paper's size of the effect"
        else:
            verdict = "higher, as in the paper"
        text += (
            f"{label[0].upper()}{label[1:]} the loss is {verdict} ({loss:.2f} against "
            f"{paper:.2f}; higher on {100 * higher.mean():.0f} % of the sets). "
        )
    faster = all(_time_ratio(runs, label) < 1.0 for label in runs if label != FULL)
    text += (
        "Each module costs time, as in the paper. "
        if faster
        else ("Not every variant without a module is faster, unlike in the paper. ")
    )
    return text + (
        "Times are of the prediction stage alone and on different machines; losses carry "
        "different units. Only ratios can be compared, and each variant is pretrained once, so "
        "small differences may be chance."
    )


def _early_stops(
    networks: Mapping[str, CurveNetwork], name: str, mesh: Mesh, count: int, cap: int
) -> dict[str, list[Results]]:
    """How fine-tuning ends, by network."""
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


def _stop(network: CurveNetwork, sample: Sample, cap: int) -> Results:
    """How fine-tuning for one set ends.

    It is early if the early stop ends it and not the cap, and one loop if the level set itself is
    one closed loop through all points.
    """
    config = FinetuningConfig(iterations=cap)
    finetuned = finetune(network, sample.problem, sample.weights, config)
    return {
        "iterations": finetuned.iterations,
        "loss": significant(min(finetuned.losses)),
        "early": finetuned.status == Status.CONVERGED,
        "one_loop": bool(is_one_curve(level_set(sample, finetuned.field))),
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
        "features", "average iterations", "paper", f"stopped at the cap of {cap}", "loss then",
        "level set one loop through all points",
    )  # fmt: skip
    return report.table(header, rows)


def _iterations(ends: Sequence[Results]) -> float:
    return float(np.mean([end["iterations"] for end in ends]))


def _feature_findings(stops: Mapping[str, Sequence[Results]], least_iterations: int) -> str:
    """What Table 4 says, in words."""
    full = _iterations(stops[ALL_FEATURES])
    text = ""
    for label, ends in stops.items():
        if label == ALL_FEATURES:
            continue
        ratio, paper = (
            _iterations(ends) / full,
            PAPER_FEATURES[label] / PAPER_FEATURES[ALL_FEATURES],
        )
        agrees = "as in the paper" if ratio > 1.0 else "which contradicts the paper"
        text += (
            f"{label[0].upper()}{label[1:]} it takes {ratio:.2f} times as many iterations, "
            f"{agrees} ({paper:.2f}). "
        )
    losses = {label: float(np.mean([end["loss"] for end in ends])) for label, ends in stops.items()}
    if losses[ALL_FEATURES] == min(losses.values()):
        text += (
            "Fewer iterations do not mean a better end: the early stop fires when the energy "
            "rests, at whatever value, and the loss then is least with all features. "
        )
    without = stops["w/o φ₀"]
    loops = sum(end["one_loop"] for end in without)
    text += (
        "A channel switched off is fed as zeros, in pretraining too. Without φ₀ the network's "
        "output is no longer added to it either, so nothing says how the points are joined or "
        f"which side is inside: {loops} of {len(without)} level sets are one loop through the "
        "points. "
    )
    if losses["w/o φ₀"] > 0.9 * LOSS_WITHOUT_CURVE:
        text += (
            f"Their loss, {losses['w/o φ₀']:.2f}, is that of φ = 0, no curve at all "
            f"({LOSS_WITHOUT_CURVE:g}). "
        )
    if loops < len(without):
        text += (
            "The early stop only sees that the energy rests, not whether there is a curve, so "
            "that row's iterations say little; the paper does not mention this. "
        )
    return text + f"The early stop does not count stillness before {least_iterations} iterations."
