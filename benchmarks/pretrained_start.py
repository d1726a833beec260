"""What the network is worth as the start of a relaxation: ``method="nicmm"`` from other starts.

The curve that is relaxed decides what there is to do and in which local optimum it ends. Designs
are made as always, but with another φ in the network's place. A random change of φ₀ is among the
starts, because another start is now and then a better one by chance; what pretraining is worth is
what it does beyond that.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from unittest import mock

import numpy as np

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.courses import course_surface
from nicmm_core.geometry.array_types import BoolArray, FloatArray, IntArray
from nicmm_core.geometry.mesh import Mesh
from nicmm_core.level_set.features import BASE_CHANNELS
from nicmm_core.level_set.problem import Problem
from nicmm_core.level_set.solution import Solution
from nicmm_core.level_set.zero_set import ZeroSet, zero_set
from nicmm_core.network import single_pass
from nicmm_core.network.forward_pass import NetworkWeights
from nicmm_core.network.single_pass import infer_level_set
from nicmm_core.network.trainable_network import network_weights
from nicmm_core.network.weights_file import shipped_weights
from nicmm_core.status import Status

from . import collections, plots, report
from .evidence import Results
from .guarantee import NEARLY_STRAIGHT
from .measures import bending
from .samples import random_sets
from .scale import Scale
from .solving import random_field, significant, untrained

TITLE = "Starts of the relaxation"
TIMED = True
WITHOUT = ("outputs", "splines")

SEED = 21
DISTURBANCE_SEED = 22

FIRST_UNSEEN_BODY = 1000
"""Seed of the first generated body; pretraining has those from 0."""

DISTURBANCE = 0.1
"""Mean slope of what is added to φ₀, whose own is 1: it moves the curve by about an edge length."""

NO_NETWORK, UNTRAINED = "φ₀, without a network", "network before training"
SHIPPED, DISTURBED = "shipped weights", "φ₀ with random waves"

KINDS = {
    "closed, shortest order": ("shortest", True),
    "closed, order as drawn": ("given", True),
    "open, shortest order": ("shortest", False),
}

CLEARLY = 0.02
"""Relative difference of bending from which a curve counts as fairer than another."""

FAR = 1.2
"""Bending relative to the fairest curve known from which a curve counts as far from it."""

SHARES = (0.5, 0.75, 0.9)
"""Of the sets, that the table gives the values of."""


Field = Callable[[Problem], FloatArray]
"""What stands in the network's place."""


Rests = dict[str, list[Results]]
"""By start, what came of it, one entry a set."""


def measure(scale: Scale) -> Results:
    """Relax from every start on meshes that the weights were not trained on."""
    meshes = [*_meshes(scale)]
    return {
        "seed": SEED,
        "disturbance_seed": DISTURBANCE_SEED,
        "disturbance": DISTURBANCE,
        "meshes": len(meshes),
        "collection": _names(scale),
        "sets": _relaxed(random_sets(meshes, 1, SEED)),
    }


def section(results: Results) -> str:
    """What each start costs and where it ends."""
    by_kind = {
        kind: _rests([each for each in results["sets"] if each["curve"] == kind])
        for kind in dict.fromkeys(each["curve"] for each in results["sets"])
    }
    pooled = _rests(results["sets"])
    figure = report.figure(
        "pretrained_start.png", "Share of the sets at or below each ratio to the best known"
    )
    return (
        f"Seed {results['seed']}, one set of 3–5 random vertices a mesh, asked for as three "
        f"curves, on {results['meshes']} meshes that the shipped weights have not seen: "
        f"{results['collection']}. Designs by "
        "`nicmm`, with another φ in the network's place, by a Designer that knows the mesh. "
        f"“{DISTURBED}” adds a random smooth function of mean slope {results['disturbance']:g} to "
        f"φ₀ (seed {results['disturbance_seed']}). Time is the CPU time of the whole design.\n\n"
        f"{_table(by_kind)}\n\nBending is L ∫ κ_g² ds; what is "
        f"below {NEARLY_STRAIGHT} counts as that. The best known is the least of these "
        f"{len(pooled)} ends. “To φ₀” is the geometric mean of the ratio of the ends, with its "
        f"standard error; fairer and less fair by more than {100 * CLEARLY:.0f} %.\n\n"
        f"{_findings(pooled)}\n\n{figure}"
    )


def draw(results: Results, folder: Path) -> None:
    """Draw how far from the best known the curves of each start end."""
    figure, axes = plots.labelled(
        "Converged curves from several starts",
        "L ∫ κ_g² ds relative to the best known",
        "share of the sets",
    )
    for label, ratios in _to_best(_rests(results["sets"])).items():
        shares = (np.arange(len(ratios)) + 1.0) / len(ratios)
        axes.step(np.sort(ratios), shares, where="post", label=label)
    axes.set_xscale("log")
    plots.plain_ticks(axes.xaxis)
    axes.legend(fontsize=8, loc="lower right")
    plots.save(figure, folder / "pretrained_start.png")


def _meshes(scale: Scale) -> Iterator[tuple[str, Mesh]]:
    if scale is not Scale.SMOKE:
        yield from collections.shrec16(scale.choose(48, 4))
    for seed in range(FIRST_UNSEEN_BODY, FIRST_UNSEEN_BODY + scale.choose(12, 2, 1)):
        yield f"body {seed}", shapes.creature(seed)


def _names(scale: Scale) -> str:
    bodies = f"generated bodies from seed {FIRST_UNSEEN_BODY}"
    return bodies if scale is Scale.SMOKE else f"SHREC16, two Loop subdivisions, and {bodies}"


def _disturbed(problem: Problem) -> FloatArray:
    return problem.initial_distance + DISTURBANCE * random_field(problem, DISTURBANCE_SEED)


def _network(weights: NetworkWeights) -> Field:
    return lambda problem: infer_level_set(weights, problem).field


STARTS: dict[str, Callable[[], Field]] = {
    NO_NETWORK: lambda: lambda problem: problem.initial_distance,
    UNTRAINED: lambda: _network(network_weights(untrained())),
    SHIPPED: lambda: _network(shipped_weights(BASE_CHANNELS)),
    DISTURBED: lambda: _disturbed,
}
"""What makes a start, for a run."""


def _relaxed(sets: Iterable[tuple[str, Mesh, IntArray]]) -> list[Results]:
    """What came of every set and kind of curve; what cannot be asked for is named and left out."""
    fields = {label: make() for label, make in STARTS.items()}
    found: list[Results] = []
    for name, mesh, points in sets:
        designer = nicmm.Designer(mesh)
        for kind, (order, closed) in KINDS.items():
            try:
                # What depends on the mesh alone is found here and not measured.
                designer.design(points, closed=closed, order=order)
            except nicmm.UnreachableError as error:
                print(f"  {name}, {kind}: {error}", flush=True)
                continue
            rests = {
                label: _rest(designer, points, closed, order, field)
                for label, field in fields.items()
            }
            found.append({"mesh": name, "curve": kind, "rests": rests})
            ends = ", ".join(f"{rest['end']:.1f}" for rest in rests.values())
            print(f"  {name}, {kind}: {ends}", flush=True)
    if not found:
        raise SystemExit("No set had a simple path through its points; there is nothing to measure")
    return sorted(found, key=lambda each: [*KINDS].index(each["curve"]))


def _rest(
    designer: nicmm.Designer, points: IntArray, closed: bool, order: str, field: Field
) -> Results:
    """What came of one start.

    It is repaired if the topology of φ₀ had to be restored somewhere. Start and end are the bending
    L ∫ κ_g² ds before and after relaxation, and seconds the CPU time of the design.
    """
    with _instead_of_the_network(field) as level_sets:
        began = time.process_time()
        design = designer.design(points, closed=closed, order=order)
        seconds = time.process_time() - began
    # The last of them is the one that gave a curve.
    mesh, zeros = level_sets[-1]
    return {
        "repaired": bool(zeros.breaking_vertices > 0),
        "start": significant(bending(mesh, zeros.curves[0])),
        "end": significant(bending(designer.mesh, design.curves[0])),
        "iterations": design.iterations,
        "status": design.status.name,
        "seconds": round(seconds, 4),
    }


@contextmanager
def _instead_of_the_network(field: Field) -> Iterator[list[tuple[Mesh, ZeroSet]]]:
    """Let designs start from a field; collects the level sets that they make of it."""
    level_sets: list[tuple[Mesh, ZeroSet]] = []

    def solution(weights: NetworkWeights, problem: Problem) -> Solution:
        return Solution(field(problem), {}, [], Status.CONVERGED)

    def collected(mesh: Mesh, problem: Problem, phi: FloatArray) -> ZeroSet:
        level_sets.append((mesh, zero_set(mesh, problem, phi)))
        return level_sets[-1][1]

    with (
        mock.patch.object(single_pass, "infer_level_set", solution),
        mock.patch.object(single_pass, "zero_set", collected),
        mock.patch.object(course_surface, "find_courses", lambda *arguments, **named: iter(())),
    ):
        yield level_sets


def _rests(sets: Sequence[Results]) -> Rests:
    return {label: [each["rests"][label] for each in sets] for label in sets[0]["rests"]}


def _failed(rest: Results) -> bool:
    """Whether there is no relaxed curve."""
    return rest["status"] in (nicmm.Status.NOT_ONE_CURVE.name, nicmm.Status.UNRELAXED.name)


def _ends(rests: Rests) -> dict[str, FloatArray]:
    """Bending of the ends, by start; ratios between nearly straight curves say nothing."""
    return {
        label: np.maximum([one["end"] for one in of_start], NEARLY_STRAIGHT)
        for label, of_start in rests.items()
    }


def _to_best(rests: Rests) -> dict[str, FloatArray]:
    """Bending relative to the best known of each set, by start."""
    ends = _ends(rests)
    best = np.min(list(ends.values()), axis=0)
    return {label: values / best for label, values in ends.items()}


def _gain(rests: Rests, label: str) -> tuple[float, float]:
    """Mean of the logarithm of the ratio to the ends from φ₀, and its standard error."""
    ends = _ends(rests)
    logarithm = np.log(ends[label] / ends[NO_NETWORK])
    return float(logarithm.mean()), float(logarithm.std() / np.sqrt(len(logarithm)))


def _table(by_kind: Mapping[str, Rests]) -> str:
    header = (
        "curves", "start", "sets", "topology repaired", "failed", "bending of the start",
        "iterations, median · mean", "at the cap", "design (ms), mean", "bending of the end",
        f"relative to the best known, {' · '.join(f'{100 * share:.0f} %' for share in SHARES)}",
        f"above {FAR:g}", "to φ₀", "fairer · less fair",
    )  # fmt: skip
    rows = []
    for kind, of_kind in by_kind.items():
        to_best, ends = _to_best(of_kind), _ends(of_kind)
        for label, rests in of_kind.items():
            mean, error = _gain(of_kind, label)
            against = ends[label] / ends[NO_NETWORK]
            wins = (against < 1.0 - CLEARLY).sum(), (against > 1.0 + CLEARLY).sum()
            iterations = [one["iterations"] for one in rests]
            quantiles = np.quantile(to_best[label], SHARES)
            rows.append(
                (
                    kind,
                    label,
                    len(rests),
                    _percent([one["repaired"] for one in rests]),
                    sum(_failed(one) for one in rests),
                    f"{np.median([one['start'] for one in rests]):.0f}",
                    f"{np.median(iterations):.0f} · {np.mean(iterations):.1f}",
                    sum(one["status"] == nicmm.Status.ITERATION_LIMIT.name for one in rests),
                    f"{1000 * np.mean([one['seconds'] for one in rests]):.0f}",
                    f"{np.median(ends[label]):.1f}",
                    " · ".join(f"{value:.2f}" for value in quantiles),
                    _percent(to_best[label] > FAR),
                    "–" if label == NO_NETWORK else f"{np.exp(mean):.3f} ± {error:.3f}",
                    "–" if label == NO_NETWORK else f"{wins[0]} · {wins[1]}",
                )
            )
    return report.table(header, rows)


def _percent(flags: Sequence[bool] | BoolArray) -> str:
    return f"{100 * np.mean(flags):.0f} %"


def _findings(pooled: Rests) -> str:
    """What the table says of all kinds together, in words."""
    means = {
        label: np.mean([one["iterations"] for one in rests]) for label, rests in pooled.items()
    }
    seconds = {label: np.mean([one["seconds"] for one in rests]) for label, rests in pooled.items()}
    starts = {label: np.median([one["start"] for one in rests]) for label, rests in pooled.items()}
    text = (
        f"Over all {len(pooled[NO_NETWORK])} sets, the shipped weights start with "
        f"{starts[SHIPPED] / starts[NO_NETWORK]:.2f} times the bending of φ₀ (medians), take "
        f"{means[SHIPPED] / means[NO_NETWORK]:.2f} times its iterations and "
        f"{seconds[SHIPPED] / seconds[NO_NETWORK]:.2f} times its time (means). "
    )
    for label in (SHIPPED, DISTURBED):
        mean, error = _gain(pooled, label)
        subject = "They end" if label == SHIPPED else f"From “{label}” it ends"
        text += f"{subject} with {np.exp(mean):.3f} times the bending ({error:.3f} standard error)"
        if abs(mean) <= 2.0 * error:
            text += ", which is no difference"
        text += ". "
    shipped, error = _gain(pooled, SHIPPED)
    chance, other_error = _gain(pooled, DISTURBED)
    if shipped + 2.0 * np.hypot(error, other_error) < chance:
        return text + "So pretraining finds fairer courses than chance does."
    return text + (
        "So pretraining does not choose a fairer course than chance does: it is another start, and "
        "any other start finds another local optimum on some sets."
    )
