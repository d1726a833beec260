"""Measures the value of the network as the start of the relaxation in ``method="nicmm"``.

The start determines how much work the relaxation has and to which local optimum it converges. Each
design is computed without the search for courses and with another φ in place of the output of the
network. Any other start is sometimes better by chance, so a random change of φ₀ is among the
starts: the value of pretraining is what it achieves beyond that.
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

TITLE = "The network as the start of the relaxation"
TIMED = True
WITHOUT = ("outputs", "splines")

SEED = 21
DISTURBANCE_SEED = 22

FIRST_UNSEEN_BODY = 1000
"""Seed of the first generated body; pretraining uses the bodies with seeds from 0."""

DISTURBANCE = 0.1
"""Mean slope of the function that is added to φ₀; it moves the curve by about an edge length.

The mean slope of φ₀ itself is 1.
"""

NO_NETWORK, UNTRAINED = "φ₀, without a network", "network before training"
SHIPPED, DISTURBED = "shipped weights", "φ₀ with random waves"

KINDS = {
    "closed, shortest order": ("shortest", True),
    "closed, order as drawn": ("given", True),
    "open, shortest order": ("shortest", False),
}

CLEARLY = 0.02
"""Relative difference of bending above which one curve counts as fairer than another."""

FAR = 1.2
"""Bending relative to the best known curve above which a curve counts as far from it."""

SHARES = (0.5, 0.75, 0.9)
"""Quantiles over the sets that the table shows."""


Field = Callable[[Problem], FloatArray]
"""Function that gives φ in place of the network."""


RelaxedFrom = dict[str, list[Results]]
"""Outcomes by start, one entry per set."""


def measure(scale: Scale) -> Results:
    """Relax from every start, on meshes outside the training set of the weights."""
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
    """Cost of each start, and bending of the relaxed curves."""
    by_kind = {
        kind: relaxed_from([each for each in results["sets"] if each["curve"] == kind])
        for kind in dict.fromkeys(each["curve"] for each in results["sets"])
    }
    pooled = relaxed_from(results["sets"])
    figure = report.figure(
        "pretrained_start.png",
        "Share of the sets whose final bending is at most the given multiple of the best known",
    )
    return (
        "Designs by `nicmm` were started from different level-set functions in place of the "
        "output of the network, to see whether the network leads to fairer curves after "
        "relaxation; the search for courses was switched off. The table has one row per kind of "
        f"curve and start, for one set of 3–5 random vertices on each of {results['meshes']} "
        "meshes outside the training set of the shipped weights "
        f"({results['collection']}; seed {results['seed']}). “{DISTURBED}” adds a random smooth "
        f"function of mean slope {results['disturbance']:g} to φ₀ (seed "
        f"{results['disturbance_seed']}). Bending is L ∫ κ_g² ds, and time is the CPU time of a "
        "design on a Designer that has computed everything that depends only on the mesh. The "
        "paper has no corresponding experiment.\n\n"
        f"{_table(by_kind)}\n\n*Topology repaired*: share of the sets on which the topology of φ₀ "
        "had to be restored somewhere. *Failed*: designs without a relaxed curve. *At the cap*: "
        "designs that reached the iteration limit. *Relative to the best known*: quantiles of the "
        f"final bending, divided by the least of the {len(pooled)} starts, and the share of the "
        f"sets above {FAR:g}. *Relative to φ₀*: geometric mean of the final bending divided by "
        "that from φ₀, and its standard error. *Fairer* and *less fair* mean by more than "
        f"{100 * CLEARLY:.0f} %. In all ratios a bending below {NEARLY_STRAIGHT} counts as "
        f"{NEARLY_STRAIGHT}.\n\n"
        f"{findings(pooled)}\n\n{figure}"
    )


def draw(results: Results, folder: Path) -> None:
    """Plot the distribution of the final bending relative to the best known, by start."""
    figure, axes = plots.labelled(
        "Relaxed curves from several starts",
        "L ∫ κ_g² ds relative to the best known",
        "share of the sets",
    )
    for label, ratios in _to_best(relaxed_from(results["sets"])).items():
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
"""Functions that create the start fields, by label; they load networks only when run."""


def _relaxed(sets: Iterable[tuple[str, Mesh, IntArray]]) -> list[Results]:
    """Outcomes of every set and kind of curve; impossible requests are reported and left out."""
    fields = {label: make() for label, make in STARTS.items()}
    found: list[Results] = []
    for name, mesh, points in sets:
        designer = nicmm.Designer(mesh)
        for kind, (order, closed) in KINDS.items():
            try:
                # This computes what depends only on the mesh, so that it is not measured.
                designer.design(points, closed=closed, order=order)
            except nicmm.UnreachableError as error:
                print(f"  {name}, {kind}: {error}", flush=True)
                continue
            relaxed = {
                label: _rest(designer, points, closed, order, field)
                for label, field in fields.items()
            }
            found.append({"mesh": name, "curve": kind, "relaxed": relaxed})
            ends = ", ".join(f"{one['end']:.1f}" for one in relaxed.values())
            print(f"  {name}, {kind}: {ends}", flush=True)
    if not found:
        raise SystemExit("No set had a simple path through its points; there is nothing to measure")
    return sorted(found, key=lambda each: [*KINDS].index(each["curve"]))


def _rest(
    designer: nicmm.Designer, points: IntArray, closed: bool, order: str, field: Field
) -> Results:
    """Outcome of one start.

    "repaired" says whether the topology of φ₀ had to be restored somewhere, "start" and "end" are
    the bending L ∫ κ_g² ds before and after relaxation, and "seconds" is the CPU time.
    """
    with _instead_of_the_network(field) as level_sets:
        began = time.process_time()
        design = designer.design(points, closed=closed, order=order)
        seconds = time.process_time() - began
    # The last level set is the one that gave a curve.
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
    """Make designs start from a given field, without a course search; collect their level sets."""
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


def relaxed_from(sets: Sequence[Results]) -> RelaxedFrom:
    """The relaxed curve of each set, by start."""
    return {label: [each["relaxed"][label] for each in sets] for label in sets[0]["relaxed"]}


def _failed(one: Results) -> bool:
    """Whether there is no relaxed curve."""
    return one["status"] in (nicmm.Status.NOT_ONE_CURVE.name, nicmm.Status.UNRELAXED.name)


def _ends(relaxed: RelaxedFrom) -> dict[str, FloatArray]:
    """Bending of the relaxed curves, by start.

    Values are raised to `NEARLY_STRAIGHT`, since ratios between nearly straight curves are
    meaningless.
    """
    return {
        label: np.maximum([one["end"] for one in of_start], NEARLY_STRAIGHT)
        for label, of_start in relaxed.items()
    }


def _to_best(relaxed: RelaxedFrom) -> dict[str, FloatArray]:
    """Bending relative to the least bending known for each set, by start."""
    ends = _ends(relaxed)
    best = np.min(list(ends.values()), axis=0)
    return {label: values / best for label, values in ends.items()}


def gain(relaxed: RelaxedFrom, label: str, other: str = NO_NETWORK) -> tuple[float, float]:
    """Mean log ratio of the final bending to that from another start, and its standard error."""
    ends = _ends(relaxed)
    logarithm = np.log(ends[label] / ends[other])
    return float(logarithm.mean()), float(logarithm.std() / np.sqrt(len(logarithm)))


def _table(by_kind: Mapping[str, RelaxedFrom]) -> str:
    header = (
        "curves", "start", "sets", "topology repaired", "failed", "bending of the start, median",
        "iterations, median · mean", "at the cap", "design (ms), mean", "final bending, median",
        f"relative to the best known, {' · '.join(f'{100 * share:.0f} %' for share in SHARES)}",
        f"above {FAR:g}", "relative to φ₀", "fairer · less fair than from φ₀",
    )  # fmt: skip
    rows = []
    for kind, of_kind in by_kind.items():
        to_best, ends = _to_best(of_kind), _ends(of_kind)
        for label, relaxed in of_kind.items():
            mean, error = gain(of_kind, label)
            against = ends[label] / ends[NO_NETWORK]
            wins = (against < 1.0 - CLEARLY).sum(), (against > 1.0 + CLEARLY).sum()
            iterations = [one["iterations"] for one in relaxed]
            quantiles = np.quantile(to_best[label], SHARES)
            rows.append(
                (
                    kind,
                    label,
                    len(relaxed),
                    _percent([one["repaired"] for one in relaxed]),
                    sum(_failed(one) for one in relaxed),
                    f"{np.median([one['start'] for one in relaxed]):.0f}",
                    f"{np.median(iterations):.0f} · {np.mean(iterations):.1f}",
                    sum(one["status"] == nicmm.Status.ITERATION_LIMIT.name for one in relaxed),
                    f"{1000 * np.mean([one['seconds'] for one in relaxed]):.0f}",
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


def findings(pooled: RelaxedFrom) -> str:
    """What the table shows for all kinds of curves together, in words."""
    means = {
        label: np.mean([one["iterations"] for one in relaxed]) for label, relaxed in pooled.items()
    }
    seconds = {
        label: np.mean([one["seconds"] for one in relaxed]) for label, relaxed in pooled.items()
    }
    starts = {
        label: np.median([one["start"] for one in relaxed]) for label, relaxed in pooled.items()
    }
    text = (
        f"Over all {len(pooled[NO_NETWORK])} curves, the start from the shipped weights has "
        f"{starts[SHIPPED] / starts[NO_NETWORK]:.2f} times the bending of the start from φ₀ "
        f"(medians), {means[SHIPPED] / means[NO_NETWORK]:.2f} times its iterations and "
        f"{seconds[SHIPPED] / seconds[NO_NETWORK]:.2f} times its time (means). "
    )
    for label in (SHIPPED, DISTURBED):
        mean, error = gain(pooled, label)
        text += (
            f"From “{label}” the final bending is {np.exp(mean):.3f} times that from φ₀ (standard "
            f"error {error:.3f})"
        )
        if abs(mean) <= 2.0 * error:
            text += ", which is not a significant difference"
        text += ". "
    mean, error = gain(pooled, SHIPPED, DISTURBED)
    text += (
        f"From “{SHIPPED}” it is {np.exp(mean):.3f} times that from “{DISTURBED}” (standard error "
        f"{error:.3f}), so pretraining "
    )
    if mean + 2.0 * error < 0.0:
        return text + "gives fairer curves than a random change of φ₀ does."
    return text + "does not give fairer curves than a random change of φ₀ does."
