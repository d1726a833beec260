"""How fast the loss falls and how little the curve changes after the early stop (Fig. 3, 4)."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from nicmm_core.geometry.array_types import FloatArray
from nicmm_core.geometry.curve import SurfaceCurve
from nicmm_core.network.finetuning import FinetuningConfig, finetune
from nicmm_core.network.trainable_network import CurveNetwork, load_network
from nicmm_core.status import Status

from . import collections, plots, renders, report
from .scale import Scale
from .solving import (
    Sample,
    designed_curve,
    random_samples,
    relative_distances,
    without_early_stop,
)

SEED = 3
LATER = (100, 200, 500)
"""Iterations at which the curve is looked at again, as in Fig. 4."""

PAPER_EARLY_STOP = 41
PAPER_PLATEAU = 200
"""Iterations of the early stop in Fig. 4, and from which on the loss rests (Fig. 3)."""

INDISTINGUISHABLE = 1.0
"""Greatest distance in percent of the diagonal up to which two curves look the same."""

RESTING = 0.1
"""Share of its value that a loss may fall further when it is said to rest."""

PICTURED = 3
COLOURS = (renders.BLUE, renders.ORANGE, renders.GREEN, renders.YELLOW)


@dataclass(frozen=True)
class Course:
    """One fine-tuning run, continued far beyond its early stop.

    Attributes
    ----------
    sample : Sample
    stop : int
        Iteration of the early stop.
    early : bool
        Whether it was one, and not the cap.
    losses : list of float
        Of every iteration.
    curves : list of SurfaceCurve
        At the early stop and later.
    by_itself : list of bool
        Which of them were one loop before the topology was held.
    seconds : list of float
        Of fine-tuning until then.
    """

    sample: Sample
    stop: int
    early: bool
    losses: list[float]
    curves: list[SurfaceCurve]
    by_itself: list[bool]
    seconds: list[float]


def run(scale: Scale) -> None:
    """Continue fine-tuning beyond its early stop, on several meshes."""
    network = load_network()
    meshes = collections.surfaces(scale, scale.choose(8, 1))
    courses = [_followed(network, sample) for sample in random_samples(meshes, 1, SEED)]
    if not courses:
        raise SystemExit("No set had a simple loop through its points; there is nothing to follow")
    body = (
        f"Seed {SEED}, one set of 3–5 random vertices a mesh, shortest order, "
        f"{collections.label(scale)}, shipped weights. Distances are mean / greatest in percent "
        "of the bounding box's diagonal; seconds are of the prediction stage alone.\n\n"
        f"{_table(courses)}\n\n{_findings(courses)}\n\n{_loss_plot(courses, scale)}\n\n"
        f"{_stills(courses, scale)}"
    )
    report.write_section("convergence", "Convergence and early stop (Fig. 3, Fig. 4)", body, scale)


def _followed(network: CurveNetwork, sample: Sample) -> Course:
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
    print(f"  {sample.name}: {early.status} at {early.iterations}", flush=True)
    return Course(
        sample=sample,
        stop=early.iterations,
        early=early.status == Status.CONVERGED,
        losses=losses,
        curves=[curve for curve, _ in outcomes],
        by_itself=[by_itself for _, by_itself in outcomes],
        seconds=[seconds[iteration] for iteration in wanted],
    )


def _distances(course: Course) -> list[tuple[float, float]]:
    """From each curve to the next, and from the first to the last."""
    pairs = [*zip(course.curves, course.curves[1:], strict=False)]
    pairs.append((course.curves[0], course.curves[-1]))
    return [relative_distances(course.sample, *pair) for pair in pairs]


def _fallen(course: Course, iteration: int) -> float:
    """Share of the loss's fall, from the start to the end, that is done by an iteration."""
    least = np.fmin.accumulate(course.losses)
    whole = least[0] - least[-1]
    return float((least[0] - least[iteration]) / whole) if whole > 0.0 else 1.0


def _table(courses: Sequence[Course]) -> str:
    rows: list[tuple[object, ...]] = []
    for course in courses:
        rows.append(
            (
                course.sample.name,
                f"{course.stop}" if course.early else f"{course.stop} (cap)",
                " · ".join(f"{value:.1f}" for value in course.seconds),
                *(f"{mean:.2f} / {most:.2f}" for mean, most in _distances(course)),
                " ".join("yes" if one else "no" for one in course.by_itself),
                f"{100 * _fallen(course, PAPER_PLATEAU):.0f} %",
            )
        )
    rows.append(
        ("paper, Fig. 4", PAPER_EARLY_STOP, "–", *["“nearly indistinguishable”"] * 4, "–",
         "“notably plateaus”")
    )  # fmt: skip
    later = " · ".join(map(str, LATER))
    header = (
        "mesh", "early stop", f"seconds at the stop · {later}", "stop to 100", "100 to 200",
        "200 to 500", "stop to 500", f"one loop by itself at the stop, {later}",
        f"loss fallen by iteration {PAPER_PLATEAU}",
    )  # fmt: skip
    return report.table(header, rows)


def _findings(courses: Sequence[Course]) -> str:
    """What the table says, in words."""
    stops = [course.stop for course in courses]
    greatest = [_distances(course)[-1][1] for course in courses]
    same = sum(value <= INDISTINGUISHABLE for value in greatest)
    fallen = [_fallen(course, PAPER_PLATEAU) for course in courses]
    at_stop = [_fallen(course, min(course.stop, LATER[-1])) for course in courses]
    least = [np.fmin.accumulate(course.losses) for course in courses]
    further = float(np.median([1.0 - one[-1] / one[PAPER_PLATEAU] for one in least]))
    longer = float(np.median([course.seconds[-1] / course.seconds[0] for course in courses]))
    text = (
        f"Fig. 3: by iteration {PAPER_PLATEAU} the loss has fallen by "
        f"{100 * np.median(fallen):.0f} % (median) of what it falls until {LATER[-1]}, "
    )
    text += f"and falls by a further {100 * further:.0f} % of its value there" + (
        ": it rests, as in the paper. "
        if further <= RESTING
        else ": most of the way is done, but it does not rest as in the paper. "
    )
    text += (
        f"At the early stop, after {np.median(stops):.0f} iterations (median; paper: "
        f"{PAPER_EARLY_STOP}), it has fallen by {100 * np.median(at_stop):.0f} %. "
        f"{_jumps(courses)}\n\n"
        f"Fig. 4: {LATER[-1]} iterations take {longer:.1f} times as long as the early stop "
        f"(median). From there to {LATER[-1]} the curve moves by at most "
        f"{np.median(greatest):.2f} % of the diagonal by the median and {max(greatest):.2f} % on "
        f"the worst set; {same} of {len(courses)} stay within {INDISTINGUISHABLE:g} %, "
    )
    text += (
        "which agrees with the paper's “nearly indistinguishable”."
        if same == len(courses)
        else "so curves are “nearly indistinguishable” as in the paper only on those."
        if same
        else "which contradicts the paper's “nearly indistinguishable”."
    )
    changing = sum(len(set(course.by_itself)) > 1 for course in courses)
    if changing:
        text += (
            f" On {changing} sets the level set was one loop by itself at some of these iterations "
            "and not at others; there the part of the curve that follows φ₀ changes."
        )
    return text


def _jumps(courses: Sequence[Course]) -> str:
    """On how many sets the loss left its course after the early iterations."""
    heights = {
        course.sample.name: max(course.losses[LATER[0] :]) / course.losses[0] for course in courses
    }
    jumping = [name for name, height in heights.items() if height > 1.0]
    if not jumping:
        return f"After iteration {LATER[0]} no loss ever exceeds that of the start."
    return (
        f"After iteration {LATER[0]} the loss jumps above that of the start on {len(jumping)} of "
        f"{len(courses)} sets ({report.listed(jumping)}), up to {max(heights.values()):.0f} times "
        "that value: the “numerical instability” of too many iterations that the paper warns of. "
        "The field of the least loss is kept."
    )


def _loss_plot(courses: Sequence[Course], scale: Scale) -> str:
    figure, axes = plots.labelled("Loss of every iteration (Fig. 3)", "iteration", "total loss")
    for course in courses:
        (line,) = axes.plot(course.losses, linewidth=1.0, label=course.sample.name)
        stop = min(course.stop, len(course.losses)) - 1
        axes.plot(stop, course.losses[stop], "o", color=line.get_color())
    axes.axvline(PAPER_PLATEAU, color="0.4", linestyle="--", linewidth=1)
    axes.set_yscale("log")
    plots.plain_ticks(axes.yaxis)
    axes.legend(fontsize=8, ncols=2)
    path = plots.save(figure, report.output_folder(scale) / "convergence.png")
    return report.figure(
        path,
        "Loss against the iteration; dots: early stop; dashed: where the paper sees a plateau",
    )


def _stills(courses: Sequence[Course], scale: Scale) -> str:
    pictures = [
        renders.Picture(
            f"{course.sample.name}, early stop after {course.stop}",
            course.sample.mesh,
            list(zip(course.curves, COLOURS, strict=True)),
        )
        for course in courses[:PICTURED]
    ]
    path = report.output_folder(scale) / "convergence_curves.png"
    renders.render_sheet(pictures, path, scale, columns=PICTURED)
    return report.figure(
        path, "Curves at the early stop (blue), 100 (orange), 200 (green) and 500 (yellow)"
    )
