"""What pretraining on one mesh is worth on others (Table 2)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from nicmm_core.network.trainable_network import load_network

from . import collections, report
from .scale import Scale
from .solving import (
    Runs,
    Trained,
    least_losses_figure,
    random_samples,
    run_networks,
    train,
    untrained,
)

SEED = 9
TEST_SEED = 10
ITERATIONS = 50

UNTRAINED, ONE_MESH, SHIPPED = "no pretraining", "pretrained on one mesh", "shipped weights"

PAPER = {UNTRAINED: 15.298, ONE_MESH: 10.996}
"""Average loss, Table 2; the pretraining took 30 minutes."""


def run(scale: Scale) -> None:
    """Pretrain on one mesh and fine-tune for sets of others."""
    sets, epochs = scale.choose(100, 10, 4), scale.choose(16, 3, 2)
    others = scale.choose(20, 2, 1)
    (name, mesh), *rest = collections.surfaces(scale, others + 1)
    trained = train(mesh, sets, epochs, SEED)
    networks = {UNTRAINED: untrained(), ONE_MESH: trained.network, SHIPPED: load_network()}
    samples = random_samples(rest, scale.choose(10, 1), TEST_SEED)
    runs = run_networks(networks, samples, ITERATIONS)
    figure = least_losses_figure(runs, "Prediction on other meshes (Table 2)", "transfer", scale)
    body = (
        f"Pretrained on {name}: {sets} sets (seed {SEED}) × {epochs} epochs. Tested on "
        f"{len(runs[UNTRAINED].seconds)} sets (seed {TEST_SEED}) of {len(rest)} other meshes "
        f"({collections.label(scale)}: {report.listed(label for label, _ in rest)}), 3–5 random "
        "vertices each, shortest order. Losses are the least so far, averaged over the sets.\n\n"
        f"{_table(runs, trained)}\n\n{_findings(runs)}\n\n{figure}"
    )
    report.write_section("transfer", "Pretraining for other meshes (Table 2)", body, scale)


def _table(runs: Mapping[str, Runs], trained: Trained) -> str:
    rows: list[tuple[object, ...]] = []
    reference = runs[UNTRAINED].least_losses
    for label, one in runs.items():
        losses = one.least_losses
        better = "–"
        if label != UNTRAINED:
            better = f"{100 * (losses[:, -1] < reference[:, -1]).mean():.0f} %"
        relative = losses[:, -1].mean() / reference[:, -1].mean()
        duration = f"{trained.training_seconds:.0f} s" if label == ONE_MESH else "–"
        means = (f"{losses[:, 0].mean():.3f}", f"{losses[:, -1].mean():.3f}")
        rows.append((label, duration, *means, f"{relative:.2f}", better))
    for label, loss in PAPER.items():
        duration = "30 min" if label == ONE_MESH else "–"
        relative = loss / PAPER[UNTRAINED]
        rows.append((f"paper, {label}", duration, "", f"{loss:.3f}", f"{relative:.2f}", ""))
    header = (
        "network", "training", "loss at the start", f"after {ITERATIONS} iterations",
        "relative to no pretraining", "sets with a lower loss",
    )  # fmt: skip
    return report.table(header, rows)


def _findings(runs: Mapping[str, Runs]) -> str:
    """What the table says, in words."""
    reference = runs[UNTRAINED].least_losses[:, -1]
    text = "Absolute losses cannot be compared with the paper's, whose λ carry another unit. "
    for label in (ONE_MESH, SHIPPED):
        relative = float(runs[label].least_losses[:, -1].mean() / reference.mean())
        verdict = "as in the paper" if relative < 1.0 else "which contradicts the paper"
        outcome = "lowers" if relative < 1.0 else "does not lower"
        subject = "Pretraining on one mesh" if label == ONE_MESH else "Taking the shipped weights"
        text += f"{subject} {outcome} the loss on other meshes ({relative:.2f}), {verdict}"
        if label == ONE_MESH:
            text += f" ({PAPER[ONE_MESH] / PAPER[UNTRAINED]:.2f})"
        text += ". "
    own, shipped = (float(runs[k].least_losses[:, -1].mean()) for k in (ONE_MESH, SHIPPED))
    if own < shipped:
        worse = np.mean(runs[SHIPPED].least_losses[:, -1] > runs[ONE_MESH].least_losses[:, -1])
        text += (
            "The shipped weights, pretrained longer and on generated shapes, end higher than those "
            f"on {100 * worse:.0f} % of the sets. "
        )
    return text + (
        "Out of reach: 30 minutes of pretraining on an RTX 4090; here it has one core and less "
        "time."
    )
