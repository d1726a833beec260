"""Measures the running time of all methods on the same sets of points (Table 5)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

import nicmm_core as nicmm
from nicmm_core.geometry.array_types import FloatArray, IntArray
from nicmm_core.geometry.curve import is_one_curve
from nicmm_core.geometry.mesh import Mesh

from . import collections, plots, report
from .evidence import EVERY_METHOD, Results
from .measures import bending
from .methods import METHODS
from .samples import random_sets
from .scale import Scale

TITLE = "Running time (Table 5)"
TIMED = True
ROOMS = EVERY_METHOD

SEED = 5

PAPER = {"nicmm": (398, 62, 262, 697), "variational": (102, 106, 24, 538)}
"""Average, standard deviation, least and greatest time in milliseconds, Table 5."""

PLOT = "runtime.png"


def measure(scale: Scale) -> Results:
    """Time every method on every set.

    The methods take turns on each set, so that other load on the machine slows all alike.
    """
    repetitions = scale.choose(3, 1)
    sets: list[Results] = []
    meshes = collections.surfaces(scale, scale.choose(40, 4))
    for name, mesh, points in random_sets(meshes, 1, SEED):
        try:
            if not sets:
                _timed(mesh, points)  # warm-up: imports, weights and caches
            runs = [_timed(mesh, points) for _ in range(repetitions)]
        except nicmm.UnreachableError as error:
            print(f"  {name}: {error}", flush=True)
            continue
        answers = {method: _answer(runs, method) for method in METHODS}
        ours, theirs = (runs[0][method].curves[0] for method in ("elastic", "variational"))
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
    """Times by method, beside those of the paper."""
    sets = results["sets"]
    sizes = [each["vertices"] for each in sets]
    names = report.listed(each["mesh"] for each in sets)
    averages = _averages(results)
    return (
        "The table shows how long each method takes for a curve, including everything from the "
        "mesh to the polyline, beside the times in Table 5 of the paper. Each row is a method; the "
        f"statistics are over {len(sets)} sets of control points, of the average time of each set. "
        "The last two columns are the median number of iterations, and the number of sets for "
        "which the result is not exactly one curve. A set has 3–5 random vertices, one set per "
        f"mesh, in the shortest order (seed {results['seed']}). Each set was repeated "
        f"{results['repetitions']} times; the methods take turns in one process, after a warm-up. "
        "Each method uses its own stopping criterion, whereas the paper stops both of its methods "
        "by the change of the loss. Meshes "
        f"({results['collection']}, {min(sizes)} to {max(sizes)} vertices): {names}.\n\n"
        f"{_table(averages, sets)}\n\n"
        f"{_findings(averages, [each['bending'] for each in sets])}\n\n"
        + report.figure(PLOT, "Time of every set by method, sorted. Dashed: averages in the paper")
    )


def summary(results: Results) -> str:
    """What the documents say of it."""
    sets = results["sets"]
    methods = list(sets[0]["answers"])
    mean = {
        method: np.array([np.mean(each["answers"][method]["seconds"]) for each in sets])
        for method in methods
    }
    ratio = float(np.median(mean["elastic"] / mean["variational"]))
    seconds = report.listed(f"`{method}` {mean[method].mean():.2f} s" for method in methods)
    medians = report.listed(f"{np.median(mean[method]):.2f} s" for method in methods)
    return report.paragraph(
        f"A first curve takes {seconds} on average over {len(sets)} meshes of some 4,000 vertices "
        f"(`python -m benchmarks runtime`; medians {medians}). The median ratio of `elastic` to "
        f"`variational` is {ratio:.2f}; the slowest curve of `elastic` takes "
        f"{mean['elastic'].max():.1f} s. Seconds are those of the machine that measured them, so "
        "ratios say more."
    )


def draw(results: Results, folder: Path) -> None:
    """Plot the sorted times of all sets, with the averages of the paper as dashed lines."""
    figure, axes = plots.labelled(
        "Running time (Table 5)", "share of the sets that take less time", "seconds"
    )
    for method, times in _averages(results).items():
        share = (np.arange(len(times)) + 0.5) / len(times)
        colour = plots.METHOD_COLOURS[method]
        axes.plot(share, np.sort(times), ".-", color=colour, label=method)
        if method in PAPER:
            axes.axhline(PAPER[method][0] / 1000, color=colour, linestyle="--", linewidth=1)
            axes.text(0.0, PAPER[method][0] / 1000, f"{method}, average in the paper", va="bottom")
    axes.set_yscale("log")
    plots.plain_ticks(axes.yaxis)
    axes.set_xlim(0.0, 1.0)
    axes.legend()
    plots.save(figure, folder / PLOT)


def _timed(mesh: Mesh, points: IntArray) -> dict[str, nicmm.Design]:
    """One design with each method; each gets a copy of the mesh, so that no cache is shared."""
    return {
        method: nicmm.design_curve(
            Mesh(mesh.vertices, mesh.faces), points, order="shortest", method=method
        )
        for method in METHODS
    }


def _answer(runs: Sequence[Mapping[str, nicmm.Design]], method: str) -> Results:
    """Times of a method in all runs, and its outcome in the first run."""
    first = runs[0][method]
    return {
        "seconds": [round(designs[method].seconds, 6) for designs in runs],
        "iterations": int(first.iterations),
        "one_curve": bool(is_one_curve(first.curves)),
    }


def _averages(results: Results) -> dict[str, FloatArray]:
    """Mean time of every set in seconds, by method."""
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
        "method", "avg (ms)", "std (ms)", "min (ms)", "max (ms)", "iterations, median",
        "not one curve",
    )  # fmt: skip
    return report.table(header, rows)


def _statistics(times: FloatArray) -> tuple[float, ...]:
    return tuple(float(value) for value in (times.mean(), times.std(), times.min(), times.max()))


def _findings(averages: Mapping[str, FloatArray], bends: Sequence[float]) -> str:
    """Ratios of the times, and whether they agree with the paper."""
    text = (
        "The times in the paper are from an i9-14900K and an RTX 4090, so only ratios can be "
        "compared. "
    )
    paired = float(np.median(averages["elastic"] / averages["variational"]))
    text += (
        f"By the median of the sets, `elastic` takes {paired:.2f} times as long as `variational`, "
        f"and its curve bends {np.median(bends):.2f} times as much (L ∮ κ_g² ds); it bends more on "
        f"{sum(ratio > 1.0 for ratio in bends)} of {len(bends)} sets. By the averages: "
    )
    methods = list(averages)
    for first, one in enumerate(methods):
        for other in methods[first + 1 :]:
            slow, fast = sorted((one, other), key=lambda m: averages[m].mean(), reverse=True)
            ratio = averages[slow].mean() / averages[fast].mean()
            text += f"`{slow}` takes {ratio:.2f} times as long as `{fast}`"
            if {one, other} == PAPER.keys():
                text += _against_the_paper(slow, ratio)
            text += "; "
    return text.removesuffix("; ") + "."


def _against_the_paper(slow: str, ratio: float) -> str:
    published = PAPER["nicmm"][0] / PAPER["variational"][0]
    if slow == "variational":
        return f", which contradicts the paper, where it is {published:.2f} times as fast"
    slower = report.verdict(ratio, published, "faster", "slower")
    return f", so it is {slower} ({published:.2f} times)"
