"""Measures the effect of pretraining on one mesh for curves on other meshes (Table 2)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from nicmm_core.paper.network import initial_network
from nicmm_core.paper.weights_file import load_network

from . import collections, plots, report
from .evidence import NETWORK, Results
from .scale import Scale
from .solving import random_samples, run_networks, train

TITLE = "Pretraining on one mesh, test on others (Table 2)"
ROOMS = NETWORK

SEED = 9
TEST_SEED = 10
ITERATIONS = 20

UNTRAINED, ONE_MESH, SHIPPED = "no pretraining", "pretrained on one mesh", "shipped weights"

PAPER = {UNTRAINED: 15.298, ONE_MESH: 10.996}
"""Average loss, Table 2; the paper pretrains for 30 minutes."""


def measure(scale: Scale) -> Results:
    """Pretrain on one mesh and fit the network to sets of other meshes."""
    sets, epochs = scale.choose(100, 10, 4), scale.choose(16, 3, 2)
    others = scale.choose(20, 2, 1)
    (name, mesh), *rest = collections.surfaces(scale, others + 1)
    trained = train(mesh, sets, epochs, SEED)
    networks = {UNTRAINED: initial_network(), ONE_MESH: trained.network, SHIPPED: load_network()}
    samples = random_samples(rest, scale.choose(10, 1), TEST_SEED)
    return {
        "collection": collections.label(scale),
        "mesh": name,
        "others": [label for label, _ in rest],
        "seed": SEED,
        "test_seed": TEST_SEED,
        "sets": sets,
        "epochs": epochs,
        "training_seconds": round(trained.training_seconds, 2),
        "iterations": ITERATIONS,
        "runs": run_networks(networks, samples, ITERATIONS),
    }


def section(results: Results) -> str:
    """The loss of each network, and whether pretraining helps as in the paper."""
    runs, others = results["runs"], results["others"]
    return (
        "A network was pretrained on one mesh and then fitted to sets of points on other meshes, "
        "as in Table 2 of the paper. Each row is a network. Its losses are the lowest loss so far, "
        "averaged over the test sets, at the start of the fit and after "
        f"{results['iterations']} Gauss–Newton steps (paper: 50 steps of AdamW); the relative loss "
        "divides the last one by that without pretraining. Only this ratio can be compared with "
        f"the paper, whose losses have other units. Pretraining on {results['mesh']} took "
        f"{results['sets']} sets (seed "
        f"{results['seed']}) and {results['epochs']} epochs; the test has "
        f"{len(runs[UNTRAINED]['seconds'])} sets (seed {results['test_seed']}) on {len(others)} "
        "other meshes. A set has 3–5 random vertices in the shortest order. Other meshes "
        f"({results['collection']}): {report.listed(others)}.\n\n"
        f"{_table(results)}\n\n{_findings(runs)}\n\n"
        f"{report.figure('transfer.png', plots.LEAST_LOSSES)}"
    )


def summary(results: Results) -> str:
    """What the documents say of it."""
    runs, iterations = results["runs"], results["iterations"]
    names = {
        UNTRAINED: "before training, which returns φ₀",
        ONE_MESH: f"pretrained on one mesh ({results['training_seconds']:.0f} s)",
        SHIPPED: "`nicmm.npz`",
    }
    rows = [
        (name, f"{runs[label]['mean_losses'][0]:.3f}", f"{np.mean(runs[label]['last_losses']):.3f}")
        for label, name in names.items()
    ]
    header = ("network", "start of the fit", f"after {iterations} iterations")
    return report.table(header, rows)


def draw(results: Results, folder: Path) -> None:
    """Plot the losses against the iteration."""
    plots.least_losses(
        {label: run["mean_losses"] for label, run in results["runs"].items()},
        "Loss on other meshes (Table 2)",
        folder / "transfer.png",
    )


def _table(results: Results) -> str:
    rows: list[tuple[object, ...]] = []
    runs = results["runs"]
    reference = runs[UNTRAINED]["last_losses"]
    for label, run in runs.items():
        losses = run["last_losses"]
        better = "–" if label == UNTRAINED else f"{100 * np.less(losses, reference).mean():.0f} %"
        relative = np.mean(losses) / np.mean(reference)
        duration = f"{results['training_seconds']:.0f} s" if label == ONE_MESH else "–"
        means = (f"{np.mean(run['first_losses']):.3f}", f"{np.mean(losses):.3f}")
        rows.append((label, duration, *means, f"{relative:.2f}", better))
    for label, loss in PAPER.items():
        duration = "30 min" if label == ONE_MESH else "–"
        relative = loss / PAPER[UNTRAINED]
        rows.append((f"paper, {label}", duration, "", f"{loss:.3f}", f"{relative:.2f}", ""))
    header = (
        "network", "time of pretraining", "initial loss",
        f"after {results['iterations']} iterations", "relative to no pretraining",
        "sets with a lower loss than without pretraining",
    )  # fmt: skip
    return report.table(header, rows)


def _findings(runs: Mapping[str, Results]) -> str:
    """What the table shows, in words, and whether it agrees with the paper."""
    means = {label: float(np.mean(run["last_losses"])) for label, run in runs.items()}
    share = {label: mean / means[UNTRAINED] for label, mean in means.items()}
    paper = PAPER[ONE_MESH] / PAPER[UNTRAINED]
    text = (
        "After pretraining on one mesh, the loss on other meshes is "
        f"{report.verdict(share[ONE_MESH], paper)} ({share[ONE_MESH]:.2f} of that without "
        f"pretraining; paper: {paper:.2f}). With the shipped weights, which were pretrained for "
        f"longer and on generated shapes, it is {share[SHIPPED]:.2f} of that. "
    )
    if means[ONE_MESH] < means[SHIPPED]:
        worse = np.greater(runs[SHIPPED]["last_losses"], runs[ONE_MESH]["last_losses"]).mean()
        text += (
            f"On {100 * worse:.0f} % of the sets they end with a higher loss than the network that "
            "was pretrained on one mesh. "
        )
    return text + (
        "The paper pretrains for 30 minutes on an RTX 4090; here pretraining ran for less time "
        "and on one core."
    )
