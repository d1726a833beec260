"""Every mesh that is there: a valid curve, or an error where no curve can be.

`tests.oracles.corpus` asks for a curve and says which of four kinds the answer is.
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
from .scale import Scale

PATIENCE = 1200.0
"""Seconds by the wall clock after which a curve is given up: it hangs."""

LISTED = 60
SLOWEST = 8

KIND = {True: "closed", False: "open"}


def run(scale: Scale) -> None:
    """Ask for curves on all meshes and sort what comes, one collection after the other."""
    items = _items(scale)
    folders = [f for f in (GENERATED, *FOLDERS) if any(item.folder == f for item in items)]
    done: list[Isolated[Item, Outcome]] = []
    for number, folder in enumerate(folders, start=1):
        here = [item for item in items if item.folder == folder]
        for one in isolated(outcome, here, PATIENCE):
            done.append(one)
            if _verdict(one) in (DECLINED, WRONG):
                print(f"  {_line(one)}", flush=True)
        _write(done, folders[:number], folders[number:], scale)


def _write(
    done: Sequence[Isolated[Item, Outcome]],
    folders: Sequence[str],
    missing: Sequence[str],
    scale: Scale,
) -> None:
    """The section as far as the measurement is; a large collection takes hours."""
    rows = []
    for folder in folders:
        rows += _row(folder, [one for one in done if one.item.folder == folder])
    rows += _row("all", done)
    slowest = sorted(done, key=lambda one: -one.seconds)[:SLOWEST]
    listed = [one for one in done if _verdict(one) in (DECLINED, WRONG)]
    body = (
        f"Seed {SEED}; on each mesh {len(REQUESTS)} curves through random vertices, shortest "
        "order: 3–5 closed and 2–4 open, drawn from one part of the surface that "
        "common edges connect, and from all of its vertices. Whether an error is due is decided "
        "from the arrays alone.\n\n"
        + report.table(("meshes", "curves", GOOD, DUE, DECLINED, WRONG, "CPU seconds"), rows)
        + "\n\n"
        + ("".join(f"- {_line(one)}\n" for one in listed[:LISTED]) or "None declined or wrong.\n")
        + "\nThe slowest: "
        + report.listed(f"{_name(one.item)} {one.seconds:.0f} s" for one in slowest)
        + "."
        + (f"\n\nNot measured yet: {report.listed(missing)}." if missing else "")
    )
    report.write_section("corpus", "Every mesh", body, scale)


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
    """All of them, or one request each."""
    names = [name for name, _ in defective_meshes()]
    if scale is Scale.SMOKE:
        return [(name, place % len(REQUESTS)) for place, name in enumerate(names)]
    return [(name, request) for name in names for request in range(len(REQUESTS))]


def _verdict(one: Isolated[Item, Outcome]) -> str:
    return WRONG if one.result is None or one.output.strip() else one.result.verdict


def _name(item: Item) -> str:
    of_one_part, closed = REQUESTS[item.request]
    where = "one part" if of_one_part else "anywhere"
    return f"{item.folder}/{item.name} {KIND[closed]} {where}"


def _line(one: Isolated[Item, Outcome]) -> str:
    words = one.failure if one.result is None else one.result.words
    printed = f" printed {one.output.strip()[:200]!r}" if one.output.strip() else ""
    return f"{_name(one.item)}: {_verdict(one)}: {words[:300]}{printed} ({one.seconds:.1f} s)"


def _row(label: str, done: Sequence[Isolated[Item, Outcome]]) -> list[tuple[object, ...]]:
    if not done:
        return []
    counts = Counter(map(_verdict, done))
    shares = [
        f"{counts[each]} ({100 * counts[each] / len(done):.1f} %)"
        for each in (GOOD, DUE, DECLINED, WRONG)
    ]
    meshes = len({(one.item.folder, one.item.name) for one in done})
    return [(f"{meshes} {label}", len(done), *shares, f"{sum(one.seconds for one in done):.0f}")]
