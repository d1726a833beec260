"""What the network's modules and input features are worth (Table 3, Table 4)."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from nicmm_core.geometry.curve import is_one_curve
from nicmm_core.geometry.mesh import Mesh
from nicmm_core.network.finetuning import FinetuningConfig, finetune
from nicmm_core.network.forward_pass import NetworkConfig
from nicmm_core.network.trainable_network import CurveNetwork
from nicmm_core.status import Status

from . import collections, report
from .scale import Scale
from .solving import (
    Runs,
    least_losses_figure,
    level_set,
    random_samples,
    run_networks,
    train,
)

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


@dataclass(frozen=True)
class Stop:
    """How fine-tuning for one set ended.

    Attributes
    ----------
    iterations : int
    loss : float
    early : bool
        Whether the early stop ended it and not the cap.
    one_loop : bool
        Whether the level set as it is was one closed loop through all points.
    """

    iterations: int
    loss: float
    early: bool
    one_loop: bool


def run(scale: Scale) -> None:
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
    figure = least_losses_figure(
        runs, "Networks without their modules (Table 3)", "ablation", scale
    )
    body = (
        f"Mesh {name} ({collections.label(scale)}), {len(mesh.vertices)} vertices. Every variant "
        f"is pretrained on the same {sets} sets (seed {SEED}) × {epochs} epochs; that takes "
        f"{min(seconds.values()):.0f} to {max(seconds.values()):.0f} s on one core, where the "
        "paper has 30 minutes (Table 3) and 2 minutes (Table 4) on an RTX 4090, out of reach "
        "here. Sets have 3–5 random vertices, shortest order.\n\n"
        f"### Modules (Table 3)\n\n{len(runs[FULL].seconds)} sets (seed {TEST_SEED}), "
        f"{ITERATIONS} iterations.\n\n{_module_table(runs)}\n\n{_module_findings(runs)}\n\n"
        f"{figure}\n\n"
        f"### Input features (Table 4)\n\n{len(stops[ALL_FEATURES])} sets (seed {FEATURE_SEED}), "
        f"with early stop.\n\n{_feature_table(stops, cap)}\n\n{_feature_findings(stops)}"
    )
    report.write_section("ablation", "Ablation (Table 3, Table 4)", body, scale)


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
        networks[label], seconds[label] = trained.network, trained.training_seconds
    return networks, seconds


def _module_table(runs: Mapping[str, Runs]) -> str:
    rows: list[tuple[object, ...]] = []
    for label, one in runs.items():
        milliseconds, loss = PAPER_MODULES[label]
        rows.append(
            (
                label,
                f"{1000 * one.seconds.mean():.0f}",
                milliseconds,
                f"{_time_ratio(runs, label):.2f}",
                f"{milliseconds / PAPER_MODULES[FULL][0]:.2f}",
                f"{one.least_losses[:, -1].mean():.4f}",
                f"{loss:.2f}",
                f"{_loss_ratio(runs, label):.2f}",
                f"{loss / PAPER_MODULES[FULL][1]:.2f}",
            )
        )
    header = (
        "network", "time (ms)", "paper", "relative", "paper", "loss", "paper", "relative", "paper",
    )  # fmt: skip
    return report.table(header, rows)


def _time_ratio(runs: Mapping[str, Runs], label: str) -> float:
    return float(runs[label].seconds.mean() / runs[FULL].seconds.mean())


def _loss_ratio(runs: Mapping[str, Runs], label: str) -> float:
    return float(runs[label].least_losses[:, -1].mean() / runs[FULL].least_losses[:, -1].mean())


def _module_findings(runs: Mapping[str, Runs]) -> str:
    """What Table 3 says, in words."""
    text = ""
    for label in MODULES:
        if label == FULL:
            continue
        loss, paper = _loss_ratio(runs, label), PAPER_MODULES[label][1] / PAPER_MODULES[FULL][1]
        higher = runs[label].least_losses[:, -1] > runs[FULL].least_losses[:, -1]
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
    faster = all(_time_ratio(runs, label) < 1.0 for label in MODULES if label != FULL)
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
) -> dict[str, list[Stop]]:
    stops: dict[str, list[Stop]] = {label: [] for label in networks}
    config = FinetuningConfig(iterations=cap)
    for sample in random_samples([(name, mesh)], count, FEATURE_SEED):
        started = time.perf_counter()
        for label, network in networks.items():
            finetuned = finetune(network, sample.problem, sample.weights, config)
            stops[label].append(
                Stop(
                    iterations=finetuned.iterations,
                    loss=min(finetuned.losses),
                    early=finetuned.status == Status.CONVERGED,
                    one_loop=is_one_curve(level_set(sample, finetuned.field)),
                )
            )
        counts = ", ".join(f"{label} {stops[label][-1].iterations}" for label in networks)
        print(f"  {name}: {counts}, {time.perf_counter() - started:.0f} s", flush=True)
    if not stops[ALL_FEATURES]:
        raise SystemExit("No set had a simple loop through its points; there is nothing to measure")
    return stops


def _feature_table(stops: Mapping[str, Sequence[Stop]], cap: int) -> str:
    rows = [
        (
            label,
            f"{_iterations(ends):.1f}",
            f"{PAPER_FEATURES[label]:.1f}",
            sum(not end.early for end in ends),
            f"{np.mean([end.loss for end in ends]):.4f}",
            f"{sum(end.one_loop for end in ends)} of {len(ends)}",
        )
        for label, ends in stops.items()
    ]
    header = (
        "features", "average iterations", "paper", f"stopped at the cap of {cap}", "loss then",
        "level set one loop through all points",
    )  # fmt: skip
    return report.table(header, rows)


def _iterations(ends: Sequence[Stop]) -> float:
    return float(np.mean([end.iterations for end in ends]))


def _feature_findings(stops: Mapping[str, Sequence[Stop]]) -> str:
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
    losses = {label: float(np.mean([end.loss for end in ends])) for label, ends in stops.items()}
    if losses[ALL_FEATURES] == min(losses.values()):
        text += (
            "Fewer iterations do not mean a better end: the early stop fires when the energy "
            "rests, at whatever value, and the loss then is least with all features. "
        )
    without = stops["w/o φ₀"]
    loops = sum(end.one_loop for end in without)
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
    return text + (
        f"The early stop does not count stillness before {FinetuningConfig.least_iterations} "
        "iterations."
    )
