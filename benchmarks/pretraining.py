"""What pretraining is worth on the mesh that it was done on (Table 1)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from nicmm_core.network.trainable_network import load_network

from . import collections, plots, report
from .evidence import Results
from .scale import Scale
from .solving import PARTS_WITHOUT, random_samples, run_networks, train, untrained

TITLE = "Pretraining (Table 1)"
WITHOUT = PARTS_WITHOUT

SEED = 7
TEST_SEED = 8
ITERATIONS = 50
ALSO_AFTER = 30
"""The paper's text has 30 beside Table 1, and 50 for the tables after it; both are shown."""

UNTRAINED, SHIPPED = "no pretraining", "shipped weights"

PAPER = {"no pretraining": 57.6, "2 min": 19.9, "10 min": 14.4, "30 min": 13.0, "10 h": 12.5}
"""Average loss by duration, Table 1."""

PAPER_TRAINING = 1000 * 10
"""Sets that the paper's shortest pretraining sees: 1,000 sets, about 10 epochs."""


def measure(scale: Scale) -> Results:
    """Pretrain for several durations and fine-tune for sets of the same mesh."""
    name, mesh = next(iter(collections.surfaces(scale, 1)))
    sets = scale.choose(250, 10, 4)
    trained = {_label(sets, epochs): train(mesh, sets, epochs, SEED) for epochs in _epochs(scale)}
    networks = {
        UNTRAINED: untrained(),
        **{label: one.network for label, one in trained.items()},
        SHIPPED: load_network(),
    }
    samples = random_samples([(name, mesh)], scale.choose(50, 2, 2), TEST_SEED)
    return {
        "collection": collections.label(scale),
        "mesh": name,
        "vertices": len(mesh.vertices),
        "seed": SEED,
        "test_seed": TEST_SEED,
        "sets": sets,
        "iterations": ITERATIONS,
        "trained": {
            label: {
                "epochs": len(one.losses),
                "preparing_seconds": round(one.preparing_seconds, 2),
                "training_seconds": round(one.training_seconds, 2),
            }
            for label, one in trained.items()
        },
        "runs": run_networks(networks, samples, ITERATIONS),
    }


def section(results: Results) -> str:
    """The loss after each duration, and whether it falls as in the paper."""
    return (
        f"Mesh {results['mesh']} ({results['collection']}), {results['vertices']} vertices; "
        f"pretraining on {results['sets']} sets (seed {results['seed']}), test on "
        f"{len(results['runs'][UNTRAINED]['seconds'])} others (seed {results['test_seed']}), 3–5 "
        "random vertices each, shortest order. Losses are the least so far, averaged over the test "
        f"sets.\n\n{_table(results)}\n\n{_findings(results)}\n\n"
        f"{report.figure('pretraining.png', plots.LEAST_LOSSES)}"
    )


def draw(results: Results, folder: Path) -> None:
    """Draw the losses by iteration."""
    plots.least_losses(
        {label: run["mean_losses"] for label, run in results["runs"].items()},
        "Prediction after different pretraining (Table 1)",
        folder / "pretraining.png",
    )


def _epochs(scale: Scale) -> tuple[int, ...]:
    return {Scale.FULL: (1, 4, 16), Scale.QUICK: (1, 3), Scale.SMOKE: (1, 2)}[scale]


def _label(sets: int, epochs: int) -> str:
    return f"{sets * epochs:,} sets seen"


def _table(results: Results) -> str:
    rows: list[tuple[object, ...]] = []
    runs, trained, iterations = results["runs"], results["trained"], results["iterations"]
    reference = runs[UNTRAINED]["mean_losses"][iterations]
    for label, run in runs.items():
        duration = f"{trained[label]['training_seconds']:.0f} s" if label in trained else "–"
        means = [run["mean_losses"][place] for place in (0, ALSO_AFTER, iterations)]
        values = [f"{mean:.3f}" for mean in means]
        rows.append((label, duration, *values, f"{means[-1] / reference:.2f}"))
    for label, loss in PAPER.items():
        share = f"{loss / PAPER[UNTRAINED]:.2f}"
        rows.append((f"paper, {label}", "–", "", "", f"{loss:.1f}", share))
    header = (
        "network", "training", "loss at the start", f"after {ALSO_AFTER} iterations",
        f"after {iterations} iterations", "relative to no pretraining",
    )  # fmt: skip
    return report.table(header, rows)


def _findings(results: Results) -> str:
    """What the table says, in words."""
    runs, trained, sets = results["runs"], results["trained"], results["sets"]
    last = {label: run["mean_losses"][results["iterations"]] for label, run in runs.items()}
    share = {label: loss / last[UNTRAINED] for label, loss in last.items()}
    durations = list(trained)
    values = [share[label] for label in durations]
    most = max(one["epochs"] for one in trained.values()) * sets
    preparing = float(np.mean([one["preparing_seconds"] for one in trained.values()]))
    text = (
        "Absolute losses cannot be compared with the paper's, whose λ carry another unit; the "
        f"last column can. The paper's 2 minutes lower the loss to "
        f"{PAPER['2 min'] / PAPER[UNTRAINED]:.2f} of that without pretraining; here "
        f"{durations[-1]} lower it to {values[-1]:.2f}. "
    )
    text += _verdict_on_gain(values[-1]) + " "
    if all(later <= earlier for earlier, later in zip(values, values[1:], strict=False)):
        text += "Longer pretraining always gives a lower loss, as in the paper. "
    else:
        text += "Longer pretraining does not always give a lower loss, unlike in the paper. "
    text += (
        "The untrained network here returns φ₀ itself, which is why it starts low.\n\n"
        f"Preparing {sets} sets takes {preparing:.0f} s, which is not counted above. Pretraining "
        "and designs take the same λ_smooth of a set. The shipped weights, from other meshes, lead "
        f"to {share[SHIPPED]:.2f}.\n\nOut of reach: 10 hours on an RTX 4090. The paper's shortest "
        f"pretraining sees {PAPER_TRAINING:,} sets, repeated ones counted; the longest one here "
        f"{most:,}, on "
        "one core."
    )
    return text


def _verdict_on_gain(share: float) -> str:
    if share >= 1.0:
        return "This contradicts the paper: pretraining does not help here."
    if share > 2.0 * PAPER["2 min"] / PAPER[UNTRAINED]:
        return "It helps, but far less than in the paper."
    return "It helps as in the paper."
