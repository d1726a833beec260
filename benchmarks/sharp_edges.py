"""Measures whether curves beside sharp edges follow the edge when `sharp_edge_map` is used."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

import nicmm_core as nicmm
from nicmm_core.geometry.array_types import FloatArray, IntArray
from nicmm_core.geometry.curve import SurfaceCurve
from nicmm_core.geometry.distances import distance_to_segments
from nicmm_core.geometry.mesh import Mesh
from nicmm_core.geometry.surface_points import SurfacePoints
from nicmm_core.geometry.tracing import trace_from
from tests.oracles.checker import judge_curve

from . import collections, report
from .cad_shapes import cad_shapes
from .evidence import DESIGN, Results
from .scale import Scale

TITLE = "Sharp edges to follow"
ROOMS = DESIGN

SEEDS = (6, 7, 8, 9)
"""Seeds of the generated bodies and their lines; third-party meshes use the first one."""

OFFSET = 0.02
"""Distance of the control points from the edge along the surface, in diagonals."""

NEAR = 1.5
"""Greatest mean distance of the free curve from the line, in units of `OFFSET`."""

LEAST_LENGTH, MOST_LENGTH = 0.25, 0.6
"""Bounds on the length of a line of sharp edges, in diagonals."""

STRAIGHT = 0.8
"""Cosine of the greatest angle between two consecutive edges of a line."""

CLOSE = 0.5
"""Share of a line, around its middle, on which distances are measured.

Towards its ends the curve still approaches the line.
"""

WANTED = 0.25
"""Distance up to which a curve counts as being on the line, in edge lengths."""

AS_SHORT = 1.1
"""Relative length up to which another path along sharp edges competes with a line."""

MECHANICAL = (0.02, 0.2)
"""Bounds on the share of vertices on sharp edges for a third-party mesh to count as CAD-like."""

FEWEST_VERTICES = 2000

LINES = 3
"""Greatest number of lines per mesh."""


def measure(scale: Scale) -> Results:
    """Design open curves beside lines of sharp edges, without and with the map."""
    seeds = SEEDS[: scale.choose(len(SEEDS), 1)]
    groups = {"generated": _generated(seeds, scale.choose(12, 8, 2))}
    if scale is not Scale.SMOKE:
        groups["third-party"] = _mechanical(scale.choose(40, 12))
    lines = {
        label: [line for each in meshes for line in _beside_lines(*each)]
        for label, meshes in groups.items()
    }
    if not any(lines.values()):
        raise SystemExit("No mesh has a line of sharp edges with room beside it")
    return {
        "seeds": list(seeds),
        "most_lines": LINES,
        "lengths": [LEAST_LENGTH, MOST_LENGTH],
        "offset": OFFSET,
        "near": NEAR,
        "as_short": AS_SHORT,
        "mechanical": list(MECHANICAL),
        "lines": lines,
    }


def section(results: Results) -> str:
    """Distances of the curves to the lines, without and with the map."""
    header = (
        "meshes", "lines", "free curve: median", "with the map: median", "with the map: 75 %",
        "with the map: 90 %", f"within {WANTED:g} edge lengths", "simple, through its points",
    )  # fmt: skip
    rows = [_row(label, lines) for label, lines in results["lines"].items() if lines]
    least, most = results["lengths"]
    low, high = results["mechanical"]
    return (
        "Open curves were designed beside lines of sharp edges, without a map and with "
        "`sharp_edge_map(mesh)` as alignment, to see whether they then follow the line. Each row "
        "is a group of meshes. The distances are mean distances from the middle half of a line to "
        "the curve, in mean edge lengths of the line: median of the free curves, and median, 75 % "
        "and 90 % quantiles with the map. The last columns are the share of curves within "
        f"{WANTED:g} edge lengths, and the number that are simple and pass their points. The paper "
        "proposes such maps (section 3.3) but does not measure them.\n\n"
        + report.table(header, rows)
        + f"\n\nThere are up to {results['most_lines']} lines per mesh, {least:g} to {most:g} "
        f"diagonals long (seeds {report.listed(map(str, results['seeds']))}). A curve joins two "
        f"points beside the ends of a line, {100 * results['offset']:g} % of the diagonal away "
        "from it on one side. A line counts if the mean distance of the free curve is at most "
        f"{results['near']:g} times that. Lines are left out if it is ambiguous which one the "
        "curve should follow: if another line is closer than the points; if another path along "
        f"sharp edges joins the ends and is at most {results['as_short']:g} times as long, as on "
        "the other half of a circle; or if a face beside the line has its third corner on another "
        "line, so that the map joins both. The third-party meshes are those with "
        f"{100 * low:g} to {100 * high:g} % of their vertices on sharp edges."
    )


def summary(results: Results) -> str:
    """What the documents say of it."""
    every = [line for lines in results["lines"].values() for line in lines]
    others = [line["mesh"] for line in every if line["aligned"] > WANTED]
    kinds = sorted({name.split(", ")[-1].rstrip(" 0123456789") for name in others})
    where = f"; the other {len(others)} are on: {report.listed(kinds)}" if kinds else ""
    return report.item(
        "A curve whose ends are 2 % of the diagonal away from a sharp edge is attracted to the "
        f"edge and runs along it: of {len(every)} "
        "[measured](../benchmarks/RESULTS.md#sharp-edges-to-follow) lines, "
        f"{len(every) - len(others)} are within a quarter of a mesh edge of it{where}. If other "
        "sharp edges are about as near, such as a neighbouring rim of a shaft or the other half of "
        "a circle, the curve may follow those; "
        "[via points](via_points.md) select one."
    )


def _row(label: str, lines: Sequence[Results]) -> tuple[object, ...]:
    after = [line["aligned"] for line in lines]
    return (
        label,
        len(lines),
        f"{np.median([line['free'] for line in lines]):.2f}",
        *(f"{value:.2f}" for value in np.quantile(after, [0.5, 0.75, 0.9])),
        f"{100 * np.mean(np.array(after) <= WANTED):.0f} %",
        f"{sum(not line['faults'] for line in lines)} of {len(lines)}",
    )


def _beside_lines(name: str, mesh: Mesh, generator: np.random.Generator) -> Iterator[Results]:
    """Distances from the lines of a mesh to the free curve and to the curve with the map."""
    weights = nicmm.sharp_edge_map(mesh)
    for line, points, free in itertools.islice(_close(name, mesh, generator), LINES):
        try:
            aligned = nicmm.design_curve(mesh, points, closed=False, alignment=weights)
        except nicmm.NicmmError as error:
            print(f"  {name}: {error}", flush=True)
            continue
        edge_length = np.linalg.norm(np.diff(line, axis=0), axis=1).mean()
        before, after = (_away(line, curve) / edge_length for curve in (free, aligned.curves[0]))
        verdict = judge_curve(mesh, aligned.curves[0], points.positions(mesh), closed=False)
        print(f"  {name}: {before:.2f} -> {after:.2f} edges", flush=True)
        yield {
            "mesh": name,
            "free": round(float(before), 6),
            "aligned": round(float(after), 6),
            "faults": list(verdict.faults),
        }


def _generated(
    seeds: tuple[int, ...], count: int
) -> Iterator[tuple[str, Mesh, np.random.Generator]]:
    """Bodies of every seed, each with the generator that chooses its lines."""
    for seed in seeds:
        generator = np.random.default_rng(seed)
        for name, mesh in cad_shapes(generator, count):
            yield f"seed {seed}, {name}", mesh, generator


def _mechanical(count: int) -> Iterator[tuple[str, Mesh, np.random.Generator]]:
    """Closed third-party meshes on which some edges, but not too many, are sharp."""
    low, high = MECHANICAL
    generator = np.random.default_rng(SEEDS[0])
    for name, mesh in collections.clean(count):
        share = nicmm.sharp_edge_map(mesh).mean()
        if len(mesh.vertices) >= FEWEST_VERTICES and low <= share <= high:
            yield name, mesh, generator


def _close(
    name: str, mesh: Mesh, generator: np.random.Generator
) -> Iterator[tuple[FloatArray, SurfacePoints, SurfaceCurve]]:
    """Lines of sharp edges, points beside their ends and the free curve, if that is close."""
    for line, points in _lines(mesh, generator):
        try:
            free = nicmm.design_curve(mesh, points, closed=False).curves[0]
        except nicmm.NicmmError as error:
            print(f"  {name}: {error}", flush=True)
            continue
        if _away(line, free) <= NEAR * OFFSET * mesh.diagonal:
            yield line, points, free


def _lines(
    mesh: Mesh, generator: np.random.Generator
) -> Iterator[tuple[FloatArray, SurfacePoints]]:
    """Lines of sharp edges, (n, 3), each with a point to its left beside either end."""
    edges = nicmm.sharp_edges(mesh)
    if not len(edges):
        return
    around: dict[int, list[int]] = {}
    for a, b in edges.tolist():
        around.setdefault(a, []).append(b)
        around.setdefault(b, []).append(a)
    sides = mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    left = {(a, b): place // 3 for place, (a, b) in enumerate(sides.tolist())}
    used: set[int] = set()
    everything = mesh.vertices[edges]
    for place in generator.permutation(len(edges)).tolist():
        a, b = edges[place].tolist()
        if a in used or b in used:
            continue
        line = _followed(mesh, around, a, b)
        used.update(line)
        positions = mesh.vertices[line]
        length = np.linalg.norm(np.diff(positions, axis=0), axis=1).sum()
        if len(line) < 6 or not LEAST_LENGTH * mesh.diagonal <= length:
            continue
        points = _beside(mesh, left, np.array(line))
        if points is None or _as_short(mesh, edges, line) or _merged(mesh, edges, line):
            continue
        # If another edge is closer, it is ambiguous which one the curve should follow.
        others = everything[~np.isin(edges, line).all(axis=1)]
        if len(others):
            start, end = others.transpose(1, 0, 2)
            away = [
                distance_to_segments(np.broadcast_to(point, start.shape), start, end).min()
                for point in np.concatenate([points.positions(mesh), positions[2:-2]])
            ]
            if min(away) < OFFSET * mesh.diagonal:
                continue
        yield positions, points


def _followed(mesh: Mesh, around: dict[int, list[int]], a: int, b: int) -> list[int]:
    """Line that contains an edge, as far as it is smooth and not too long."""
    line = [a, b]
    for _ in range(2):
        while len(around[line[-1]]) == 2:
            (onward,) = (v for v in around[line[-1]] if v != line[-2])
            before, after = np.diff(mesh.vertices[[line[-2], line[-1], onward]], axis=0)
            cosine = before @ after / np.linalg.norm(before) / np.linalg.norm(after)
            steps = np.diff(mesh.vertices[line], axis=0)
            too_long = np.linalg.norm(steps, axis=1).sum() > MOST_LENGTH * mesh.diagonal
            if onward in line or cosine < STRAIGHT or too_long:
                break
            line.append(onward)
        line.reverse()
    return line


def _as_short(mesh: Mesh, edges: IntArray, line: list[int]) -> bool:
    """Whether another path along sharp edges joins the ends of a line and is hardly longer."""
    length = np.linalg.norm(np.diff(mesh.vertices[edges], axis=1)[:, 0], axis=1)
    own = np.isin(edges, line).all(axis=1)
    size = len(mesh.vertices)
    arcs = sparse.csr_array((length[~own], tuple(edges[~own].T)), shape=(size, size))
    limit = AS_SHORT * float(length[own].sum())
    away = csgraph.dijkstra(arcs, directed=False, indices=line[0], limit=limit)
    return bool(np.isfinite(away[line[-1]]))


def _merged(mesh: Mesh, edges: IntArray, line: list[int]) -> bool:
    """Whether a face beside the inner part of a line has its third corner on another line."""
    inner = np.isin(mesh.faces, line[2:-2]).sum(axis=1) == 2
    sharp = np.isin(mesh.faces, edges).all(axis=1)
    return bool((inner & sharp & ~np.isin(mesh.faces, line).all(axis=1)).any())


def _beside(mesh: Mesh, left: dict[tuple[int, int], int], line: IntArray) -> SurfacePoints | None:
    """Points to the left of the ends of a line; None if the boundary is closer than that."""
    faces, barycentric, across = [], [], []
    for a, b in (line[1:3], line[-3:-1]):
        face = left.get((int(a), int(b)))
        if face is None:
            return None
        weights = np.where(np.isin(mesh.faces[face], (a, b)), 0.495, 0.01)
        along = mesh.vertices[b] - mesh.vertices[a]
        faces.append(face)
        barycentric.append(weights)
        across.append(np.cross(mesh.face_normals[face], along / np.linalg.norm(along)))
    start = SurfacePoints(np.array(faces), np.array(barycentric))
    length = np.full(2, OFFSET * mesh.diagonal)
    points, stuck, _ = trace_from(mesh, start, np.array(across), length)
    return None if stuck.any() else points


def _away(line: FloatArray, curve: SurfaceCurve) -> float:
    """Mean distance from the middle part of a line to a curve."""
    lengths = np.linalg.norm(np.diff(line, axis=0), axis=1)
    arc = np.concatenate([[0.0], np.cumsum(lengths)])
    share = np.linspace(0.5 - 0.5 * CLOSE, 0.5 + 0.5 * CLOSE, 64) * arc[-1]
    samples = np.stack([np.interp(share, arc, line[:, axis]) for axis in range(3)], axis=1)
    start, end = curve.points[:-1], curve.points[1:]
    distance = [
        distance_to_segments(np.broadcast_to(point, start.shape), start, end).min()
        for point in samples
    ]
    return float(np.mean(distance))
