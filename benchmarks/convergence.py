"""Measures how the loss decreases and how the curve changes after the early stop (Fig. 3, 4)."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from nicmm_core.geometry.array_types import FloatArray
from nicmm_core.geometry.curve import SurfaceCurve
from nicmm_core.paper.fitting import fit
from nicmm_core.paper.network import Network
from nicmm_core.paper.weights_file import load_network
from nicmm_core.status import Status

from . import collections, plots, renders, report
from .evidence import NETWORK, Results
from .scale import Scale
from .solving import (
    Sample,
    designed_curve,
    random_samples,
    relative_distances,
    significant,
    without_early_stop,
)

TITLE = "Convergence and early stop (Fig. 3, Fig. 4)"
ROOMS = NETWORK

SEED = 3
LATER = (50, 100)
"""Iterations after the early stop at which the curve is compared.

Fig. 4 continues to 500 steps of AdamW.
"""

PLATEAU = 50
"""Iteration after which the loss is tested for a plateau."""

PAPER_EARLY_STOP = 41
PAPER_PLATEAU = 200
"""Iteration of the early stop in Fig. 4, and iteration after which the loss plateaus in Fig. 3."""

INDISTINGUISHABLE = 1.0
"""Greatest distance, in percent of the diagonal, up to which two curves look the same."""

RESTING = 0.1
"""Greatest relative decrease of a loss that has reached its plateau."""

NEAR = 0.02
"""Greatest relative decrease of a loss after an early stop that comes late enough."""

STILLS = "convergence_curves.png"
PICTURED = 3
COLOURS = (renders.BLUE, renders.ORANGE, renders.GREEN)


def measure(scale: Scale) -> Results:
    """Continue fits beyond the early stop, on several meshes."""
    network = load_network()
    meshes = collections.surfaces(scale, scale.choose(16, 1))
    courses: list[Results] = []
    pictures: list[renders.Picture] = []
    for sample in random_samples(meshes, 1, SEED):
        course, curves = _followed(network, sample)
        courses.append(course)
        pictures.append(_picture(sample, course["stop"], curves))
    if not courses:
        raise SystemExit("No set had a simple loop through its points; there is nothing to follow")
    path = report.figures_folder(scale) / STILLS
    renders.render_sheet(pictures[:PICTURED], path, scale, columns=PICTURED)
    return {
        "seed": SEED,
        "collection": collections.label(scale),
        "later": list(LATER),
        "courses": courses,
        "stills": STILLS,
    }


def section(results: Results) -> str:
    """How the loss and the curve develop on each mesh, and whether that agrees with the paper."""
    courses, later = results["courses"], results["later"]
    loss_plot = report.figure(
        "convergence.png",
        "Loss against the iteration. Dots: early stop. Dashed: tested for a plateau",
    )
    first, second = later
    stills = report.figure(
        results["stills"],
        f"Curves at the early stop (blue) and after {first} (orange) and {second} (green) "
        "iterations (Fig. 4)",
    )
    return (
        "Fits by `nicmm` were continued beyond the early stop, to see how the loss decreases and "
        "how much the curve still changes, as in Fig. 3 and 4 of the paper. An iteration is a "
        "Gauss–Newton step; the paper takes steps of AdamW, of which many more are needed. Each "
        "row is a mesh with one set of 3–5 random vertices. Its columns are the iteration of the "
        f"early stop; the time of the fit up to the early stop and up to iterations {first} and "
        f"{second}; mean / greatest distances between the curves at two of these iterations, in "
        "percent of the bounding box diagonal; the number of vertices that had to be held up to "
        f"the early stop and up to iteration {second}, so that the level set stayed one loop; and "
        "the share of the total decrease of the loss that had taken place by iteration "
        f"{PLATEAU}. Meshes: {results['collection']}; shortest "
        f"order, shipped weights, seed {results['seed']}.\n\n"
        f"{_table(courses, later)}\n\n{_findings(courses, later)}\n\n{loss_plot}\n\n{stills}"
    )


def draw(results: Results, folder: Path) -> None:
    """Plot the losses."""
    figure, axes = plots.labelled("Loss at every iteration (Fig. 3)", "iteration", "total loss")
    for course in results["courses"]:
        losses = _losses(course)
        (line,) = axes.plot(losses, linewidth=1.0, label=course["mesh"])
        stop = min(course["stop"], len(losses)) - 1
        axes.plot(stop, losses[stop], "o", color=line.get_color())
    axes.axvline(PLATEAU, color="0.4", linestyle="--", linewidth=1)
    axes.set_yscale("log")
    plots.plain_ticks(axes.yaxis)
    axes.legend(fontsize=8, ncols=2)
    plots.save(figure, folder / "convergence.png")


def _followed(network: Network, sample: Sample) -> tuple[Results, list[SurfaceCurve]]:
    """Results of a run continued far beyond its early stop, and its curves there and later."""
    early = fit(network, sample.problem, sample.weights)
    wanted = (early.iterations, *LATER)
    fields: dict[int, FloatArray] = {}
    seconds: dict[int, float] = {}
    done = 0
    started = time.perf_counter()

    def watch(_fraction: float, field: FloatArray) -> bool:
        nonlocal done
        done += 1
        if done in wanted:
            fields[done], seconds[done] = field, time.perf_counter() - started
        return True

    config = without_early_stop(LATER[-1])
    whole = fit(network, sample.problem, sample.weights, config, watch)
    took = time.perf_counter() - started
    # Where no step lowers the energy any more, the fit ends earlier.
    curves = [designed_curve(sample, fields.get(wish, whole.field)) for wish in wanted]
    print(f"  {sample.name}: {early.status} at {early.iterations}", flush=True)
    course = {
        "mesh": sample.name,
        "stop": early.iterations,
        "early": early.status == Status.CONVERGED,
        "losses": [significant(loss) for loss in whole.losses],
        "held": [early.held, whole.held],
        "seconds": [significant(seconds.get(wish, took)) for wish in wanted],
        "distances": _distances(sample, curves),
    }
    return course, curves


def _distances(sample: Sample, curves: Sequence[SurfaceCurve]) -> list[list[float | None]]:
    """Mean and greatest distance of consecutive curves, and of the first and the last."""
    pairs = [*zip(curves, curves[1:], strict=False), (curves[0], curves[-1])]
    return [[significant(value) for value in relative_distances(sample, *pair)] for pair in pairs]


def _picture(sample: Sample, stop: int, curves: Sequence[SurfaceCurve]) -> renders.Picture:
    title = f"{sample.name}, early stop after {stop}"
    return renders.Picture(title, sample.mesh, list(zip(curves, COLOURS, strict=True)))


def _losses(course: Results) -> FloatArray:
    """Losses of all iterations; NaN where they were not finite."""
    return np.array(course["losses"], dtype=np.float64)


def _fallen(course: Results, iteration: int) -> float:
    """Share of the total decrease of the loss that has taken place by an iteration."""
    least = np.fmin.accumulate(_losses(course))
    whole = least[0] - least[-1]
    by_then = least[0] - least[min(iteration, len(least) - 1)]
    return float(by_then / whole) if whole > 0.0 else 1.0


def _table(courses: Sequence[Results], later: Sequence[int]) -> str:
    rows: list[tuple[object, ...]] = []
    for course in courses:
        rows.append(
            (
                course["mesh"],
                f"{course['stop']}" if course["early"] else f"{course['stop']} (cap)",
                " · ".join(f"{value:.1f}" for value in course["seconds"]),
                *(f"{mean:.2f} / {most:.2f}" for mean, most in course["distances"]),
                " · ".join(str(count) for count in course["held"]),
                f"{100 * _fallen(course, PLATEAU):.0f} %",
            )
        )
    rows.append(
        ("paper, Fig. 4", PAPER_EARLY_STOP, "–", *["“nearly indistinguishable”"] * 3, "–",
         "“notably plateaus”")
    )  # fmt: skip
    first, second = later
    header = (
        "mesh", "early stop", f"seconds at the stop · {first} · {second}",
        f"stop to {first}", f"{first} to {second}", f"stop to {second}",
        f"vertices held up to the stop · {second}",
        f"decrease of the loss by iteration {PLATEAU}",
    )  # fmt: skip
    return report.table(header, rows)


def _findings(courses: Sequence[Results], later: Sequence[int]) -> str:
    """What the table shows, in words, and whether it agrees with the paper."""
    stops = [course["stop"] for course in courses]
    greatest = [course["distances"][-1][1] for course in courses]
    same = sum(value <= INDISTINGUISHABLE for value in greatest)
    fallen = [_fallen(course, PLATEAU) for course in courses]
    at_stop = [_fallen(course, course["stop"]) for course in courses]
    least = [np.fmin.accumulate(_losses(course)) for course in courses]
    further = float(np.median([1.0 - one[-1] / one[: PLATEAU + 1][-1] for one in least]))
    near = sum(
        one[min(stop, len(one)) - 1] <= (1.0 + NEAR) * one[-1]
        for stop, one in zip(stops, least, strict=True)
    )
    longer = float(np.median([course["seconds"][-1] / course["seconds"][0] for course in courses]))
    text = (
        f"Fig. 3: by iteration {PLATEAU}, {100 * np.median(fallen):.0f} % (median) of the "
        f"decrease of the loss up to iteration {later[-1]} has taken place; after it the loss "
        f"decreases by a further {100 * further:.0f} % of its value, "
    )
    text += (
        "so it has reached a plateau, which agrees with the paper, where the loss “notably "
        f"plateaus” after {PAPER_PLATEAU} steps of AdamW. "
        if further <= RESTING
        else "so it has not reached a plateau, unlike in the paper after "
        f"{PAPER_PLATEAU} steps of AdamW. "
    )
    text += (
        f"At the early stop, after {np.median(stops):.0f} iterations (median; paper: "
        f"{PAPER_EARLY_STOP} of AdamW), {100 * np.median(at_stop):.0f} % of the decrease has taken "
        f"place, and on {near} of {len(courses)} sets the loss is within {100 * NEAR:g} % of the "
        f"least one up to iteration {later[-1]}. {_jumps(courses, later[0])}\n\n"
        f"Fig. 4: {later[-1]} iterations take {longer:.1f} times as long as those up to the early "
        f"stop (median). In between, the greatest distance of the curves is "
        f"{np.median(greatest):.2f} % of the diagonal (median) and {max(greatest):.2f} % on the "
        f"worst set. {same} of {len(courses)} curves stay within {INDISTINGUISHABLE:g} %, "
    )
    text += (
        "which agrees with the paper's “nearly indistinguishable”."
        if same == len(courses)
        else "which contradicts the paper's “nearly indistinguishable” on the others."
        if same
        else "which contradicts the paper's “nearly indistinguishable”."
    )
    ended = sum(len(course["losses"]) <= later[-1] for course in courses)
    if ended:
        text += (
            f" On {ended} sets the fit ends before iteration {later[-1]}, because no step lowers "
            "the energy any more."
        )
    return text


def _jumps(courses: Sequence[Results], after: int) -> str:
    """Sentence about the sets on which the loss exceeds its initial value after an iteration."""
    heights = {
        course["mesh"]: np.nanmax(_losses(course)[after:], initial=0.0) / _losses(course)[0]
        for course in courses
    }
    jumping = [name for name, height in heights.items() if height > 1.0]
    if not jumping:
        return (
            f"After iteration {after} no loss exceeds its initial value, so the “numerical "
            "instability” after too many iterations, of which the paper warns, does not occur."
        )
    return (
        f"After iteration {after} the loss jumps above its initial value on {len(jumping)} of "
        f"{len(courses)} sets ({report.listed(jumping)}), to up to {max(heights.values()):.1f} "
        "times that value, which agrees with the paper's warning of “numerical instability” after "
        "too many iterations. The result is the field with the lowest loss."
    )
