"""Measures how the loss decreases and how the curve changes after the early stop (Fig. 3, 4)."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from nicmm_core.geometry.array_types import FloatArray
from nicmm_core.geometry.curve import SurfaceCurve
from nicmm_core.paper.finetuning import FinetuningConfig, finetune
from nicmm_core.paper.network import CurveNetwork
from nicmm_core.paper.weights_file import load_network
from nicmm_core.status import Status

from . import collections, plots, renders, report
from .evidence import Results
from .scale import Scale
from .solving import (
    PARTS_WITHOUT,
    Sample,
    designed_curve,
    random_samples,
    relative_distances,
    significant,
    without_early_stop,
)

TITLE = "Convergence and early stop (Fig. 3, Fig. 4)"
WITHOUT = PARTS_WITHOUT

SEED = 3
LATER = (100, 200, 500)
"""Iterations after the early stop at which the curve is compared, as in Fig. 4."""

PAPER_EARLY_STOP = 41
PAPER_PLATEAU = 200
"""Iteration of the early stop in Fig. 4, and iteration after which the loss plateaus in Fig. 3."""

INDISTINGUISHABLE = 1.0
"""Greatest distance, in percent of the diagonal, up to which two curves look the same."""

RESTING = 0.1
"""Greatest relative decrease of a loss that has reached its plateau."""

STILLS = "convergence_curves.png"
PICTURED = 3
COLOURS = (renders.BLUE, renders.ORANGE, renders.GREEN, renders.YELLOW)


def measure(scale: Scale) -> Results:
    """Continue fine-tuning beyond the early stop, on several meshes."""
    network = load_network()
    meshes = collections.surfaces(scale, scale.choose(8, 1))
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
        "Loss against the iteration. Dots: early stop. Dashed: start of the plateau in the paper",
    )
    first, second, third = later
    stills = report.figure(
        results["stills"],
        f"Curves at the early stop (blue) and after {first} (orange), {second} (green) and {third} "
        "(yellow) iterations (Fig. 4)",
    )
    return (
        "Fine-tuning by `nicmm` was continued beyond its early stop, to see how the loss "
        "decreases and how much the curve still changes, as in Fig. 3 and 4 of the paper. Each row "
        "is a mesh with one set of 3–5 random vertices. Its columns are the iteration of the early "
        f"stop; the time of fine-tuning up to the early stop and up to iterations {first}, "
        f"{second} and {third}; mean / greatest distances between the curves at two of these "
        "iterations, in percent of the bounding box diagonal; whether the level set was one loop "
        "without a repair of its topology; and the share of the total decrease of the loss that "
        f"had taken place by iteration {PAPER_PLATEAU}. Meshes: {results['collection']}; shortest "
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
    axes.axvline(PAPER_PLATEAU, color="0.4", linestyle="--", linewidth=1)
    axes.set_yscale("log")
    plots.plain_ticks(axes.yaxis)
    axes.legend(fontsize=8, ncols=2)
    plots.save(figure, folder / "convergence.png")


def _followed(network: CurveNetwork, sample: Sample) -> tuple[Results, list[SurfaceCurve]]:
    """Results of a run continued far beyond its early stop, and its curves there and later."""
    early = finetune(network, sample.problem, sample.weights, FinetuningConfig())
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

    losses = finetune(
        network, sample.problem, sample.weights, without_early_stop(LATER[-1]), watch
    ).losses
    outcomes = [designed_curve(sample, fields[iteration]) for iteration in wanted]
    curves = [curve for curve, _ in outcomes]
    print(f"  {sample.name}: {early.status} at {early.iterations}", flush=True)
    course = {
        "mesh": sample.name,
        "stop": early.iterations,
        "early": early.status == Status.CONVERGED,
        "losses": [significant(loss) for loss in losses],
        "by_itself": [bool(by_itself) for _, by_itself in outcomes],
        "seconds": [significant(seconds[iteration]) for iteration in wanted],
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
    return float((least[0] - least[iteration]) / whole) if whole > 0.0 else 1.0


def _table(courses: Sequence[Results], later: Sequence[int]) -> str:
    rows: list[tuple[object, ...]] = []
    for course in courses:
        rows.append(
            (
                course["mesh"],
                f"{course['stop']}" if course["early"] else f"{course['stop']} (cap)",
                " · ".join(f"{value:.1f}" for value in course["seconds"]),
                *(f"{mean:.2f} / {most:.2f}" for mean, most in course["distances"]),
                " · ".join("yes" if one else "no" for one in course["by_itself"]),
                f"{100 * _fallen(course, PAPER_PLATEAU):.0f} %",
            )
        )
    rows.append(
        ("paper, Fig. 4", PAPER_EARLY_STOP, "–", *["“nearly indistinguishable”"] * 4, "–",
         "“notably plateaus”")
    )  # fmt: skip
    first, second, third = later
    header = (
        "mesh", "early stop", f"seconds at the stop · {first} · {second} · {third}",
        f"stop to {first}", f"{first} to {second}", f"{second} to {third}", f"stop to {third}",
        f"one loop by itself at the stop · {first} · {second} · {third}",
        f"decrease of the loss by iteration {PAPER_PLATEAU}",
    )  # fmt: skip
    return report.table(header, rows)


def _findings(courses: Sequence[Results], later: Sequence[int]) -> str:
    """What the table shows, in words, and whether it agrees with the paper."""
    stops = [course["stop"] for course in courses]
    greatest = [course["distances"][-1][1] for course in courses]
    same = sum(value <= INDISTINGUISHABLE for value in greatest)
    fallen = [_fallen(course, PAPER_PLATEAU) for course in courses]
    at_stop = [_fallen(course, min(course["stop"], later[-1])) for course in courses]
    least = [np.fmin.accumulate(_losses(course)) for course in courses]
    further = float(np.median([1.0 - one[-1] / one[PAPER_PLATEAU] for one in least]))
    longer = float(np.median([course["seconds"][-1] / course["seconds"][0] for course in courses]))
    text = (
        f"Fig. 3: by iteration {PAPER_PLATEAU}, {100 * np.median(fallen):.0f} % (median) of the "
        f"decrease of the loss up to iteration {later[-1]} has taken place; after it the loss "
        f"decreases by a further {100 * further:.0f} % of its value, "
    )
    text += (
        "so it has reached a plateau, which agrees with the paper. "
        if further <= RESTING
        else "so it has not reached a plateau, which contradicts the paper. "
    )
    text += (
        f"At the early stop, after {np.median(stops):.0f} iterations (median; paper: "
        f"{PAPER_EARLY_STOP}), {100 * np.median(at_stop):.0f} % of the decrease has taken place. "
        f"{_jumps(courses, later[0])}\n\n"
        f"Fig. 4: {later[-1]} iterations take {longer:.1f} times as long as those up to the early "
        f"stop (median). In between, the greatest distance of the curves is "
        f"{np.median(greatest):.2f} % of the diagonal (median) and {max(greatest):.2f} % on the "
        f"worst set. {same} of {len(courses)} curves stay within {INDISTINGUISHABLE:g} %, "
    )
    text += (
        "which agrees with the paper's “nearly indistinguishable”."
        if same == len(courses)
        else "so the paper's “nearly indistinguishable” holds only for those."
        if same
        else "which contradicts the paper's “nearly indistinguishable”."
    )
    changing = sum(len(set(course["by_itself"])) > 1 for course in courses)
    if changing:
        text += (
            f" On {changing} sets the level set was one loop by itself at some of these iterations "
            "and not at others; on these the part of the curve that follows φ₀ changes."
        )
    return text


def _jumps(courses: Sequence[Results], after: int) -> str:
    """Sentence about the sets on which the loss exceeds its initial value after an iteration."""
    heights = {
        course["mesh"]: np.nanmax(_losses(course)[after:]) / _losses(course)[0]
        for course in courses
    }
    jumping = [name for name, height in heights.items() if height > 1.0]
    if not jumping:
        return f"After iteration {after} no loss exceeds its initial value."
    return (
        f"After iteration {after} the loss jumps above its initial value on {len(jumping)} of "
        f"{len(courses)} sets ({report.listed(jumping)}), to up to {max(heights.values()):.0f} "
        "times that value. This agrees with the paper, which warns of “numerical instability” "
        "after too many iterations. The result is the field with the lowest loss."
    )
