"""Tests on every available mesh that a request gives a good curve, or an error if none exists.

`tests.oracles.corpus` makes the requests and classifies the answers into four kinds.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from tests.oracles.corpus import (
    DECLINED,
    DUE,
    FOLDERS,
    GENERATED,
    GOOD,
    REQUESTS,
    SEED,
    WRONG,
    Item,
    Outcome,
    outcome,
)
from tests.oracles.defects import defective_meshes
from tests.oracles.isolation import Isolated, isolated
from tests.oracles.mesh_files import COLLECTIONS, mesh_files

from . import report
from .evidence import Results
from .progress import resumed
from .scale import Scale

PATIENCE = 1200.0
"""Wall-clock time in seconds after which a request counts as hanging."""

LISTED = 60

SMALL = 20_000
"""Number of faces below which the documents tell the slowest request."""

SLOWEST = 8

KIND = {True: "closed", False: "open"}


TITLE = "Requests on every mesh"


def measure(scale: Scale) -> Results:
    """Request curves on all meshes, one collection after the other."""
    found = []
    for one in resumed(
        "corpus", scale, _items(scale), lambda rest: isolated(outcome, rest, PATIENCE)
    ):
        found.append(_answer(one))
        if found[-1]["verdict"] in (DECLINED, WRONG):
            print(f"  {_line(found[-1])}", flush=True)
    return {"seed": SEED, "requests": len(REQUESTS), "answers": found}


def section(results: Results) -> str:
    """Answers by collection, and the ones that are declined or wrong."""
    answers = results["answers"]
    rows = []
    for folder in dict.fromkeys(each["folder"] for each in answers):
        rows.append(_row(folder, [each for each in answers if each["folder"] == folder]))
    rows.append(_row("all", answers))
    slowest = sorted(answers, key=lambda each: -each["seconds"])[:SLOWEST]
    listed = [each for each in answers if each["verdict"] in (DECLINED, WRONG)]
    return (
        "Curves were requested on every available mesh, sound or defective, and the table counts "
        "the answers. Each row is a collection. A *good curve* is one simple curve through all "
        "points according to the independent checker; an *error where due* is an error on a "
        "request for which no curve exists, which is decided from the arrays of the mesh alone; "
        "any other error of the package is *declined though possible*; everything else is *wrong*. "
        f"There are {results['requests']} requests per mesh through random vertices (shortest "
        f"order, seed {results['seed']}): closed curves through 3–5 and open ones through 2–4, "
        "each once with all points on one part of the surface that is connected by common edges, "
        "and once with points anywhere. The paper has no corresponding measurement; it shows a "
        "gallery of third-party meshes (Fig. 15).\n\n"
        + report.table(("meshes", "requests", GOOD, DUE, DECLINED, WRONG, "CPU seconds"), rows)
        + "\n\n"
        + (
            "".join(f"- {_line(each)}\n" for each in listed[:LISTED])
            or "No request was declined or answered wrongly.\n"
        )
        + "\nThe slowest requests: "
        + report.listed(f"{_name(each)} {each['seconds']:.0f} s" for each in slowest)
        + "."
    )


def summary(results: Results) -> str:
    """What the documents say of it."""
    answers = results["answers"]
    meshes = len({(each["folder"], each["mesh"]) for each in answers})
    counts = Counter(each["verdict"] for each in answers)
    slowest = max(each["seconds"] for each in answers if each["faces"] < SMALL)
    return report.item(
        "`python -m benchmarks corpus`, every kind of broken mesh (self-crossing, non-manifold, "
        "with reversed faces, degenerate, in pieces, huge): "
        f"of {len(answers):,} requests on {meshes} meshes {counts[GOOD]:,} curves are good, "
        f"{counts[DUE]} are impossible and refused with an error that says why. "
        f"{report.none_or(counts[DECLINED]).capitalize()} refused although possible, and "
        f"{report.none_or(counts[WRONG])} wrong. Below "
        f"{SMALL:,} faces the slowest takes {slowest:.1f} seconds."
    )


def _items(scale: Scale) -> list[Item]:
    items = [Item(GENERATED, name, None, r) for name, r in _generated_requests(scale)]
    if scale is Scale.SMOKE:
        return items
    generator = np.random.default_rng(SEED)
    for folder in FOLDERS:
        files = mesh_files(folder)
        share = scale.choose(len(files), -(-len(files) // 10))
        for place in np.sort(generator.choice(len(files), share, replace=False)):
            for request in range(len(REQUESTS)):
                name = str(files[place].relative_to(COLLECTIONS / folder))
                items.append(Item(folder, name, files[place], request))
    return items


def _generated_requests(scale: Scale) -> list[tuple[str, int]]:
    """All requests on generated meshes, or one per mesh at the scale of a smoke test."""
    names = [name for name, _ in defective_meshes()]
    if scale is Scale.SMOKE:
        return [(name, place % len(REQUESTS)) for place, name in enumerate(names)]
    return [(name, request) for name in names for request in range(len(REQUESTS))]


def _answer(one: Isolated[Item, Outcome]) -> Results:
    verdict = WRONG if one.result is None or one.output.strip() else one.result.verdict
    words = one.failure if one.result is None else one.result.words
    return {
        "folder": one.item.folder,
        "mesh": one.item.name,
        "request": one.item.request,
        "faces": one.result.faces if one.result else 0,
        "verdict": verdict,
        "words": words[:300] if verdict in (DECLINED, WRONG) else "",
        "printed": one.output.strip()[:200],
        "seconds": round(one.seconds, 2),
    }


def _name(answer: Results) -> str:
    of_one_part, closed = REQUESTS[answer["request"]]
    where = "one part" if of_one_part else "anywhere"
    return f"{answer['folder']}/{answer['mesh']} {KIND[closed]} {where}"


def _line(answer: Results) -> str:
    printed = f" printed {answer['printed']!r}" if answer["printed"] else ""
    words = f"{answer['words']}{printed} ({answer['seconds']:.1f} s)"
    return f"{_name(answer)}: {answer['verdict']}: {words}"


def _row(label: str, answers: Sequence[Results]) -> tuple[object, ...]:
    counts = Counter(each["verdict"] for each in answers)
    shares = [
        f"{counts[each]} ({100 * counts[each] / len(answers):.1f} %)"
        for each in (GOOD, DUE, DECLINED, WRONG)
    ]
    meshes = len({(each["folder"], each["mesh"]) for each in answers})
    seconds = sum(each["seconds"] for each in answers)
    return (f"{meshes} {label}", len(answers), *shares, f"{seconds:.0f}")
