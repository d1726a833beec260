"""Seconds of the methods on the same sets of points (Table 5)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

import nicmm_core as nicmm
from nicmm_core.geometry.array_types import FloatArray, IntArray
from nicmm_core.geometry.curve import is_one_curve
from nicmm_core.geometry.mesh import Mesh

from . import collections, plots, report
from .measures import bending
from .methods import METHODS
from .samples import random_sets
from .scale import Scale

SEED = 5

REPEATED = tuple(method for method in METHODS if method != "nicmm-paper")
"""Methods that are quick enough to be run several times."""

PAPER = {"nicmm-paper": (398, 62, 262, 697), "variational": (102, 106, 24, 538)}
"""Average, standard deviation, least and greatest milliseconds of the paper's Table 5."""


def run(scale: Scale) -> None:
    """Time every method on every set, in turn, so that a busy machine slows all alike."""
    repetitions = scale.choose(3, 1)
    seconds: dict[str, list[FloatArray]] = {method: [] for method in METHODS}
    iterations: dict[str, list[int]] = {method: [] for method in METHODS}
    several = dict.fromkeys(METHODS, 0)
    bends: list[float] = []  # relative to the variational method
    names: list[str] = []
    sizes: list[int] = []
    meshes = collections.surfaces(scale, scale.choose(40, 4))
    for name, mesh, points in random_sets(meshes, 1, SEED):
        try:
            if not names:
                _timed(mesh, points)  # Imports, weights and caches of the first solve.
            runs = [_timed(mesh, points)]
            runs += [_timed(mesh, points, REPEATED) for _ in range(repetitions - 1)]
        except nicmm.UnreachableError as error:
            print(f"  {name}: {error}", flush=True)
            continue
        names.append(name)
        sizes.append(len(mesh.vertices))
        for method in METHODS:
            times = np.array([designs[method].seconds for designs in runs if method in designs])
            seconds[method].append(times)
            iterations[method].append(runs[0][method].iterations)
            several[method] += not is_one_curve(runs[0][method].curves)
        ours, theirs = (runs[0][method].curves[0] for method in ("nicmm", "variational"))
        bends.append(bending(mesh, ours) / bending(mesh, theirs))
        text = ", ".join(f"{method} {seconds[method][-1].mean():.2f} s" for method in METHODS)
        print(f"  {name}: {text}", flush=True)
    averages = {method: np.array([t.mean() for t in times]) for method, times in seconds.items()}
    body = (
        f"Seed {SEED}, {len(names)} sets of 3–5 random vertices, shortest order, one a mesh "
        f"({collections.label(scale)}: {report.listed(names)}), {min(sizes)} to {max(sizes)} "
        f"vertices; {repetitions} repetitions, one of `nicmm-paper`, each method in turn in one "
        "process after one warm-up, everything included from the mesh to the polyline, and each "
        "with its own stopping criterion, where the paper stops both by the change of the loss. "
        "Statistics are over the sets, of each set's average.\n\n"
        f"{_table(averages, iterations, several)}\n\n{_findings(averages, bends)}\n\n"
        f"{_plot(averages, scale)}"
    )
    report.write_section("runtime", "Running time (Table 5)", body, scale)


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


def _table(
    averages: Mapping[str, FloatArray],
    iterations: Mapping[str, Sequence[int]],
    several: Mapping[str, int],
) -> str:
    rows: list[tuple[object, ...]] = []
    for method, times in averages.items():
        own = [f"{1000 * value:.0f}" for value in _statistics(times)]
        rows.append((method, *own, f"{np.median(iterations[method]):.0f}", several[method]))
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


def _plot(averages: Mapping[str, FloatArray], scale: Scale) -> str:
    """Every set's time, sorted, with the paper's averages as dashed lines."""
    figure, axes = plots.labelled(
        "Running time (Table 5)", "share of the sets that take less", "seconds"
    )
    for method, times in averages.items():
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
    path = plots.save(figure, report.output_folder(scale) / "runtime.png")
    return report.figure(path, "Seconds of every set by method; dashed: the paper's averages")
