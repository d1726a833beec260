"""Measures how the curve depends on the initial loop (Fig. 6)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

import nicmm_core as nicmm
from nicmm_core.geometry.array_types import FloatArray
from nicmm_core.geometry.curve import SurfaceCurve, is_one_curve
from nicmm_core.geometry.mesh import Mesh
from nicmm_core.geometry.surface_points import locate_control_points
from nicmm_core.paper.features import BASE_CHANNELS
from nicmm_core.paper.fitting import fit
from nicmm_core.paper.network import DISTANCE_CHANNEL, Network
from nicmm_core.paper.problem import Problem, build_problem
from nicmm_core.paper.signed_distance import heat_distance
from nicmm_core.paper.weights_file import load_network

from . import collections, plots, renders, report
from .evidence import NETWORK, Results
from .polylines import initial_path
from .scale import Scale
from .solving import (
    Sample,
    designed_curve,
    random_field,
    random_samples,
    relative_distances,
    significant,
    unrepaired_curves,
)

TITLE = "Sensitivity to the initial loop (Fig. 6)"
ROOMS = NETWORK

SEED = 6
RANDOM_SEED = 16

SHORTEST = "shortest"
OUTWARDS, INWARDS, WAVY = "pushed outwards", "pushed inwards", "wavy"
LOOPS = (SHORTEST, OUTWARDS, INWARDS, WAVY)
UNSIGNED, RANDOM = "distance to the points, without sign", "random smooth field"

PUSH = 0.05
"""Distance by which a loop is displaced, in √area."""

WIDTH = 0.15
"""Extent of the obstacle on the side from which the loop is displaced, in √area."""

CLEARANCE = 0.06
"""Distance from the control points within which there is no obstacle, in √area."""

WAVES = 3
"""Number of waves of the wavy loop, each to both sides."""

STILLS = "initial_curves.png"
PICTURED = 2


@dataclass(frozen=True)
class Outcome:
    """Result of the fit from one initial loop.

    Attributes
    ----------
    start, curve : SurfaceCurve
        Initial loop, and the resulting curve.
    by_itself : bool
        Whether every step kept one loop without holding a vertex.
    iterations : int
        Iterations up to the early stop.
    loss : float
        Lowest loss.
    """

    start: SurfaceCurve
    curve: SurfaceCurve
    by_itself: bool
    iterations: int
    loss: float


def measure(scale: Scale) -> Results:
    """Compare curves through the same points from several initial loops and without a loop."""
    network = load_network()
    meshes = collections.surfaces(scale, scale.choose(12, 1))
    compared: list[Results] = []
    shown: list[tuple[Sample, dict[str, Outcome]]] = []
    for sample in random_samples(meshes, 1, SEED):
        outcomes = _with_loops(network, sample)
        base = outcomes[SHORTEST]
        compared.append(
            {
                "mesh": sample.name,
                "with_loop": {
                    label: _compared(sample, outcome, base) for label, outcome in outcomes.items()
                },
                "without_loop": _without_loops(network, sample, base.curve),
            }
        )
        shown.append((sample, outcomes))
        print(f"  {sample.name}: {report.listed(outcomes)}", flush=True)
    if not compared:
        raise SystemExit("No set had a simple loop through its points; there is nothing to compare")
    _render(shown, scale)
    return {
        "seed": SEED,
        "random_seed": RANDOM_SEED,
        "collection": collections.label(scale),
        "push": PUSH,
        "loops": list(LOOPS),
        "compared": compared,
        "stills": STILLS,
    }


def section(results: Results) -> str:
    """How much of the difference between the loops remains in the curves."""
    compared, loops = results["compared"], results["loops"]
    plot = report.figure(
        "initial.png",
        "Distance of the curves against the distance of the loops they start from, both to the "
        "shortest loop and its curve; each dot is a mesh",
    )
    stills = report.figure(
        results["stills"], "Initial loops (white) and the curves from them (blue) (Fig. 6)"
    )
    return (
        "Curves through the same control points were computed by `nicmm` from different "
        "initial loops, to see how much the curve depends on the loop, as in Fig. 6 of the paper. "
        "Each row is a kind of loop: the shortest one, and loops through the same points in the "
        f"same order that are displaced between them by {results['push']:g} √area or more, by an "
        "obstacle that affects only the initial loop. Distances are mean and greatest distances "
        "from the loop to the shortest loop, and from the curve to the curve of the shortest loop, "
        "in percent of the bounding box diagonal. Distances, iterations and losses are medians "
        f"over {len(compared)} meshes, with one set of 3–5 random vertices per mesh (seed "
        f"{results['seed']}). The fit starts from the shipped weights and ends at the early stop; "
        "λ is the same for all loops of a set. Meshes "
        f"({results['collection']}): {report.listed(one['mesh'] for one in compared)}.\n\n"
        f"{_loop_table(compared, loops)}\n\n{_loop_findings(compared, loops)}\n\n"
        f"{plot}\n\n{stills}\n\n"
        "### Without an initial loop\n\nOne curve of Fig. 6 starts from the distance to the "
        "control points alone. The paper does not say how this distance gets a sign, so the table "
        "shows two replacements for φ₀: the distance, positive everywhere, and a random smooth "
        f"field that is zero at the points (seed {results['random_seed']}). The replacement is "
        "both an input of the network and the field that its output is added to. The fit keeps the "
        "topology of the level set of the replacement, which need not be a loop. "
        "Distances are to the curve of the shortest loop, in percent of the diagonal.\n\n"
        f"{_none_table(compared)}\n\n{_none_findings(compared)}"
    )


def draw(results: Results, folder: Path) -> None:
    """Plot the distances of the curves against the distances of the loops."""
    figure, axes = plots.labelled(
        "Curves from different initial loops (Fig. 6)",
        "mean distance of the loop to the shortest loop (% of the diagonal)",
        "mean distance of their curves (% of the diagonal)",
    )
    farthest = 0.0
    for label in results["loops"][1:]:
        pairs = np.array(_pairs(results["compared"], label)).reshape(-1, 2, 2)[:, :, 0]
        axes.plot(pairs[:, 0], pairs[:, 1], "o", label=label)
        farthest = max(farthest, float(pairs.max(initial=0.0)))
    ends = [0.0, farthest]
    axes.plot(ends, ends, "--", color="0.5", linewidth=1, label="curves as far apart as the loops")
    axes.legend()
    plots.save(figure, folder / "initial.png")


def _with_loops(network: Network, sample: Sample) -> dict[str, Outcome]:
    """Outcome of each initial loop; loops that cannot be made are reported and left out."""
    outcomes = {SHORTEST: _outcome(network, sample)}
    for label, obstacle in _obstacles(sample).items():
        try:
            moved = replace(sample, problem=_problem_round(sample, obstacle))
        except nicmm.UnreachableError as error:
            print(f"  {sample.name}, {label}: {error}", flush=True)
            continue
        outcomes[label] = _outcome(network, moved)
    return outcomes


def _outcome(network: Network, sample: Sample) -> Outcome:
    fitted = fit(network, sample.problem, sample.weights)
    return Outcome(
        initial_path(sample.mesh, sample.problem),
        designed_curve(sample, fitted.field),
        fitted.held == 0,
        fitted.iterations,
        min(fitted.losses),
    )


def _compared(sample: Sample, outcome: Outcome, base: Outcome) -> Results:
    """Summary of an outcome; the distances are those of the loop and of the curve."""
    loops = relative_distances(sample, outcome.start, base.start)
    curves = relative_distances(sample, outcome.curve, base.curve)
    return {
        "distances": [[significant(value) for value in pair] for pair in (loops, curves)],
        "by_itself": bool(outcome.by_itself),
        "iterations": outcome.iterations,
        "loss": significant(outcome.loss),
    }


def _obstacles(sample: Sample) -> dict[str, FloatArray]:
    """Obstacles on one side of the shortest loop, which displace it to the other side."""
    mesh, problem = sample.mesh, sample.problem
    side_distance = _at_vertices(mesh, problem)
    from_points, _ = cKDTree(mesh.vertices[sample.points]).query(mesh.vertices)
    free = from_points > CLEARANCE * problem.unit
    on_loop = problem.working.vertices[problem.loop.vertices]
    _, nearest = cKDTree(on_loop).query(mesh.vertices)
    step = np.linalg.norm(on_loop - np.roll(on_loop, 1, axis=0), axis=1)
    along = step.cumsum()[nearest] / step.sum()
    same = np.ones(len(mesh.vertices))
    alternating = np.where(2 * WAVES * along % 2 < 1, 1.0, -1.0)
    sides = {OUTWARDS: same, INWARDS: -same, WAVY: alternating}
    obstacles = {}
    for label, side in sides.items():
        towards = side * side_distance
        obstacles[label] = (free & (towards > -WIDTH) & (towards < PUSH)).astype(np.float64)
    return obstacles


def _at_vertices(mesh: Mesh, problem: Problem) -> FloatArray:
    """Signed distance to the initial loop at the vertices; infinite on other components."""
    inputs = problem.working.input_vertex
    values = np.full(len(mesh.vertices), np.inf)
    values[inputs[inputs >= 0]] = problem.distance[inputs >= 0]
    return values


def _problem_round(sample: Sample, obstacle: FloatArray) -> Problem:
    """Problem whose initial loop avoids an obstacle that affects neither features nor energy."""
    points = locate_control_points(sample.mesh, sample.points, True)
    problem = build_problem(sample.mesh, points, "shortest", obstacles=obstacle)
    return replace(problem, feature_map=None, features=problem.features[:, :BASE_CHANNELS])


def _without_loops(network: Network, sample: Sample, reference: SurfaceCurve) -> dict[str, Results]:
    """Level sets for fields in place of φ₀ that do not come from a loop.

    A level set that is one closed curve through all control points is compared with the reference.
    """
    problem = sample.problem
    fields = {
        UNSIGNED: np.abs(
            heat_distance(problem.elements, problem.loop.control_vertices, problem.edge_length**2)
        ),
        RANDOM: random_field(problem, RANDOM_SEED),
    }
    outcomes = {}
    for label, field in fields.items():
        start = problem.smoother.interpolating(field)
        features = problem.features.copy()
        features[:, DISTANCE_CHANNEL] = start
        blind = replace(problem, initial_distance=start, features=features)
        curves = unrepaired_curves(sample, fit(network, blind, sample.weights).field)
        one = is_one_curve(curves)
        distance = relative_distances(sample, curves[0], reference) if one else None
        outcomes[label] = {
            "pieces": len(curves),
            "one_loop": bool(one),
            "distance": distance and [significant(value) for value in distance],
        }
    return outcomes


def _render(shown: Sequence[tuple[Sample, dict[str, Outcome]]], scale: Scale) -> None:
    """Render some meshes, with the same view for all curves on a mesh."""
    pictures: list[renders.Picture] = []
    views: list[FloatArray] = []
    # Where vertices had to be held, the pictures show less of the method itself.
    telling = sorted(shown, key=lambda one: -sum(o.by_itself for o in one[1].values()))
    for sample, outcomes in telling[:PICTURED]:
        row = [_picture(sample, label, outcome) for label, outcome in outcomes.items()]
        pictures += row
        # The same camera for the whole row, so that the curves can be compared.
        views += [renders.best_view(row[0])] * len(row)
    path = report.figures_folder(scale) / STILLS
    renders.render_sheet(pictures, path, scale, columns=len(LOOPS), views=views)


def _picture(sample: Sample, label: str, outcome: Outcome) -> renders.Picture:
    curves = [(outcome.start, renders.WHITE), (outcome.curve, renders.BLUE)]
    return renders.Picture(f"{sample.name}, {label}", sample.mesh, curves)


def _pairs(compared: Sequence[Results], label: str) -> list[list[list[float]]]:
    """Distances of loop and curve to the shortest loop and its curve, on each mesh."""
    return [one["with_loop"][label]["distances"] for one in compared if label in one["with_loop"]]


def _both_by_themselves(compared: Sequence[Results], label: str) -> list[bool]:
    """For each of `_pairs`, whether no vertex had to be held for either curve."""
    return [
        one["with_loop"][label]["by_itself"] and one["with_loop"][SHORTEST]["by_itself"]
        for one in compared
        if label in one["with_loop"]
    ]


def _loop_table(compared: Sequence[Results], labels: Sequence[str]) -> str:
    rows: list[tuple[object, ...]] = []
    for label in labels:
        found = [one["with_loop"][label] for one in compared if label in one["with_loop"]]
        if not found:
            rows.append((label, 0, *["–"] * 7))
            continue
        distances = np.median(np.array(_pairs(compared, label)), axis=0).ravel()
        shown = ["–"] * 4 if label == SHORTEST else [f"{value:.2f}" for value in distances]
        rows.append(
            (
                label,
                len(found),
                *shown,
                sum(outcome["by_itself"] for outcome in found),
                f"{np.median([outcome['iterations'] for outcome in found]):.0f}",
                f"{np.median([outcome['loss'] for outcome in found]):.3f}",
            )
        )
    header = (
        "initial loop", "meshes", "loop: mean distance, %", "loop: greatest distance, %",
        "curve: mean distance, %", "curve: greatest distance, %", "no vertex held",
        "iterations", "loss",
    )  # fmt: skip
    return report.table(header, rows)


def _loop_findings(compared: Sequence[Results], labels: Sequence[str]) -> str:
    """What the table shows, in words, and whether it agrees with the paper."""
    pairs = [pair for label in labels[1:] for pair in _pairs(compared, label)]
    if not pairs:
        return "No other loop could be made, so there is nothing to compare."
    loops, curves = np.array(pairs)[:, :, 0].T
    whole = np.array(
        [both for label in labels[1:] for both in _both_by_themselves(compared, label)]
    )
    kept = float(np.median(curves / loops))
    text = (
        "The paper states for Fig. 6, without numbers, that different loops give curves that "
        "differ “mainly in local geometric details”. Here the mean distance of the loops is "
        f"{np.median(loops):.2f} % of the diagonal and that of the curves "
        f"{np.median(curves):.2f} %, so {100 * kept:.0f} % of the difference remains (medians), "
    )
    if kept < 0.25:
        text += "which agrees with the paper. "
    elif kept < 0.75:
        text += (
            "which agrees with the paper only in part: the curves come closer to one another, but "
            "they do not reach a common curve. "
        )
    else:
        text += (
            "which contradicts the paper's “strong convergence robustness”: the curves stay near "
            "their initial loops. "
        )
    text += (
        f"On {int(whole.sum())} of the {len(whole)} pairs no vertex had to be held to keep "
        "the topology"
    )
    return text + (
        f"; there {100 * np.median((curves / loops)[whole]):.0f} % remains." if whole.any() else "."
    )


def _none_table(compared: Sequence[Results]) -> str:
    rows = []
    for label in (UNSIGNED, RANDOM):
        found = [one["without_loop"][label] for one in compared]
        apart = [outcome["distance"] for outcome in found if outcome["distance"] is not None]
        middle = [f"{value:.2f}" for value in np.median(apart, axis=0)] if apart else ["–"] * 2
        rows.append(
            (
                label,
                f"{sum(outcome['one_loop'] for outcome in found)} of {len(found)}",
                f"{np.median([outcome['pieces'] for outcome in found]):.0f}",
                *middle,
            )
        )
    header = (
        "in place of φ₀", "one loop through all points", "curves in the level set, median",
        "mean distance of single loops, %", "greatest distance of single loops, %",
    )  # fmt: skip
    return report.table(header, rows)


def _none_findings(compared: Sequence[Results]) -> str:
    """What the table shows, in words."""
    share = {
        label: float(np.mean([one["without_loop"][label]["one_loop"] for one in compared]))
        for label in (UNSIGNED, RANDOM)
    }
    return (
        f"With the distance to the points in place of φ₀, {100 * share[UNSIGNED]:.0f} % of the "
        "sets give one loop through all points; with a random smooth field, "
        f"{100 * share[RANDOM]:.0f} % do. In Fig. 6 that distance alone gives a curve. The fit "
        "here cannot repeat this: it neither joins the curves of a level set nor splits them, so "
        "it gives one loop only where the replacement has one. The steps of the paper may change "
        "the topology. The shipped weights were pretrained only with φ₀ from loops."
    )
