"""Generates the measured figures in README.md and docs/ from the data files.

Each block of figures is enclosed by `<!-- figures: NAME -->` and `<!-- /figures -->`.
"""

from __future__ import annotations

import importlib
import re
import textwrap
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import numpy as np

from tests.oracles.corpus import DECLINED, DUE, GOOD, WRONG

from . import (
    courses,
    fuzz,
    guarantee,
    ninth_channel,
    peers,
    prompts,
    report,
    sharp_edges,
    transfer,
)
from .evidence import ROOT, Record, Results
from .peer_sizes import sizes_section

DOCUMENTS = (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))

METHODS = ("elastic", "nicmm", "variational")

AROUND = "around a torus, the handles of a double torus, a Möbius strip, a hole"
"""Where the named curves run."""


def generated(records: Mapping[str, Record]) -> dict[Path, str]:
    """Text of every document, with all parts that depend on data files regenerated, by path."""
    measured = {name: record["results"] for name, record in records.items()}
    blocks = {
        name: write(*(measured[each] for each in sources))
        for name, (write, *sources) in FIGURES.items()
        if all(each in measured for each in sources)
    }
    found = {report.RESULTS: report.results_text(records)}
    for path in DOCUMENTS:
        found[path] = report.with_figures(path.read_text(encoding="utf-8"), blocks)
    return found


def _guarantee(results: Results) -> str:
    rows = []
    for label, meshes in _by(results["meshes"], "collection").items():
        curves = [curve for each in meshes for curve in each["curves"]]
        good = sum("error" not in curve and "faults" not in curve for curve in curves)
        share = f"{good} ({100 * good / len(curves):.4g} %)"
        words = AROUND if label == guarantee.NAMED else label
        rows.append((words, len(meshes), len(curves), share, len(curves) - good))
    one = "one simple curve through all points, in order"
    header = ("surfaces", "meshes", "curves", one, "anything else")
    return report.table(header, rows)


def _fairness(results: Results) -> str:
    """Percentiles of the bending relative to the fairest elastic curve, with most samples."""
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
            f"the median over {len(ratios)} {courses.KIND[closed]} curves is {half:.2f}; 75 % are "
            f"within {most:.2f} and 90 % within {nearly_all:.2f}"
        )
    return _paragraph(
        "The curves pass through the control points to the last digit. On every "
        f"{results['compared_every']}th mesh, the bending L ∫ κ_g² ds (length L, geodesic "
        "curvature κ_g) was divided by that of the fairest explicit elastic curve known through "
        "the same points: " + "; ".join(words) + "."
    )


def _methods(curvature: Results, degraded: Results, runtime: Results) -> str:
    """The three methods beside each other, with the paper's words."""
    sets = [each["bending"] for each in curvature["sets"]]
    bends = [
        f"{np.median([bend[method][0] / bend['reference curve'][0] for bend in sets]):.2f}"
        for method in METHODS
    ]
    worst = [each for each in degraded["sets"] if each["n"] == degraded["severities"][-1]]
    found = [sum(s["answers"][m]["bending"] is not None for s in worst) for m in METHODS]
    iterations = [
        f"{np.median([each['answers'][method]['iterations'] for each in runtime['sets']]):.0f}"
        for method in METHODS
    ]
    rows = [
        (
            "L ∮ κ_g² ds at 128 points relative to an explicit elastic curve, median of "
            f"{len(sets)}",
            *bends,
            "“comparable distributions”",
        ),
        (
            "one finite curve on a mesh with every face degraded",
            *(f"{count} of {len(worst)}" for count in found),
            "NICMM yes, variational no",
        ),
        (
            f"iterations, median of {len(runtime['sets'])}",
            f"{iterations[0]}, after the search",
            *iterations[1:],
            "NICMM about 32",
        ),
    ]
    return report.table(("", *(f"`{method}`" for method in METHODS), "in the paper"), rows)


PAPER = (
    "pretraining",
    "transfer",
    "convergence",
    "ablation",
    "parameters",
    "initial",
    "curvature",
    "runtime",
    "peers",
    "degraded",
    "resolution",
    "gallery",
    "obstacles",
    "one_loop",
)
"""Measurements of the tables and figures of the paper."""


def _beside_paper(*results: Results) -> str:
    """What each of these measurements says about the paper."""
    rows = []
    for name, found in zip(PAPER, results, strict=True):
        module = importlib.import_module(f"benchmarks.{name}")
        for verdict, sentences in report.verdicts(module.section(found)).items():
            rows.append((report.link_to(module.TITLE), verdict, " ".join(sentences)))
    return report.table(("in the paper", "our result", "what was measured"), rows)


def _systems(results: Results) -> str:
    return f"{peers.systems_table(results)}\n\n{sizes_section(results['sizes'])}"


def _courses(results: Results) -> str:
    ratios: dict[bool, list[float]] = defaultdict(list)
    moved: dict[str, list[bool]] = defaultdict(list)
    every: list[float] = []
    for request in results["requests"]:
        best = min(min(values) for values in request["energies"].values())
        ratios[request["closed"]].append(min(request["energies"][courses.DEFAULT]) / best)
        for change, several in request["moved"].items():
            moved[change] += [courses.is_moved(each) for each in several]
            every += [each["away"] for each in several]
    closed, open_ = (np.exp(np.log(ratios[kind]).mean()) for kind in (True, False))
    far = report.listed(f"{sum(each)} of {len(each)} {name}" for name, each in moved.items())
    return (
        _item(
            "Relative to the lowest energy of all starts of `python -m benchmarks courses`, the "
            f"default has {closed:.2f} times as much for closed curves and {open_:.2f} times for "
            f"open ones (geometric means of {len(ratios[True])} each; at most "
            f"{max(ratios[True]):.2f} and {max(ratios[False]):.2f} times) "
            "([measured](../benchmarks/RESULTS.md#which-course-a-curve-takes))."
        )
        + "\n"
        + _item(
            "The curve does not depend on the numbering, position, orientation or size of the "
            "mesh, because it is designed on a copy that is numbered by position in the principal "
            "frame. When the mesh is changed, a curve counts as another one if it moves by more "
            f"than {100 * courses.MOVED:g} % of the diagonal and its energy changes by more than "
            f"{100 * courses.TIE:g} %. This happens to {far} curves. "
            f"{(np.array(every) < 1e-6).sum()} of all {len(every)} curves stay the same within "
            "1e-6."
        )
    )


def _runtime(results: Results) -> str:
    sets = results["sets"]
    methods = list(sets[0]["answers"])
    mean = {
        method: np.array([np.mean(each["answers"][method]["seconds"]) for each in sets])
        for method in methods
    }
    ratio = float(np.median(mean["elastic"] / mean["variational"]))
    seconds = report.listed(f"`{method}` {mean[method].mean():.2f} s" for method in methods)
    medians = report.listed(f"{np.median(mean[method]):.2f} s" for method in methods)
    return _paragraph(
        f"A first curve takes {seconds} on average over {len(sets)} meshes of some 4,000 vertices "
        f"(`python -m benchmarks runtime`; medians {medians}). The median ratio of `elastic` to "
        f"`variational` is {ratio:.2f}; the slowest curve of `elastic` takes "
        f"{mean['elastic'].max():.1f} s. Seconds are those of the machine that measured them, so "
        "ratios say more."
    )


def _stages(results: Results) -> str:
    body = results["bodies"][-1]
    first, another, dragged = (
        np.median(body["milliseconds"][kind]["together"]) / 1000.0
        for kind in ("first", "another", "dragged")
    )
    return _item(
        f"On a mesh of {body['faces'] / 1e6:.1f} million faces the first curve takes {first:.1f} "
        f"seconds, a further curve {another:.1f} seconds, and an update while a point is dragged "
        f"{dragged:.2f} seconds ([by stage](../benchmarks/RESULTS.md#where-the-time-goes))."
    )


def _lanes(results: Results) -> str:
    aligned = [each["aligned"] for each in results["sets"] if each["aligned"] is not None]
    half, nearly_all = np.percentile([each["distance"] for each in aligned], [50, 90])
    return _item(
        f"A curve follows a painted lane that is {100 * results['offset']:g} % of the diagonal "
        "away from it: the median distance of the lane to the curve falls to "
        f"{half:.2f} of the distance without the lane, and to {nearly_all:.2f} or less for nine "
        "curves of ten. A curve goes around an obstacle wherever a path exists."
    )


def _sharp_edges(results: Results) -> str:
    every = [line for lines in results["lines"].values() for line in lines]
    others = [line["mesh"] for line in every if line["aligned"] > sharp_edges.WANTED]
    kinds = sorted({name.split(", ")[-1].rstrip(" 0123456789") for name in others})
    where = f"; the other {len(others)} are on: {report.listed(kinds)}" if kinds else ""
    return _item(
        "A curve whose ends are 2 % of the diagonal away from a sharp edge is attracted to the "
        f"edge and runs along it: of {len(every)} "
        "[measured](../benchmarks/RESULTS.md#sharp-edges-to-follow) lines, "
        f"{len(every) - len(others)} are within a quarter of a mesh edge of it{where}. If other "
        "sharp edges are about as near, such as a neighbouring rim of a shaft or the other half of "
        "a circle, the curve may follow those; "
        "[via points](via_points.md) select one."
    )


SOUP = "the same, a soup of triangles"


def _cancellation(results: Results) -> str:
    designs = results["designs"]
    small = max(each["longest"] for each in designs if each["faces"] <= 100_000)
    large = max(each["faces"] for each in designs)
    longest = max(d["longest"] for d in designs if d["faces"] == large and d["mesh"] != SOUP)
    soup = next(each["longest"] for each in designs if each["mesh"] == SOUP)
    return _item(
        f"A design checks for cancellation at least every {small:.2f} seconds of processor time on "
        f"meshes of up to 100,000 faces, every {longest:.2f} seconds at {large / 1e6:.1f} million "
        f"faces, and every {soup:.2f} seconds on a soup of as many triangles "
        "([measured](../benchmarks/RESULTS.md#cancelling))."
    )


def _degraded(results: Results) -> str:
    means = [
        np.median([s["answers"]["elastic"]["offset"][0] for s in results["sets"] if s["n"] == n])
        for n in results["severities"]
        if n
    ]
    return _item(
        "The curve on a degraded mesh is smooth too, but not always the same: by severity, the "
        f"median of its mean distance from the clean mesh's curve is {min(means):.1f} to "
        f"{max(means):.1f} % of the diagonal "
        "([measured](../benchmarks/RESULTS.md#what-moves-a-curve-on-degraded-meshes))."
    )


def _degraded_start(results: Results) -> str:
    pairs = [pair for mesh in results["meshes"] for pair in mesh["degraded"]]
    medians = {
        start: [np.median([pair[start][0] for pair in group]) for group in _by(pairs, "n").values()]
        for start in ("from_nothing", "from_clean")
    }
    near, far = min(medians["from_nothing"]), max(medians["from_nothing"])
    return _item(
        "The course depends on how the surface is triangulated, though not on the numbering: on "
        f"degraded meshes the curve is {near:.1f} to {far:.1f} % of the diagonal away from that of "
        f"the clean mesh, by severity (mean distance, median of {len(results['meshes'])} meshes). "
        f"Started from the clean mesh's curve, it stays within {max(medians['from_clean']):.1f} % "
        "(`python -m benchmarks degraded_start`). So there are several courses of about the same "
        "energy."
    )


def _obstacles(results: Results) -> str:
    found = [each["detour"] for each in results["sets"] if each["detour"] is not None]
    good = sum(not each["entered"] and not each["faults"] for each in found)
    text = (
        "`python -m benchmarks obstacles` paints discs of "
        f"{200 * results['radius']:g} % of the diagonal on the free curve of "
        f"{len(results['sets'])} third-party meshes: {good} curves go around the disc, each as one "
        "simple loop without any length inside"
    )
    if good < len(found):
        text += f"; {len(found) - good} do not"
    text += "."
    if len(found) < len(results["sets"]):
        closed_off = len(results["sets"]) - len(found)
        text += f" On {closed_off} of the meshes the disc closes off a limb, and the error says so."
    return _paragraph(text)


def _cuts(results: Results) -> str:
    cuts = [each for each in results["answers"] if "refused" not in each]
    sound = sum(not each["faults"] for each in cuts)
    meshes = len({(each["meshes"], each["mesh"]) for each in cuts})
    return _item(
        "A manifold stays a manifold: faces do not overlap, there are no holes, and boundaries do "
        f"not move (`python -m benchmarks cuts`: {sound} of {len(cuts)} cuts on {meshes} "
        "third-party meshes)."
    )


def _prompts(results: Results) -> str:
    return _paragraph(prompts.cost(results))


def _ninth_channel(results: Results) -> str:
    """The losses on sets with maps, and what the channel contributes."""
    runs, iterations = results["runs"], results["iterations"]
    names = {
        ninth_channel.SEEN: "`nicmm-maps.npz`",
        ninth_channel.NEUTRAL: "the same with a neutral φ_fea everywhere",
        ninth_channel.WITHOUT_MAPS: "`nicmm.npz`, trained without maps",
    }
    means = {
        label: np.array(run["mean_losses"])[[0, ninth_channel.ALSO_AFTER, iterations]]
        for label, run in runs.items()
    }
    rows = [(names[label], *(f"{mean:.3f}" for mean in means[label])) for label in runs]
    seen, neutral = means[ninth_channel.SEEN], means[ninth_channel.NEUTRAL]
    other = means[ninth_channel.WITHOUT_MAPS]
    text = (
        "Compared with a network trained without maps, the mean energy is "
        f"{seen[0] / other[0]:.2f} times as high at the start of the fit, and "
        f"{seen[2] / other[2]:.2f} times after {iterations} iterations. The channel itself "
        "contributes little: with the neutral value everywhere the energies are "
        f"{neutral[0] / seen[0]:.2f} and {neutral[2] / seen[2]:.2f} times as high. A network that "
        "processes one vertex at a time learns the average effect of maps on the energy, and the "
        "local information of φ_fea is already in φ₀, whose path runs around obstacles and along "
        "lanes."
    )
    header = (
        "network",
        "start of the fit",
        f"after {ninth_channel.ALSO_AFTER} iterations",
        f"after {iterations}",
    )
    return f"{report.table(header, rows)}\n\n{_paragraph(text)}"


def _transfer(results: Results) -> str:
    """The losses of the shipped weights on meshes outside their training set."""
    runs, iterations = results["runs"], results["iterations"]
    names = {
        transfer.UNTRAINED: "before training, which returns φ₀",
        transfer.ONE_MESH: f"pretrained on one mesh ({results['training_seconds']:.0f} s)",
        transfer.SHIPPED: "`nicmm.npz`",
    }
    rows = [
        (name, f"{runs[label]['mean_losses'][0]:.3f}", f"{np.mean(runs[label]['last_losses']):.3f}")
        for label, name in names.items()
    ]
    header = ("network", "start of the fit", f"after {iterations} iterations")
    return report.table(header, rows)


def _by(items: Iterable[Results], key: str) -> dict[str, list[Results]]:
    groups: dict[str, list[Results]] = defaultdict(list)
    for item in items:
        groups[item[key]].append(item)
    return groups


def _corpus(results: Results) -> str:
    answers = results["answers"]
    meshes = len({(each["folder"], each["mesh"]) for each in answers})
    counts = Counter(each["verdict"] for each in answers)
    slowest = max(each["seconds"] for each in answers if each["faces"] < SMALL)
    return _item(
        "`python -m benchmarks corpus`, every kind of broken mesh (self-crossing, non-manifold, "
        "with reversed faces, degenerate, in pieces, huge): "
        f"of {len(answers):,} requests on {meshes} meshes {counts[GOOD]:,} curves are good, "
        f"{counts[DUE]} are impossible and refused with an error that says why. "
        f"{_no(counts[DECLINED]).capitalize()} refused although possible, and "
        f"{_no(counts[WRONG])} wrong. Below "
        f"{SMALL:,} faces the slowest takes {slowest:.1f} seconds."
    )


OUTCOMES = {
    "good curve": "good curves",
    "error where due": "correct refusals, since no curve exists",
    "another order named": "refusals that name an order that works",
}
"""Outcomes of `messes` that are right, in words."""


def _messes(results: Results) -> str:
    outcomes, seconds = results["outcomes"], results["seconds"]
    counted = report.listed(
        f"{outcomes.get(name, 0):,} {words}" for name, words in OUTCOMES.items()
    )
    return _item(
        "`python -m benchmarks messes`, surfaces whose vertices are welded at random, with faces "
        f"added, duplicated, reversed and removed: of {len(seconds):,} requests {counted}; "
        f"{_no(len(results['findings']))} wrong. The slowest takes {max(seconds):.1f} seconds."
    )


def _fuzz(results: Results) -> str:
    slow = sum(re.search(r": took \d+ s$", finding) is not None for finding in results["findings"])
    text = (
        f"`python -m benchmarks fuzz`, hostile input: of {results['cases']:,} cases "
        f"{_no(len(results['findings']) - slow, be='')} ended with a crash, a hang, several curves "
        "or an error of another package."
    )
    if slow:
        text += (
            f" {slow} took more than {fuzz.SLOW:g} seconds of CPU time, at most "
            f"{results['slowest']:.1f}."
        )
    return _item(text)


def _no(count: int, be: str = " was") -> str:
    return f"{count or 'none'}{be if count < 2 else be.replace('was', 'were')}"


def _item(text: str) -> str:
    return _wrapped(text, "- ", "  ")


def _paragraph(text: str) -> str:
    return _wrapped(text)


def _wrapped(text: str, first: str = "", others: str = "") -> str:
    """Text in lines of 118 characters, without breaks inside of code."""
    whole = re.sub(r"`[^`]*`", lambda code: code[0].replace(" ", "\0"), text)
    lines = textwrap.fill(
        whole, 118, initial_indent=first, subsequent_indent=others, break_on_hyphens=False
    )
    return lines.replace("\0", " ")


SMALL = 20_000
"""Number of faces below which the slowest request is reported."""

FIGURES: dict[str, tuple[Callable[..., str], *tuple[str, ...]]] = {
    "guarantee": (_guarantee, "guarantee"),
    "fairness": (_fairness, "guarantee"),
    "methods": (_methods, "curvature", "degraded", "runtime"),
    "systems": (_systems, "peers"),
    "beside_paper": (_beside_paper, *PAPER),
    "courses": (_courses, "courses"),
    "runtime": (_runtime, "runtime"),
    "stages": (_stages, "stages"),
    "lanes": (_lanes, "lanes"),
    "sharp_edges": (_sharp_edges, "sharp_edges"),
    "cancellation": (_cancellation, "cancellation"),
    "degraded": (_degraded, "degraded"),
    "degraded_start": (_degraded_start, "degraded_start"),
    "obstacles": (_obstacles, "obstacles"),
    "prompts": (_prompts, "prompts"),
    "cuts": (_cuts, "cuts"),
    "ninth_channel": (_ninth_channel, "ninth_channel"),
    "transfer": (_transfer, "transfer"),
    "corpus": (_corpus, "corpus"),
    "messes": (_messes, "messes"),
    "fuzz": (_fuzz, "fuzz"),
}
"""Function that writes each block of figures, and the measurements whose results it takes."""
