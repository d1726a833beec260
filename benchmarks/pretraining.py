"""Measures the effect of pretraining on the mesh that was used for it (Table 1)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from nicmm_core.paper.network import initial_network
from nicmm_core.paper.weights_file import load_network

from . import collections, plots, report
from .evidence import NETWORK, Results
from .scale import Scale
from .solving import random_samples, run_networks, train

TITLE = "Pretraining (Table 1)"
ROOMS = NETWORK

SEED = 7
TEST_SEED = 8
ITERATIONS = 20
"""Number of Gauss–Newton steps, for the 50 steps of AdamW in the paper.

With its early stop a fit takes about 20 steps; the paper's AdamW takes 32 to 41.
"""

ALSO_AFTER = 5
"""Earlier iteration that is shown as well."""

UNTRAINED, SHIPPED = "no pretraining", "shipped weights"

PAPER = {"no pretraining": 57.6, "2 min": 19.9, "10 min": 14.4, "30 min": 13.0, "10 h": 12.5}
"""Average loss by duration of pretraining, Table 1."""

PAPER_TRAINING = 1000 * 10
"""Sets in the paper's shortest pretraining, counting repetitions: 1000 sets, about 10 epochs."""


def measure(scale: Scale) -> Results:
    """Pretrain for several durations and fit the networks to other sets of the same mesh."""
    name, mesh = next(iter(collections.surfaces(scale, 1)))
    sets = scale.choose(250, 10, 2)
    trained = {_label(sets, epochs): train(mesh, sets, epochs, SEED) for epochs in _epochs(scale)}
    networks = {
        UNTRAINED: initial_network(),
        **{label: one.network for label, one in trained.items()},
        SHIPPED: load_network(),
    }
    samples = random_samples([(name, mesh)], scale.choose(50, 2), TEST_SEED)
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
        "Networks were pretrained for different durations on random sets of control points of one "
        "mesh and then fitted to other sets of the same mesh, as in Table 1 of the paper. Each row "
        "is a network. Its losses are the lowest loss so far, averaged over the test sets, at the "
        "start of the fit and after the given numbers of iterations; the last column divides the "
        "last loss by that without pretraining. The loss is the energy of Eq. 2 in the band around "
        "the curve, with φ as a signed distance. An iteration is a Gauss–Newton step, while the "
        "paper takes steps of AdamW (30 in the text for Table 1, 50 for the other tables). Only "
        "the ratio can be compared with the paper, whose losses have other units. The mesh is "
        f"{results['mesh']} ({results['collection']}; {results['vertices']} vertices), with "
        f"{results['sets']} sets for pretraining (seed {results['seed']}) and "
        f"{len(results['runs'][UNTRAINED]['seconds'])} for the test (seed "
        f"{results['test_seed']}), each of 3–5 random vertices in the shortest order.\n\n"
        f"{_table(results)}\n\n{_findings(results)}\n\n"
        f"{report.figure('pretraining.png', plots.LEAST_LOSSES)}"
    )


def draw(results: Results, folder: Path) -> None:
    """Plot the losses against the iteration."""
    plots.least_losses(
        {label: run["mean_losses"] for label, run in results["runs"].items()},
        "Loss after different amounts of pretraining (Table 1)",
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
        duration = "–" if label == UNTRAINED else label
        rows.append((f"paper, {label}", duration, "", "", f"{loss:.1f}", share))
    header = (
        "network", "time of pretraining", "initial loss", f"after {ALSO_AFTER} iterations",
        f"after {iterations} iterations", "relative to no pretraining",
    )  # fmt: skip
    return report.table(header, rows)


def _findings(results: Results) -> str:
    """What the table shows, in words, and whether it agrees with the paper."""
    runs, trained, sets = results["runs"], results["trained"], results["sets"]
    last = {label: run["mean_losses"][results["iterations"]] for label, run in runs.items()}
    share = {label: loss / last[UNTRAINED] for label, loss in last.items()}
    durations = list(trained)
    values = [share[label] for label in durations]
    most = max(one["epochs"] for one in trained.values()) * sets
    preparing = float(np.mean([one["preparing_seconds"] for one in trained.values()]))
    paper = PAPER["2 min"] / PAPER[UNTRAINED]
    text = (
        f"After the longest pretraining ({durations[-1]}), the loss is "
        f"{report.verdict(values[-1], paper)} ({values[-1]:.2f} of that without pretraining; "
        f"paper, after 2 minutes: {paper:.2f}). "
    )
    if all(later <= earlier for earlier, later in zip(values, values[1:], strict=False)):
        text += "Longer pretraining always gives a lower loss, which agrees with the paper. "
    else:
        text += "Longer pretraining does not always give a lower loss, unlike in the paper. "
    text += (
        "An untrained network returns φ₀ itself here, so its fit starts from the same curve as "
        "`variational`; all differences between the networks arise from the start and from the "
        "changes of φ to which their steps are restricted.\n\n"
        f"The times do not include the preparation of the {sets} sets, which takes "
        f"{preparing:.0f} s. Pretraining uses the same λ_smooth for a set as a design does. The "
        "shipped weights, which were pretrained on other meshes, give a ratio of "
        f"{share[SHIPPED]:.2f}. The paper pretrains for up to 10 hours on an RTX 4090, which was "
        f"not repeated: its shortest pretraining visits {PAPER_TRAINING:,} sets, counting "
        f"repetitions, and the longest one here {most:,}, on one core."
    )
    return text
