"""Compares the solvers of the level set: AdamW, and Gauss–Newton steps with and without a network.

All start from the same problem: AdamW with the shipped weights minimises Eq. 6 as in the text of
the paper, the others minimise Eq. 5 and make φ a signed distance after every step.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np

from nicmm_core.paper import variational
from nicmm_core.paper.fitting import fit
from nicmm_core.paper.network import initial_network
from nicmm_core.paper.solution import Solution
from nicmm_core.paper.weights_file import load_network

from . import collections, report
from .adamw import AdamWConfig, fit_by_adamw
from .evidence import NETWORK, Results
from .measures import SAMPLES, bending
from .scale import Scale
from .solving import Sample, designed_curve, random_samples, significant

TITLE = "Solvers of the level set"
TIMED = True
ROOMS = NETWORK

SEED = 18

ADAMW = "AdamW, shipped weights"
SHIPPED, RANDOM = "Gauss–Newton, shipped weights", "Gauss–Newton, random weights"
VERTICES = "Gauss–Newton, values at vertices"
"""The last one is the method `variational`."""


def measure(scale: Scale) -> Results:
    """Solve the same problems with every solver.

    The solvers take turns on each set, so that other load on the machine slows all alike.
    """
    solvers = _solvers(AdamWConfig(iterations=scale.choose(AdamWConfig.iterations, 100, 12)))
    sets: list[Results] = []
    meshes = collections.surfaces(scale, scale.choose(24, 4))
    for sample in random_samples(meshes, 1, SEED):
        if not sets:
            for solve in solvers.values():
                solve(sample)  # warm-up: imports and caches
        answers = {label: _answer(sample, solve) for label, solve in solvers.items()}
        sets.append({"mesh": sample.name, "answers": answers})
        text = ", ".join(f"{label} {one['bending']:.0f}" for label, one in answers.items())
        print(f"  {sample.name}: {text}", flush=True)
    if not sets:
        raise SystemExit("No set had a simple loop through its points; there is nothing to solve")
    return {"seed": SEED, "collection": collections.label(scale), "sets": sets}


def _solvers(adamw: AdamWConfig) -> dict[str, Callable[[Sample], Solution]]:
    shipped, random = load_network(), initial_network()
    return {
        ADAMW: lambda s: fit_by_adamw(shipped, s.problem, s.weights, adamw),
        SHIPPED: lambda s: fit(shipped, s.problem, s.weights),
        RANDOM: lambda s: fit(random, s.problem, s.weights),
        VERTICES: lambda s: variational.solve(s.problem, s.weights),
    }


def _answer(sample: Sample, solve: Callable[[Sample], Solution]) -> Results:
    """Time and iterations of a solver on a problem, and the bending of its curve."""
    started = time.perf_counter()
    solution = solve(sample)
    seconds = time.perf_counter() - started
    return {
        "bending": significant(bending(sample.mesh, designed_curve(sample, solution.field))),
        "iterations": solution.iterations,
        "seconds": significant(seconds),
        "held": solution.held,
    }


def section(results: Results) -> str:
    """Bending, iterations and time of every solver, and what makes the difference."""
    sets = results["sets"]
    return (
        "Four solvers were given the same problems, to see what makes `nicmm` and `variational` "
        "fair and fast. AdamW trains the network further with Eq. 6 and the early stop of the "
        f"paper, at most {AdamWConfig.iterations} iterations; its level set is repaired at the end "
        "where it is not one loop. The other solvers take Gauss–Newton steps on Eq. 5, after each "
        "of which φ becomes a signed distance again: steps of the parameters of the network, as "
        "`nicmm`, with the shipped or with random weights, and steps of the values of φ at the "
        "vertices, as `variational`. Each row is a solver. Bending is L ∮ κ_g² ds at "
        f"{SAMPLES} samples. Ratios to `variational` are paired, by the median and the geometric "
        "mean of the sets; times are those of the solver alone, without the preparation of the "
        f"problem, on the CPU. There are {len(sets)} sets of 3–5 random vertices, one per mesh "
        f"(shortest order, seed {results['seed']}). Meshes ({results['collection']}): "
        f"{report.listed(each['mesh'] for each in sets)}.\n\n"
        f"{_table(sets)}\n\n{_findings(sets)}"
    )


def _ratios(sets: Sequence[Results], label: str, name: str) -> tuple[float, float]:
    """Median and geometric mean of a value relative to that of `variational` on the same set."""
    ratios = [each["answers"][label][name] / each["answers"][VERTICES][name] for each in sets]
    return float(np.median(ratios)), float(np.exp(np.mean(np.log(ratios))))


def _median(sets: Sequence[Results], label: str, name: str) -> float:
    return float(np.median([each["answers"][label][name] for each in sets]))


def _table(sets: Sequence[Results]) -> str:
    rows = []
    for label in sets[0]["answers"]:
        bends, times = (_ratios(sets, label, name) for name in ("bending", "seconds"))
        rows.append(
            (
                label,
                f"{_median(sets, label, 'bending'):.0f}",
                "–" if label == VERTICES else f"{bends[0]:.2f} · {bends[1]:.2f}",
                f"{_median(sets, label, 'iterations'):.0f}",
                f"{_median(sets, label, 'seconds'):.2f}",
                "–" if label == VERTICES else f"{times[0]:.2f} · {times[1]:.2f}",
                sum(each["answers"][label]["held"] == 0 for each in sets),
            )
        )
    header = (
        "solver", "bending, median", "relative to `variational`: median · geometric mean",
        "iterations, median", "seconds, median",
        "time relative to `variational`: median · geometric mean",
        "sets without held or repaired vertices",
    )  # fmt: skip
    return report.table(header, rows)


def _findings(sets: Sequence[Results]) -> str:
    """What the table shows, in words."""
    _, adamw = _ratios(sets, ADAMW, "bending")
    _, shipped = _ratios(sets, SHIPPED, "bending")
    _, random = _ratios(sets, RANDOM, "bending")
    text = (
        f"By the geometric mean, the curves of AdamW bend {adamw:.2f} times as much as those of "
        f"`variational`; with Gauss–Newton steps the network gives {shipped:.2f} times as much "
        f"with the shipped weights and {random:.2f} times with random ones. "
    )
    most, least = max(shipped, random, 1.0), min(shipped, random, 1.0)
    if adamw / most > most / least:
        text += (
            "So most of the difference is made by what the last three solvers have in common: "
            "second-order steps, Eq. 5 and redistancing, not the network or its pretraining. "
        )
    else:
        text += (
            f"Among one another, the last three differ by a factor of up to {most / least:.2f}, no "
            "less than from AdamW. "
        )
    return text + (
        "The network is a metric for the steps: it decides which changes of φ are small, and so "
        "which of the local minima they reach."
    )
