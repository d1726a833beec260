"""What pretraining on one mesh is worth on others (Table 2)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from nicmm_core.network.trainable_network import load_network

from . import collections, plots, report
from .evidence import Results
from .scale import Scale
from .solving import PARTS_WITHOUT, random_samples, run_networks, train, untrained

TITLE = "Pretraining for other meshes (Table 2)"
WITHOUT = PARTS_WITHOUT

SEED = 9
TEST_SEED = 10
ITERATIONS = 50

UNTRAINED, ONE_MESH, SHIPPED = "no pretraining", "pretrained on one mesh", "shipped weights"

PAPER = {UNTRAINED: 15.298, ONE_MESH: 10.996}
"""Average loss, Table 2; the pretraining took 30 minutes."""


def measure(scale: Scale) -> Results:
    """Pretrain on one mesh and fine-tune for sets of others."""
    sets, epochs = scale.choose(100, 10, 4), scale.choose(16, 3, 2)
    others = scale.choose(20, 2, 1)
    (name, mesh), *rest = collections.surfaces(scale, others + 1)
    trained = train(mesh, sets, epochs, SEED)
    networks = {UNTRAINED: untrained(), ONE_MESH: trained.network, SHIPPED: load_network()}
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
        f"Pretrained on {results['mesh']}: {results['sets']} sets (seed {results['seed']}) × "
        f"{results['epochs']} epochs. Tested on {len(runs[UNTRAINED]['seconds'])} sets (seed "
        f"{results['test_seed']}) of {len(others)} other meshes ({results['collection']}: "
        f"{report.listed(others)}), 3–5 random "
        "vertices each, shortest order. Losses are the least so far, averaged over the sets.\n\n"
        f"{_table(results)}\n\n{_findings(runs)}\n\n"
        f"{report.figure('transfer.png', plots.LEAST_LOSSES)}"
    )


def draw(results: Results, folder: Path) -> None:
    """Draw the losses by iteration."""
    plots.least_losses(
        {label: run["mean_losses"] for label, run in results["runs"].items()},
        "Prediction on other meshes (Table 2)",
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
        "network", "training", "loss at the start", f"after {results['iterations']} iterations",
        "relative to no pretraining", "sets with a lower loss",
    )  # fmt: skip
    return report.table(header, rows)


def _findings(runs: Mapping[str, Results]) -> str:
    """What the table says, in words."""
    means = {label: float(np.mean(run["last_losses"])) for label, run in runs.items()}
    text = "Absolute losses cannot be compared with the paper's, whose λ carry another unit. "
    for label in (ONE_MESH, SHIPPED):
        relative = means[label] / means[UNTRAINED]
        verdict = "as in the paper" if relative < 1.0 else "which contradicts the paper"
        outcome = "lowers" if relative < 1.0 else "does not lower"
        subject = "Pretraining on one mesh" if label == ONE_MESH else "Taking the shipped weights"
        text += f"{subject} {outcome} the loss on other meshes ({relative:.2f}), {verdict}"
        if label == ONE_MESH:
            text += f" ({PAPER[ONE_MESH] / PAPER[UNTRAINED]:.2f})"
        text += ". "
    if means[ONE_MESH] < means[SHIPPED]:
        worse = np.greater(runs[SHIPPED]["last_losses"], runs[ONE_MESH]["last_losses"]).mean()
        text += (
            "The shipped weights, pretrained longer and on generated shapes, end higher than those "
            f"on {100 * worse:.0f} % of the sets. "
        )
    return text + (
        "Out of reach: 30 minutes of pretraining on an RTX 4090; here it has one core and less "
        "time."
    )
