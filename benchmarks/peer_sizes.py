"""Times of this package and of other systems at several mesh sizes; a part of `peers`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

import nicmm_core as nicmm
from nicmm_core.geometry.mesh import Mesh

from . import collections, report
from .evidence import Results
from .peer_systems import LATER, SystemsProcess, task_on
from .samples import random_sets
from .scale import Scale

SEED = 19
SUBDIVISIONS = (2, 3, 4)
"""Loop subdivisions of meshes of SHREC16: 4,000, 16,000 and 64,000 vertices."""

PATIENCE = 120.0
"""Time limit of a system in seconds."""

FIRST, ANOTHER = "elastic, first curve", "elastic, another on the same Designer"
RIVAL = "potpourri3d, signed heat"


def measured_sizes(scale: Scale, systems: Sequence[str]) -> list[Results]:
    """Times of each system on each mesh in seconds, by increasing size; None where one failed."""
    process = SystemsProcess()
    asked = [*systems, LATER] if RIVAL in systems else list(systems)
    found = []
    for level in SUBDIVISIONS if scale is not Scale.SMOKE else (0,):
        meshes = collections.creatures(1)
        if scale is not Scale.SMOKE:
            meshes = collections.shrec16(scale.choose(8, 2), level)
        for name, mesh, points in random_sets(meshes, 1, SEED):
            try:
                task = task_on(mesh, points)
            except nicmm.UnreachableError as error:
                print(f"  {name}: {error}", flush=True)
                continue
            designer = nicmm.Designer(Mesh(mesh.vertices, mesh.faces))
            moved = points.copy()
            moved[0] = mesh.faces[(mesh.faces == points[0]).any(axis=1)].max()
            seconds: dict[str, float | None] = {
                FIRST: designer.design(points, order="shortest").seconds,
                ANOTHER: designer.design(moved, order="shortest").seconds,
            }
            for system in asked:
                reply = process.ask(system, task, PATIENCE)
                seconds[system] = None if isinstance(reply, str) else reply[1]
            rounded = {key: value and round(value, 6) for key, value in seconds.items()}
            found.append({"mesh": name, "vertices": len(mesh.vertices), "seconds": rounded})
            print(f"  {name}, {len(mesh.vertices)} vertices: {rounded}", flush=True)
    process.end()
    return found


def sizes_section(measured: Sequence[Results]) -> str:
    """Table of medians, and a comparison of a first and of a further curve with signed heat."""
    sizes: dict[int, list[Results]] = {}
    for each in measured:
        sizes.setdefault(round(each["vertices"], -3), []).append(each)
    names = list(dict.fromkeys(name for each in measured for name in each["seconds"]))
    rows = []
    for size, of_size in sizes.items():
        medians = [_median(of_size, name) for name in names]
        rows.append((f"{size:,}", len(of_size), *(_in_milliseconds(each) for each in medians)))
    text = report.table(("vertices", "meshes", *names), rows) + (
        "\n\nMilliseconds, medians over the meshes, which are the same ones of SHREC16 after two, "
        "three and four Loop subdivisions; preparation included except for another curve and a "
        "later distance."
    )
    for size, of_size in sizes.items():
        first, another = (
            _ratio(of_size, ours, theirs) for ours, theirs in ((FIRST, RIVAL), (ANOTHER, LATER))
        )
        if first is not None and another is not None:
            text += (
                f" At {size:,} vertices a first curve takes {first:.2f} times as long as signed "
                f"heat, and another one {another:.2f} times as long as a later distance."
            )
    return text


def _median(measured: Sequence[Results], name: str) -> float | None:
    values = [each["seconds"].get(name) for each in measured]
    known = [value for value in values if value is not None]
    return float(np.median(known)) if known else None


def _ratio(measured: Sequence[Results], ours: str, theirs: str) -> float | None:
    """Median of the per-mesh ratios, which are not affected by other load on the machine."""
    pairs = [(each["seconds"].get(ours), each["seconds"].get(theirs)) for each in measured]
    ratios = [one / other for one, other in pairs if one is not None and other is not None]
    return float(np.median(ratios)) if ratios else None


def _in_milliseconds(seconds: float | None) -> str:
    return "–" if seconds is None else f"{1000 * seconds:.0f}"
