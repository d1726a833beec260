"""The guarantee from outside: one simple curve through all points in order, and how fair it is.

Every design is judged by `checker`, which knows only the public interface. The yardstick of
fairness is a slow explicit curve through the same points in the same order, see `elastic_curve`.
"""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from multiprocessing import get_context

import numpy as np

import nicmm_core as nicmm
from nicmm_core.geometry.array_types import FloatArray, IntArray
from tests.oracles.checker import Verdict, judge
from tests.oracles.named_curves import named_curves

from . import collections, plots, report
from .elastic_curve import NODES, elastic_curve
from .measures import SAMPLES, bending, squared_curvature
from .samples import point_sets
from .scale import Scale

METHOD = "nicmm"
SEED = 0
SETS = 2
"""Of random points on each mesh, each asked for as a closed and as an open curve."""

WORKERS = 2
"""Processes; each mesh is measured by one of them, so the result does not depend on them."""

SAMPLINGS = (SAMPLES, NODES)
"""Numbers of samples that curvature is measured with, see `curvature.SAMPLINGS`."""

NEARLY_STRAIGHT = 0.5
"""Bending of the elastic curve below which ratios to it say nothing; an arc of 40° has it."""

SHARES = (0.25, 0.5, 0.75, 0.9)
"""Of the sets, that the table gives the values of."""

LISTED_FAULTS = 20

NAMED = "named curves"
"""Their points are chosen, so they are left out of the distributions."""

KIND = {True: "closed", False: "open"}


@dataclass(frozen=True)
class Request:
    """One curve that is asked for."""

    points: IntArray
    closed: bool
    order: str


@dataclass(frozen=True)
class Job:
    """All that is asked for on one mesh, and whether fairness is compared with the yardstick."""

    collection: str
    name: str
    mesh: nicmm.Mesh
    requests: Sequence[Request]
    compares: bool


@dataclass(frozen=True)
class Fairness:
    """Of one curve with one number of samples; ratios are to elastic curves.

    "Own" is the elastic curve that starts from the curve itself, "best" the fairest one known: the
    other one starts from the variational method's curve. The last two are ∫ κ_g² ds alone.
    """

    bending: float
    to_own: float = np.nan
    to_best: float = np.nan
    squared_to_own: float = np.nan
    squared_to_best: float = np.nan


@dataclass(frozen=True)
class Outcome:
    """What came of one request; the verdict is None where an error was raised."""

    collection: str
    name: str
    closed: bool
    verdict: Verdict | None
    status: str = ""
    error: str = ""
    typed: bool = True
    fairness: tuple[Fairness, ...] = ()
    nearly_straight: bool = False

    @property
    def kept(self) -> bool:
        """Whether it is what was asked for."""
        return self.verdict is not None and not self.verdict.faults

    @property
    def words(self) -> str:
        """The outcome in a few words."""
        if self.verdict is None:
            return self.error
        return "; ".join(self.verdict.faults) or "kept"


def run(scale: Scale) -> None:
    """Ask for closed and open curves on every collection and judge them."""
    outcomes = []
    for of_mesh in _measured(_jobs(scale), 1 if scale is Scale.SMOKE else WORKERS):
        outcomes += of_mesh
        first = of_mesh[0]
        words = ", ".join(f"{KIND[one.closed]} {one.words}" for one in of_mesh)
        print(f"  {first.collection}, {first.name}: {words}", flush=True)
    body = (
        f"Seed {SEED}; {SETS} sets of 3–5 random vertices a mesh, each closed and open, shortest "
        f"order; named curves as `named_curves.py` asks for them; `{METHOD}`. The judge is "
        "`tests/oracles/checker.py`, which knows only the public interface.\n\n"
        f"{_table(outcomes)}\n\n{_faults(outcomes)}\n\n{_fairness(outcomes, scale)}\n\n"
        f"{_figure(outcomes, scale)}"
    )
    report.write_section("guarantee", "The guarantee, and fairness, from outside", body, scale)


def _jobs(scale: Scale) -> Iterator[Job]:
    """Meshes with their points, which depend on the seed and the mesh's name alone."""
    every = _compared_every(scale)
    for label, meshes in _collections(scale):
        for number, (name, mesh) in enumerate(meshes):
            generator = np.random.default_rng([SEED, zlib.crc32(name.encode())])
            requests = [
                Request(points, closed, "shortest")
                for points in point_sets(mesh, SETS, generator)
                for closed in (True, False)
            ]
            yield Job(label, name, mesh, requests, compares=number % every == 0)
    for named in islice(named_curves(), 1 if scale is Scale.SMOKE else None):
        request = Request(named.points, True, named.order)
        yield Job(NAMED, named.name, named.mesh, [request], compares=False)


def _collections(scale: Scale) -> Iterator[tuple[str, Iterable[tuple[str, nicmm.Mesh]]]]:
    if scale is Scale.SMOKE:
        yield "generated creatures", collections.creatures(1)
        return
    yield "SHREC16, two Loop subdivisions", collections.shrec16(scale.choose(384, 38))
    yield "closed manifold", collections.clean(scale.choose(36, 3))
    yield "people, animals and a cortex", collections.bodies(scale.choose(11, 1))


def _compared_every(scale: Scale) -> int:
    """Every how many meshes of a collection the yardstick is computed."""
    return scale.choose(8, 4)


def _measured(jobs: Iterable[Job], workers: int) -> Iterator[list[Outcome]]:
    """Outcomes by mesh, in the order of the jobs."""
    if workers == 1:
        yield from map(_outcomes, jobs)
        return
    # A forked process would inherit the locks of PyTorch's threads.
    with get_context("spawn").Pool(workers) as pool:
        yield from pool.imap(_outcomes, jobs)


def _outcomes(job: Job) -> list[Outcome]:
    designer = nicmm.Designer(job.mesh)
    return [_outcome(job, designer, request) for request in job.requests]


def _outcome(job: Job, designer: nicmm.Designer, request: Request) -> Outcome:
    points, closed, order = request.points, request.closed, request.order
    try:
        design = designer.design(points, closed=closed, order=order, method=METHOD)
    # An error that is not the package's own is a finding, and must not end a long measurement.
    except Exception as error:
        typed = isinstance(error, nicmm.NicmmError)
        words = f"{type(error).__name__}: {error}"
        return Outcome(job.collection, job.name, closed, None, error=words, typed=typed)
    verdict = judge(job.mesh, design, points, closed, order)
    fairness: tuple[Fairness, ...] = ()
    straight = False
    if not verdict.faults:
        curve = design.curves[0]
        if job.compares:
            fairness, straight = _compared(designer, curve, points)
        else:
            fairness = tuple(Fairness(bending(job.mesh, curve, each)) for each in SAMPLINGS)
    return Outcome(
        job.collection,
        job.name,
        closed,
        verdict,
        status=design.status.name,
        fairness=fairness,
        nearly_straight=straight,
    )


def _compared(
    designer: nicmm.Designer, curve: nicmm.SurfaceCurve, points: IntArray
) -> tuple[tuple[Fairness, ...], bool]:
    """Fairness relative to the elastic curves, and whether these are nearly straight."""
    mesh = designer.mesh
    fair = [elastic_curve(mesh, curve)]
    visited = points[_visiting_order(curve, mesh.vertices[points])]
    try:
        other = designer.design(visited, closed=curve.closed, method="variational")
    except nicmm.UnreachableError:
        pass
    else:
        if not judge(mesh, other, visited, curve.closed).faults:
            fair.append(elastic_curve(mesh, other.curves[0]))
    own, best = fair[0].curve, min(fair, key=lambda one: one.energies[-1]).curve
    straight = min(one.energies[-1] for one in fair) < NEARLY_STRAIGHT
    compared = []
    for samples in SAMPLINGS:
        bends = [bending(mesh, each, samples) for each in (curve, own, best)]
        squares = [squared_curvature(mesh, each, samples) for each in (curve, own, best)]
        ratios = [values[0] / value for values in (bends, squares) for value in values[1:]]
        compared.append(Fairness(bends[0], *([np.nan] * 4 if straight else ratios)))
    return tuple(compared), straight


def _visiting_order(curve: nicmm.SurfaceCurve, positions: FloatArray) -> IntArray:
    """Which control point each one on the curve is."""
    offset = curve.points[curve.control_index][:, None] - positions[None]
    return np.linalg.norm(offset, axis=2).argmin(axis=1)


def _table(outcomes: Sequence[Outcome]) -> str:
    header = (
        "meshes", "curves", "sets", "one simple curve through all points, in order",
        "largest interpolation error, diagonals", "chords off a face", "self-crossings",
        "errors", "statuses",
    )  # fmt: skip
    rows = []
    for collection in dict.fromkeys(one.collection for one in outcomes):
        for closed in (True, False):
            group = [o for o in outcomes if o.collection == collection and o.closed == closed]
            if group:
                rows.append((collection, KIND[closed], *_counted(group)))
    return report.table(header, [*rows, ("all", "", *_counted(outcomes))])


def _counted(outcomes: Sequence[Outcome]) -> tuple[object, ...]:
    verdicts = [one.verdict for one in outcomes if one.verdict is not None]
    kept = sum(one.kept for one in outcomes)
    # A typed error is named; any other is a fault of the package.
    errors = Counter(
        one.error.split(":")[0] + ("" if one.typed else " (untyped)")
        for one in outcomes
        if one.verdict is None
    )
    missed = max((verdict.interpolation_error for verdict in verdicts), default=0.0)
    return (
        len(outcomes),
        f"{kept} ({100 * kept / len(outcomes):.1f} %)",
        f"{missed:.1e}",
        sum(verdict.chords_off_face for verdict in verdicts),
        sum(verdict.self_crossings for verdict in verdicts),
        _named_counts(errors),
        _named_counts(Counter(one.status for one in outcomes if one.status)),
    )


def _named_counts(counts: Counter[str]) -> str:
    return report.listed(f"{name} {count}" for name, count in sorted(counts.items())) or "none"


def _faults(outcomes: Sequence[Outcome]) -> str:
    wrong = [one for one in outcomes if not one.kept]
    if not wrong:
        return "Every curve is what was asked for."
    lines = [f"- {one.name}, {KIND[one.closed]}: {one.words}" for one in wrong[:LISTED_FAULTS]]
    more = f"\n\nand {len(wrong) - LISTED_FAULTS} more." if len(wrong) > LISTED_FAULTS else ""
    return "Not what was asked for:\n\n" + "\n".join(lines) + more


COLUMNS: dict[str, tuple[Callable[[Fairness], float], int]] = {
    "L ∫ κ_g² ds": (lambda fairness: fairness.bending, 0),
    "to the elastic curve from its own start": (lambda fairness: fairness.to_own, 2),
    "to the fairest one known": (lambda fairness: fairness.to_best, 2),
    "∫ κ_g² ds alone, own start": (lambda fairness: fairness.squared_to_own, 2),
    "∫ κ_g² ds alone, fairest": (lambda fairness: fairness.squared_to_best, 2),
}
"""Of the table of fairness: what is shown, with how many digits."""


def _fairness(outcomes: Sequence[Outcome], scale: Scale) -> str:
    rows = []
    for closed in (True, False):
        for sampling, samples in enumerate(SAMPLINGS):
            row = [KIND[closed], str(samples)]
            for value, digits in COLUMNS.values():
                values = _values(outcomes, closed, sampling, value)
                row.append(_quantiles(values, digits))
            rows.append(row)
    straight = sum(one.nearly_straight for one in outcomes)
    compared = len(_values(outcomes, None, 0, lambda fairness: fairness.to_own))
    every = _compared_every(scale)
    which = "every mesh" if every == 1 else f"every {every}th mesh of each collection"
    return (
        f"{report.table(('curves', 'samples', *COLUMNS), rows)}\n\n"
        f"Values at {', '.join(f'{100 * share:.0f}' for share in SHARES)} % of the sets, then "
        f"their number. Ratios are taken on {which}, to explicit elastic curves through the same "
        "points in the same order: the one that starts from the curve itself, and the fairest of "
        "it and the one that starts from the curve of `variational`. Their topology is free and "
        f"each is a local optimum. {straight} of {straight + compared} sets are left out of the "
        f"ratios because the elastic curve is nearly straight (L ∫ κ_g² ds below "
        f"{NEARLY_STRAIGHT})."
    )


def _values(
    outcomes: Sequence[Outcome],
    closed: bool | None,
    sampling: int,
    value: Callable[[Fairness], float],
) -> list[float]:
    """A measure of all curves of a kind where it is known, sorted; closed None for both kinds."""
    values = [
        value(one.fairness[sampling])
        for one in outcomes
        if one.fairness and one.collection != NAMED and closed in (None, one.closed)
    ]
    return sorted(each for each in values if np.isfinite(each))


def _quantiles(values: Sequence[float], digits: int) -> str:
    if not values:
        return "–"
    text = " · ".join(f"{each:.{digits}f}" for each in np.quantile(values, SHARES))
    return f"{text} ({len(values)})"


def _figure(outcomes: Sequence[Outcome], scale: Scale) -> str:
    """Share of the sets whose curve is at most so many times as far from fair."""
    figure, axes = plots.labelled(
        f"Fairness of {METHOD}",
        f"L ∫ κ_g² ds relative to the elastic curve ({SAMPLINGS[-1]} samples)",
        "share of the sets",
    )
    lines: dict[str, tuple[Callable[[Fairness], float], str]] = {
        "the fairest known": (lambda fairness: fairness.to_best, "-"),
        "from its own start": (lambda fairness: fairness.to_own, ":"),
    }
    for closed, colour in ((True, "tab:blue"), (False, "tab:orange")):
        for label, (value, style) in lines.items():
            values = _values(outcomes, closed, len(SAMPLINGS) - 1, value)
            shares = np.linspace(0.0, 1.0, len(values) + 1)
            values = values[:1] + values
            shares = shares[: len(values)]
            axes.step(
                values, shares, style, where="post", color=colour, label=f"{KIND[closed]}, {label}"
            )
    axes.axvline(1.0, color="0.6", linewidth=0.8)
    axes.set_xscale("log")
    plots.plain_ticks(axes.xaxis)
    axes.set_ylim(0.0, 1.02)
    axes.legend(fontsize=8, loc="lower right")
    path = plots.save(figure, report.output_folder(scale) / "guarantee.png")
    return report.figure(path, "Share of the sets at or below each ratio to the elastic curve")
