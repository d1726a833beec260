"""What the initial loop changes in the curve (Fig. 6)."""

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
from nicmm_core.level_set.features import BASE_CHANNELS
from nicmm_core.level_set.problem import Problem, build_problem
from nicmm_core.level_set.signed_distance import heat_distance
from nicmm_core.network.finetuning import FinetuningConfig, finetune
from nicmm_core.network.forward_pass import DISTANCE_CHANNEL
from nicmm_core.network.trainable_network import CurveNetwork, load_network

from . import collections, plots, renders, report
from .evidence import Results
from .polylines import initial_path
from .scale import Scale
from .solving import (
    PARTS_WITHOUT,
    Sample,
    designed_curve,
    level_set,
    random_field,
    random_samples,
    relative_distances,
    significant,
)

TITLE = "Initial loops (Fig. 6)"
WITHOUT = PARTS_WITHOUT

SEED = 6
RANDOM_SEED = 16

SHORTEST = "shortest"
OUTWARDS, INWARDS, WAVY = "pushed outwards", "pushed inwards", "wavy"
LOOPS = (SHORTEST, OUTWARDS, INWARDS, WAVY)
UNSIGNED, RANDOM = "distance to the points, without sign", "random smooth field"

PUSH = 0.05
"""How far a loop is pushed aside, in √area."""

WIDTH = 0.15
"""How far the obstacle reaches on the side that the loop is pushed from, in √area."""

CLEARANCE = 0.06
"""Distance from the control points within which nothing is pushed, in √area."""

WAVES = 3
"""Times that the wavy loop swings out to both sides."""

STILLS = "initial_curves.png"
PICTURED = 2


@dataclass(frozen=True)
class Outcome:
    """A curve from one initial loop.

    Attributes
    ----------
    start, curve : SurfaceCurve
        The loop and what became of it.
    by_itself : bool
        Whether that was one loop before the topology was held.
    iterations : int
    loss : float
    """

    start: SurfaceCurve
    curve: SurfaceCurve
    by_itself: bool
    iterations: int
    loss: float


def measure(scale: Scale) -> Results:
    """Compare curves through the same points from several initial loops, and from none."""
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
    """How much of the difference between loops remains in the curves."""
    compared, loops = results["compared"], results["loops"]
    plot = report.figure(
        "initial.png", "Each dot is a mesh: distance to the shortest loop and its curve"
    )
    stills = report.figure(
        results["stills"], "Initial loops (white) and the curves from them (blue) (Fig. 6)"
    )
    return (
        f"Seed {results['seed']}, one set of 3–5 random vertices a mesh, on {len(compared)} meshes "
        f"({results['collection']}: {report.listed(one['mesh'] for one in compared)}), shipped "
        "weights, early stop, the same λ for all loops of a set. The other loops pass the same "
        f"points in the same order and are pushed aside between them by {results['push']:g} √area "
        "or more, by an obstacle that only the initial loop sees. Distances are to the shortest "
        "loop and to the curve from it, in percent of the bounding box's diagonal; medians over "
        f"the meshes.\n\n{_loop_table(compared, loops)}\n\n{_loop_findings(compared, loops)}\n\n"
        f"{plot}\n\n{stills}\n\n"
        "### Without an initial loop\n\nFig. 6 has one curve from a distance to the control "
        "points alone. It does not say how that has a sign, so two fields stand in for φ₀, in "
        "the input and under the network's correction: that distance, positive everywhere, and a "
        f"random smooth field that is zero at the points (seed {results['random_seed']}). What is "
        "looked at is the level set itself, since there is no loop whose topology could be held."
        f"\n\n{_none_table(compared)}\n\n{_none_findings(compared)}"
    )


def draw(results: Results, folder: Path) -> None:
    """Draw the distances of the curves against those of the loops."""
    figure, axes = plots.labelled(
        "Curves from different initial loops (Fig. 6)",
        "mean distance of the loops (% of the diagonal)",
        "mean distance of the curves (% of the diagonal)",
    )
    farthest = 0.0
    for label in results["loops"][1:]:
        pairs = np.array(_pairs(results["compared"], label)).reshape(-1, 2, 2)[:, :, 0]
        axes.plot(pairs[:, 0], pairs[:, 1], "o", label=label)
        farthest = max(farthest, float(pairs.max(initial=0.0)))
    ends = [0.0, farthest]
    axes.plot(ends, ends, "--", color="0.5", linewidth=1, label="no nearer than the loops")
    axes.legend()
    plots.save(figure, folder / "initial.png")


def _with_loops(network: CurveNetwork, sample: Sample) -> dict[str, Outcome]:
    """What comes of each initial loop; one that cannot be made is named and left out."""
    outcomes = {SHORTEST: _outcome(network, sample)}
    for label, obstacle in _obstacles(sample).items():
        try:
            moved = replace(sample, problem=_problem_round(sample, obstacle))
        except nicmm.UnreachableError as error:
            print(f"  {sample.name}, {label}: {error}", flush=True)
            continue
        outcomes[label] = _outcome(network, moved)
    return outcomes


def _outcome(network: CurveNetwork, sample: Sample) -> Outcome:
    finetuned = finetune(network, sample.problem, sample.weights, FinetuningConfig())
    curve, by_itself = designed_curve(sample, finetuned.field)
    return Outcome(
        initial_path(sample.mesh, sample.problem),
        curve,
        by_itself,
        finetuned.iterations,
        min(finetuned.losses),
    )


def _compared(sample: Sample, outcome: Outcome, base: Outcome) -> Results:
    """What results keep of an outcome; distances are those of the loop and of the curve."""
    loops = relative_distances(sample, outcome.start, base.start)
    curves = relative_distances(sample, outcome.curve, base.curve)
    return {
        "distances": [[significant(value) for value in pair] for pair in (loops, curves)],
        "by_itself": bool(outcome.by_itself),
        "iterations": outcome.iterations,
        "loss": significant(outcome.loss),
    }


def _obstacles(sample: Sample) -> dict[str, FloatArray]:
    """Regions on one side of the shortest loop, which drive it to the other."""
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
    """Signed distance to the initial loop at the mesh's vertices, infinite off its component."""
    inputs = problem.working.input_vertex
    values = np.full(len(mesh.vertices), np.inf)
    values[inputs[inputs >= 0]] = problem.distance[inputs >= 0]
    return values


def _problem_round(sample: Sample, obstacle: FloatArray) -> Problem:
    """The problem with a loop that goes round an obstacle of which nothing else knows."""
    points = locate_control_points(sample.mesh, sample.points, True)
    problem = build_problem(sample.mesh, points, "shortest", obstacles=obstacle)
    return replace(problem, feature_map=None, features=problem.features[:, :BASE_CHANNELS])


def _without_loops(
    network: CurveNetwork, sample: Sample, reference: SurfaceCurve
) -> dict[str, Results]:
    """The level sets when φ₀ does not come from a loop.

    One that is a single closed curve through all control points is compared with the reference.
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
        found = finetune(network, blind, sample.weights, FinetuningConfig()).field
        curves = level_set(sample, found)
        one = is_one_curve(curves)
        distance = relative_distances(sample, curves[0], reference) if one else None
        outcomes[label] = {
            "pieces": len(curves),
            "one_loop": bool(one),
            "distance": distance and [significant(value) for value in distance],
        }
    return outcomes


def _render(shown: Sequence[tuple[Sample, dict[str, Outcome]]], scale: Scale) -> None:
    """Pictures of some meshes, each mesh from one side."""
    pictures: list[renders.Picture] = []
    views: list[FloatArray] = []
    # Where the topology was held everywhere there is less to see of the method.
    telling = sorted(shown, key=lambda one: -sum(o.by_itself for o in one[1].values()))
    for sample, outcomes in telling[:PICTURED]:
        row = [_picture(sample, label, outcome) for label, outcome in outcomes.items()]
        pictures += row
        # One camera for all, so that the curves can be compared.
        views += [renders.best_view(row[0])] * len(row)
    path = report.figures_folder(scale) / STILLS
    renders.render_sheet(pictures, path, scale, columns=len(LOOPS), views=views)


def _picture(sample: Sample, label: str, outcome: Outcome) -> renders.Picture:
    curves = [(outcome.start, renders.WHITE), (outcome.curve, renders.BLUE)]
    return renders.Picture(f"{sample.name}, {label}", sample.mesh, curves)


def _pairs(compared: Sequence[Results], label: str) -> list[list[list[float]]]:
    """Distances of the loop and of the curve to those of the shortest loop, on every mesh."""
    return [one["with_loop"][label]["distances"] for one in compared if label in one["with_loop"]]


def _both_by_themselves(compared: Sequence[Results], label: str) -> list[bool]:
    """For each of `_pairs`, whether neither topology had to be held."""
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
        "initial loop", "meshes", "loop: mean distance", "greatest", "curve: mean distance",
        "greatest", "one loop by itself", "iterations", "loss",
    )  # fmt: skip
    return report.table(header, rows)


def _loop_findings(compared: Sequence[Results], labels: Sequence[str]) -> str:
    """What the table says, in words."""
    pairs = [pair for label in labels[1:] for pair in _pairs(compared, label)]
    if not pairs:
        return "No other loop could be made, so there is nothing to compare."
    loops, curves = np.array(pairs)[:, :, 0].T
    whole = np.array(
        [both for label in labels[1:] for both in _both_by_themselves(compared, label)]
    )
    kept = float(np.median(curves / loops))
    text = (
        "The paper says of Fig. 6, without numbers, that different loops give curves that differ "
        "“mainly in local geometric details”. The loops here lie "
        f"{np.median(loops):.2f} % of the diagonal apart on average and the curves from them "
        f"{np.median(curves):.2f} %: {100 * kept:.0f} % of the difference remains (medians). "
    )
    text += (
        f"On {int(whole.sum())} of these {len(whole)} pairs both level sets were one loop by "
        "themselves and nothing held them near φ₀"
    )
    text += (
        f"; there {100 * np.median((curves / loops)[whole]):.0f} % remains. "
        if whole.any()
        else ". "
    )
    if kept < 0.25:
        return text + "That agrees with the paper."
    if kept < 0.75:
        return text + (
            "The curves come closer to one another, but no common curve is reached: the result "
            "depends on the loop more than the paper's words suggest."
        )
    return text + (
        "The curves stay near the loop that they started from, which contradicts the paper's "
        "“strong convergence robustness”."
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
        "in place of φ₀", "one loop through all points", "curves in the level set (median)",
        "mean distance of those that are", "greatest",
    )  # fmt: skip
    return report.table(header, rows)


def _none_findings(compared: Sequence[Results]) -> str:
    """What the table says, in words."""
    text = ""
    for label in (UNSIGNED, RANDOM):
        share = float(np.mean([one["without_loop"][label]["one_loop"] for one in compared]))
        text += f"From the {label}, {100 * share:.0f} % of the sets give a usable curve"
        text += (
            ", which contradicts Fig. 6, where a distance to the points alone gives a curve. "
            if label == UNSIGNED and share < 0.5
            else ". "
        )
    return text + "The shipped weights have seen φ₀ from loops only."
