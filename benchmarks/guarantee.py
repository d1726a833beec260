"""Tests the guarantee of one simple curve through all points in order, and measures its fairness.

Every design is judged by `checker`, which uses only the public interface. The reference for
fairness is a slow explicit curve through the same points in the same order; see `elastic_curve`.
"""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

import nicmm_core as nicmm
from nicmm_core.geometry.array_types import FloatArray, IntArray
from tests.oracles.checker import judge
from tests.oracles.named_curves import named_curves

from . import collections, plots, report
from .elastic_curve import NODES, elastic_curve
from .evidence import DESIGN, Results
from .measures import SAMPLES, bending, squared_curvature
from .parallel import in_processes
from .progress import resumed
from .samples import point_sets
from .scale import Scale

TITLE = "The guarantee and fairness, checked independently"
ROOMS = DESIGN

METHOD = "elastic"
SEED = 0
SETS = 2
"""Sets of random points per mesh; each one is requested as a closed and as an open curve."""

WORKERS = 2
"""Number of processes; each mesh is measured by one, so results do not depend on the number."""

SAMPLINGS = (SAMPLES, NODES)
"""Numbers of samples at which curvature is measured; see `curvature.SAMPLINGS`."""

NEARLY_STRAIGHT = 0.5
"""Bending of the elastic curve, that of a 40° arc, below which ratios to it are meaningless."""

SHARES = (0.25, 0.5, 0.75, 0.9)
"""Quantiles over the sets that the table shows."""

LISTED_FAULTS = 20

AROUND = "around a torus, the handles of a double torus, a Möbius strip, a hole"
"""Where the named curves run."""

NAMED = "named curves"
"""Collection whose points are not random; it is left out of the distributions."""

KIND = {True: "closed", False: "open"}

PLOT = "guarantee.png"


@dataclass(frozen=True)
class Request:
    """Request for one curve."""

    points: IntArray
    closed: bool
    order: str


@dataclass(frozen=True)
class Job:
    """All requests on one mesh, and whether they are compared with the reference of fairness."""

    collection: str
    name: str
    mesh: nicmm.Mesh
    requests: Sequence[Request]
    compares: bool


def measure(scale: Scale) -> Results:
    """Design closed and open curves on every collection, and judge them."""
    meshes = []
    workers = 1 if scale is Scale.SMOKE else WORKERS
    for of_mesh in resumed(
        "guarantee", scale, _jobs(scale), lambda rest: in_processes(_judged, rest, workers)
    ):
        meshes.append(of_mesh)
        words = report.listed(f"{KIND[one['closed']]} {_words(one)}" for one in of_mesh["curves"])
        print(f"  {of_mesh['collection']}, {of_mesh['mesh']}: {words}", flush=True)
    return {
        "seed": SEED,
        "sets": _sets(scale),
        "method": METHOD,
        "samplings": list(SAMPLINGS),
        "compared_every": _compared_every(scale),
        "nearly_straight": NEARLY_STRAIGHT,
        "meshes": meshes,
    }


def section(results: Results) -> str:
    """Number of curves that keep the guarantee, and the distribution of fairness."""
    meshes = results["meshes"]
    return (
        f"`{results['method']}` guarantees one simple curve through all control points in order, "
        "or an error; the first table counts how often an independent checker confirms this. Each "
        "row is a collection of meshes and a kind of curve. The columns after the number of curves "
        "are those that keep the guarantee; the largest distance from a control point in bounding "
        "box diagonals; segments that do not lie in a face; self-crossings; errors; and the "
        f"statuses of the designs. There are {results['sets']} sets of 3–5 random vertices per "
        "mesh, each as a closed and as an open curve (shortest order, seed "
        f"{results['seed']}), and the named curves of `tests/oracles/named_curves.py`. The checker "
        "is `tests/oracles/checker.py`, which uses only the public interface. The paper has no "
        "corresponding table; it reports curves with several loops as a limitation (Fig. 16)."
        f"\n\n{_table(meshes)}\n\n{_faults(meshes)}\n\n{_fairness(results)}\n\n"
        + report.figure(
            PLOT,
            "Share of the sets whose bending is at most the given multiple of that of the "
            "reference curve",
        )
    )


def summary(results: Results) -> str:
    """What the documents say of the guarantee."""
    rows = []
    for label in dict.fromkeys(each["collection"] for each in results["meshes"]):
        meshes = [each for each in results["meshes"] if each["collection"] == label]
        curves = [curve for each in meshes for curve in each["curves"]]
        good = sum("error" not in curve and "faults" not in curve for curve in curves)
        share = f"{good} ({100 * good / len(curves):.4g} %)"
        words = AROUND if label == NAMED else label
        rows.append((words, len(meshes), len(curves), share, len(curves) - good))
    one = "one simple curve through all points, in order"
    header = ("surfaces", "meshes", "curves", one, "anything else")
    return report.table(header, rows)


def fairness(results: Results) -> str:
    """What the documents say of the bending, relative to the fairest reference curve."""
    words = []
    for closed in (True, False):
        ratios = [
            curve["to_best"][-1]
            for each in results["meshes"]
            for curve in each["curves"]
            if curve["closed"] is closed and curve.get("to_best", [None])[-1] is not None
        ]
        half, most, nearly_all = np.percentile(ratios, [50, 75, 90])
        words.append(
            f"the median over {len(ratios)} {KIND[closed]} curves is {half:.2f}; 75 % are "
            f"within {most:.2f} and 90 % within {nearly_all:.2f}"
        )
    return report.paragraph(
        "The curves pass through the control points to the last digit. On every "
        f"{results['compared_every']}th mesh, the bending L ∫ κ_g² ds (length L, geodesic "
        "curvature κ_g) was divided by that of the fairest explicit elastic curve known through "
        "the same points: " + "; ".join(words) + "."
    )


def draw(results: Results, folder: Path) -> None:
    """Plot the distribution of the bending relative to reference curves."""
    samplings = results["samplings"]
    figure, axes = plots.labelled(
        f"Fairness of {results['method']}",
        f"L ∫ κ_g² ds relative to the reference curve ({samplings[-1]} samples)",
        "share of the sets",
    )
    lines = {
        "relative to the fairest reference curve": ("to_best", "-"),
        "relative to the reference curve started from it": ("to_own", ":"),
    }
    for closed, colour in ((True, "tab:blue"), (False, "tab:orange")):
        for label, (name, style) in lines.items():
            values = _values(results["meshes"], closed, len(samplings) - 1, name)
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
    plots.save(figure, folder / PLOT)


def _jobs(scale: Scale) -> Iterator[Job]:
    """Meshes with their requests; the points depend only on the seed and the name of the mesh."""
    every, sets = _compared_every(scale), _sets(scale)
    for label, meshes in _collections(scale):
        for number, (name, mesh) in enumerate(meshes):
            generator = np.random.default_rng([SEED, zlib.crc32(name.encode())])
            requests = [
                Request(points, closed, "shortest")
                for points in point_sets(mesh, sets, generator)
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


def _sets(scale: Scale) -> int:
    """Number of sets of control points per mesh."""
    return 1 if scale is Scale.SMOKE else SETS


def _compared_every(scale: Scale) -> int:
    """Interval of the meshes of a collection on which the reference of fairness is computed."""
    return scale.choose(8, 4)


def _judged(job: Job) -> Results:
    """Judge all curves on one mesh."""
    designer = nicmm.Designer(job.mesh)
    curves = [_outcome(job, designer, request) for request in job.requests]
    return {"collection": job.collection, "mesh": job.name, "curves": curves}


def _outcome(job: Job, designer: nicmm.Designer, request: Request) -> Results:
    """Outcome of one request; values that are as they should be are left out."""
    points, closed, order = request.points, request.closed, request.order
    try:
        design = designer.design(points, closed=closed, order=order, method=METHOD)
    # Any other exception is a finding as well, and must not end a long measurement.
    except Exception as error:
        words = f"{type(error).__name__}: {error}"
        return {"closed": closed, "error": words, "typed": isinstance(error, nicmm.NicmmError)}
    verdict = judge(job.mesh, design, points, closed, order)
    found: Results = {"closed": closed, "status": design.status.name}
    if verdict.faults:
        found["faults"] = list(verdict.faults)
        found["chords_off_face"] = int(verdict.chords_off_face)
        found["self_crossings"] = int(verdict.self_crossings)
    missed = verdict.interpolation_error
    if missed:
        found["missed"] = float(f"{missed:.3g}") if np.isfinite(missed) else None
    if not verdict.faults:
        compare = _compared if job.compares else _alone
        found |= compare(designer, design.curves[0], points)
    return found


def _alone(designer: nicmm.Designer, curve: nicmm.SurfaceCurve, _: IntArray) -> Results:
    """L ∫ κ_g² ds for every number of samples."""
    return {"bending": [_rounded(bending(designer.mesh, curve, each)) for each in SAMPLINGS]}


def _compared(designer: nicmm.Designer, curve: nicmm.SurfaceCurve, points: IntArray) -> Results:
    """Fairness for every number of samples, absolute and relative to elastic curves.

    "own" refers to the elastic curve that starts from the curve itself. "best" refers to the
    fairer one of this and the elastic curve that starts from the curve of the variational method.
    "squared" is ∫ κ_g² ds without the factor L. Ratios are left out where the elastic curve is
    nearly straight.
    """
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
    found = _alone(designer, curve, points)
    if min(one.energies[-1] for one in fair) < NEARLY_STRAIGHT:
        return {**found, "nearly_straight": True}
    yardsticks = {"own": fair[0], "best": min(fair, key=lambda one: one.energies[-1])}
    for prefix, value in {"to": bending, "squared_to": squared_curvature}.items():
        for name, yardstick in yardsticks.items():
            found[f"{prefix}_{name}"] = [
                _rounded(value(mesh, curve, each) / value(mesh, yardstick.curve, each))
                for each in SAMPLINGS
            ]
    return found


def _rounded(value: float) -> float | None:
    """Number rounded to six significant digits; None if it is not finite."""
    return float(f"{value:.6g}") if np.isfinite(value) else None


def _visiting_order(curve: nicmm.SurfaceCurve, positions: FloatArray) -> IntArray:
    """Indices of the control points in the order in which the curve visits them."""
    offset = curve.points[curve.control_index][:, None] - positions[None]
    return np.linalg.norm(offset, axis=2).argmin(axis=1)


def _words(curve: Results) -> str:
    """Outcome in a few words."""
    return str(curve.get("error") or "; ".join(curve.get("faults", ())) or "kept")


def _is_kept(curve: Results) -> bool:
    """Whether a curve keeps the guarantee."""
    return "error" not in curve and "faults" not in curve


def _table(meshes: Sequence[Results]) -> str:
    header = (
        "meshes", "kind", "curves", "one simple curve through all points, in order",
        "largest distance from a point, diagonals", "segments off a face", "self-crossings",
        "errors", "statuses",
    )  # fmt: skip
    rows = []
    for collection in dict.fromkeys(each["collection"] for each in meshes):
        curves = _curves(each for each in meshes if each["collection"] == collection)
        for closed in (True, False):
            group = [curve for curve in curves if curve["closed"] == closed]
            if group:
                rows.append((collection, KIND[closed], *_counted(group)))
    return report.table(header, [*rows, ("all", "", *_counted(_curves(meshes)))])


def _curves(meshes: Iterable[Results]) -> list[Results]:
    return [curve for each in meshes for curve in each["curves"]]


def _counted(curves: Sequence[Results]) -> tuple[object, ...]:
    judged = [curve for curve in curves if "error" not in curve]
    kept = sum(_is_kept(curve) for curve in curves)
    # Errors of the package are counted by type; any other exception is a fault of the package.
    errors = Counter(
        curve["error"].split(":")[0] + ("" if curve["typed"] else " (untyped)")
        for curve in curves
        if "error" in curve
    )
    missed = [curve.get("missed", 0.0) for curve in judged]
    return (
        len(curves),
        f"{kept} ({100 * kept / len(curves):.1f} %)",
        f"{max((np.inf if each is None else each for each in missed), default=0.0):.1e}",
        sum(curve.get("chords_off_face", 0) for curve in judged),
        sum(curve.get("self_crossings", 0) for curve in judged),
        _named_counts(errors),
        _named_counts(Counter(curve["status"] for curve in judged)),
    )


def _named_counts(counts: Counter[str]) -> str:
    return report.listed(f"{name} {count}" for name, count in sorted(counts.items())) or "none"


def _faults(meshes: Sequence[Results]) -> str:
    wrong = [
        f"- {each['mesh']}, {KIND[curve['closed']]}: {_words(curve)}"
        for each in meshes
        for curve in each["curves"]
        if not _is_kept(curve)
    ]
    if not wrong:
        return "Every curve keeps the guarantee."
    more = f"\n\nand {len(wrong) - LISTED_FAULTS} more." if len(wrong) > LISTED_FAULTS else ""
    return "These curves do not keep the guarantee:\n\n" + "\n".join(wrong[:LISTED_FAULTS]) + more


COLUMNS = {
    "L ∫ κ_g² ds": ("bending", 0),
    "relative to the reference curve started from it": ("to_own", 2),
    "relative to the fairest reference curve": ("to_best", 2),
    "∫ κ_g² ds, relative to the reference curve started from it": ("squared_to_own", 2),
    "∫ κ_g² ds, relative to the fairest reference curve": ("squared_to_best", 2),
}
"""Columns of the table of fairness: measure and number of decimals, by header."""


def _fairness(results: Results) -> str:
    """Table of fairness, with an explanation."""
    meshes = results["meshes"]
    rows = []
    for closed in (True, False):
        for sampling, samples in enumerate(results["samplings"]):
            values = [_values(meshes, closed, sampling, name) for name, _ in COLUMNS.values()]
            digits = [each for _, each in COLUMNS.values()]
            rows.append((KIND[closed], samples, *map(_quantiles, values, digits)))
    straight = sum(curve.get("nearly_straight", False) for curve in _curves(meshes))
    compared = sum(len(_values(meshes, closed, 0, "to_own")) for closed in (True, False))
    every = results["compared_every"]
    which = "every mesh" if every == 1 else f"every {every}th mesh of each collection"
    return (
        "The second table shows how fair the curves are: their bending L ∫ κ_g² ds, its ratio to "
        "that of reference curves, which are explicit elastic curves through the same points in "
        "the same order, and the same ratio without the factor L. Each row is a kind of curve and "
        "the number of samples at which curvature is measured. Each cell has the "
        f"{', '.join(f'{100 * share:.0f}' for share in SHARES)} % quantiles over the sets and, in "
        "parentheses, the number of sets; named curves are left out. One reference curve starts "
        "from the curve itself, and another one from the curve of `variational`; the fairest is "
        "the better of the two. Both are local optima, and they may cross themselves. The ratios "
        f"are measured on {which}; {straight} of {straight + compared} sets are left out of them "
        "because the reference curve is nearly straight (L ∫ κ_g² ds below "
        f"{results['nearly_straight']}).\n\n"
        f"{report.table(('curves', 'samples', *COLUMNS), rows)}"
    )


def _values(meshes: Sequence[Results], closed: bool, sampling: int, name: str) -> list[float]:
    """Sorted values of a measure, of all curves of a kind for which it is known."""
    curves = _curves(each for each in meshes if each["collection"] != NAMED)
    values = [
        curve[name][sampling] for curve in curves if curve["closed"] == closed and name in curve
    ]
    return sorted(value for value in values if value is not None)


def _quantiles(values: Sequence[float], digits: int) -> str:
    if not values:
        return "–"
    text = " · ".join(f"{each:.{digits}f}" for each in np.quantile(values, SHARES))
    return f"{text} ({len(values)})"
