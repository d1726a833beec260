"""Seconds of the methods on the same sets of points (Table 5)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

import nicmm_core as nicmm
from nicmm_core.geometry.array_types import FloatArray, IntArray
from nicmm_core.geometry.curve import is_one_curve
from nicmm_core.geometry.mesh import Mesh

from . import collections, plots, report
from .evidence import Results
from .measures import bending
from .methods import METHODS
from .samples import random_sets
from .scale import Scale

TITLE = "Running time (Table 5)"
TIMED = True
WITHOUT = ("outputs",)

SEED = 5

REPEATED = tuple(method for method in METHODS if method != "nicmm-paper")
"""Methods that are quick enough to be run several times."""

PAPER = {"nicmm-paper": (398, 62, 262, 697), "variational": (102, 106, 24, 538)}
"""Average, standard deviation, least and greatest milliseconds of the paper's Table 5."""

PLOT = "runtime.png"


def measure(scale: Scale) -> Results:
    """Time every method on every set, in turn, so that a busy machine slows all alike."""
    repetitions = scale.choose(3, 1)
    sets: list[Results] = []
    meshes = collections.surfaces(scale, scale.choose(40, 4))
    for name, mesh, points in random_sets(meshes, 1, SEED):
        try:
            if not sets:
                _timed(mesh, points)  # Imports, weights and caches of the first solve.
            runs = [_timed(mesh, points)]
            runs += [_timed(mesh, points, REPEATED) for _ in range(repetitions - 1)]
        except nicmm.UnreachableError as error:
            print(f"  {name}: {error}", flush=True)
            continue
        answers = {method: _answer(runs, method) for method in METHODS}
        ours, theirs = (runs[0][method].curves[0] for method in ("nicmm", "variational"))
        ratio = round(bending(mesh, ours) / bending(mesh, theirs), 6)
        sets.append(
            {"mesh": name, "vertices": len(mesh.vertices), "answers": answers, "bending": ratio}
        )
        text = ", ".join(
            f"{method} {np.mean(answer['seconds']):.2f} s" for method, answer in answers.items()
        )
        print(f"  {name}: {text}", flush=True)
    return {
        "seed": SEED,
        "collection": collections.label(scale),
        "repetitions": repetitions,
        "methods": list(METHODS),
        "sets": sets,
    }


def section(results: Results) -> str:
    """Seconds by method, beside the paper's."""
    sets = results["sets"]
    sizes = [each["vertices"] for each in sets]
    names = report.listed(each["mesh"] for each in sets)
    averages = _averages(results)
    return (
        f"Seed {results['seed']}, {len(sets)} sets of 3–5 random vertices, shortest order, one a "
        f"mesh ({results['collection']}: {names}), {min(sizes)} to {max(sizes)} vertices; "
        f"{results['repetitions']} repetitions, one of `nicmm-paper`, each method in turn in one "
        "process after one warm-up, everything included from the mesh to the polyline, and each "
        "with its own stopping criterion, where the paper stops both by the change of the loss. "
        "Statistics are over the sets, of each set's average.\n\n"
        f"{_table(averages, sets)}\n\n"
        f"{_findings(averages, [each['bending'] for each in sets])}\n\n"
        + report.figure(PLOT, "Seconds of every set by method; dashed: the paper's averages")
    )


def draw(results: Results, folder: Path) -> None:
    """Every set's time, sorted, with the paper's averages as dashed lines."""
    figure, axes = plots.labelled(
        "Running time (Table 5)", "share of the sets that take less", "seconds"
    )
    for method, times in _averages(results).items():
        share = (np.arange(len(times)) + 0.5) / len(times)
        colour = plots.METHOD_COLOURS[method]
        axes.plot(share, np.sort(times), ".-", color=colour, label=method)
        if method in PAPER:
            axes.axhline(PAPER[method][0] / 1000, color=colour, linestyle="--", linewidth=1)
            axes.text(0.0, PAPER[method][0] / 1000, f"{method}, paper's average", va="bottom")
    axes.set_yscale("log")
    plots.plain_ticks(axes.yaxis)
    axes.set_xlim(0.0, 1.0)
    axes.legend()
    plots.save(figure, folder / PLOT)


def _timed(
    mesh: Mesh, points: IntArray, methods: Iterable[str] = METHODS
) -> dict[str, nicmm.Design]:
    """One design with each method; a copy of the mesh each time, so that no cache is shared."""
    return {
        method: nicmm.design_curve(
            Mesh(mesh.vertices, mesh.faces), points, order="shortest", method=method
        )
        for method in methods
    }


def _answer(runs: Sequence[Mapping[str, nicmm.Design]], method: str) -> Results:
    """A method's seconds in all runs, and what it did in the first."""
    first = runs[0][method]
    return {
        "seconds": [round(designs[method].seconds, 6) for designs in runs if method in designs],
        "iterations": int(first.iterations),
        "one_curve": bool(is_one_curve(first.curves)),
    }


def _averages(results: Results) -> dict[str, FloatArray]:
    """Mean seconds of every set, by method."""
    return {
        method: np.array([np.mean(each["answers"][method]["seconds"]) for each in results["sets"]])
        for method in results["methods"]
    }


def _table(averages: Mapping[str, FloatArray], sets: Sequence[Results]) -> str:
    rows: list[tuple[object, ...]] = []
    for method, times in averages.items():
        own = [f"{1000 * value:.0f}" for value in _statistics(times)]
        answers = [each["answers"][method] for each in sets]
        iterations = np.median([answer["iterations"] for answer in answers])
        several = sum(not answer["one_curve"] for answer in answers)
        rows.append((method, *own, f"{iterations:.0f}", several))
        if method in PAPER:
            rows.append((f"{method}, paper", *PAPER[method], "", ""))
    header = (
        "method", "avg (ms)", "std", "min", "max", "iterations (median)", "not one curve"
    )  # fmt: skip
    return report.table(header, rows)


def _statistics(times: FloatArray) -> tuple[float, ...]:
    return tuple(float(value) for value in (times.mean(), times.std(), times.min(), times.max()))


def _findings(averages: Mapping[str, FloatArray], bends: Sequence[float]) -> str:
    """Ratios of the sets and of the averages, beside the paper's."""
    text = (
        "The paper's numbers are from an i9-14900K and an RTX 4090; only ratios can be compared. "
    )
    paired = float(np.median(averages["nicmm"] / averages["variational"]))
    text += (
        f"`nicmm` takes {paired:.2f} of the time of `variational` and bends "
        f"{np.median(bends):.2f} times as much (L ∮ κ_g² ds), medians of the sets; it bends more "
        f"in {sum(ratio > 1.0 for ratio in bends)} of {len(bends)}. "
    )
    methods = list(averages)
    for first, one in enumerate(methods):
        for other in methods[first + 1 :]:
            slow, fast = sorted((one, other), key=lambda m: averages[m].mean(), reverse=True)
            ratio = averages[slow].mean() / averages[fast].mean()
            text += f"`{slow}` takes {ratio:.2f} times as long as `{fast}`"
            if {one, other} == PAPER.keys():
                text += _against_the_paper(slow, ratio)
            text += ". "
    return text.strip()


def _against_the_paper(slow: str, ratio: float) -> str:
    published = PAPER["nicmm-paper"][0] / PAPER["variational"][0]
    if slow == "variational":
        return f", which contradicts the paper, where it is {published:.2f} times as fast"
    return f"; in the paper the ratio is {published:.2f}"
