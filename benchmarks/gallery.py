"""Renders pictures of alignment (Fig. 13), obstacles (Fig. 14) and many meshes (Fig. 15)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph
from scipy.spatial import cKDTree

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.array_types import FloatArray, IntArray
from nicmm_core.geometry.curve import SurfaceCurve, is_one_curve, resample
from nicmm_core.geometry.mesh import Mesh, unique_edges
from nicmm_core.geometry.normals import vertex_normals
from nicmm_core.io.files import read_mesh
from tests.oracles.mesh_files import mesh_files

from . import collections, renders, report
from .evidence import EVERY_METHOD, Results
from .lanes import lane_beside
from .methods import METHODS
from .scale import Scale

TITLE = "Gallery: alignment and obstacles (Fig. 13, 14, 15)"
ROOMS = EVERY_METHOD

SEED = 16
METHOD = METHODS[0]

POINTS = 5
RINGS = 5
"""Number of places that are tried per mesh; around a thin limb there is no ring of points."""

RING_RADIUS = 0.22
"""Distance of the control points from the centre of their ring, in √area."""

OBSTACLE_RADIUS = 0.08
"""Radius of the obstacle on the free curve, in √area."""

FOLLOWED_WITHIN = 0.015
"""Distance from the middle line of a lane up to which a curve counts as near it, in diagonals."""

FEWEST_VERTICES, MOST_VERTICES = 1500, 12000

FOLLOWED = 0.8
"""Share of the middle line of an alignment region that must be near the curve."""

ALIGNED, AVOIDED, MANY = "gallery_alignment.png", "gallery_obstacles.png", "gallery.png"
"""File names of the pictures for Fig. 13, 14 and 15."""

OBSTACLE, ALIGNMENT = "obstacle", "alignment"
GUIDANCE = (OBSTACLE, ALIGNMENT, None)
"""Kinds of guidance, which the meshes of Fig. 15 get in turn."""


@dataclass(frozen=True)
class Region:
    """A painted region of a mesh.

    Attributes
    ----------
    kind : {"obstacle", "alignment"}
        Kind of guidance.
    places : (p, 3) float array
        Centre of an obstacle, or points of the middle line of a lane.
    radius : float
        Distance from the centre at which an obstacle ends, or distance from the middle line
        up to which a curve follows a lane.
    weights : (V,) float array
        Map with the weights of the region.
    """

    kind: str
    places: FloatArray
    radius: float
    weights: FloatArray

    def share(self, mesh: Mesh, curve: SurfaceCurve) -> float:
        """Share of the curve inside an obstacle, or share of a middle line that is near the curve.

        The inside of an obstacle is where its weight is greater than ½.
        """
        even, segment = resample(curve.points, 1024)
        if self.kind == ALIGNMENT:
            return float((cKDTree(even).query(self.places)[0] < self.radius).mean())
        corners = self.weights[mesh.faces[curve.faces[segment]]]
        return float(((curve.barycentric[segment] * corners).sum(axis=1) > 0.5).mean())


@dataclass(frozen=True)
class Example:
    """A mesh with a free curve and, if there is a painted region, a guided curve.

    Attributes
    ----------
    name : str
        Name of the mesh.
    mesh : Mesh
        Surface.
    region : Region or None
        Obstacle or lane.
    free : Design
        Curve without guidance.
    guided : Design or None
        Curve with the region as obstacle or alignment; None without a region.
    """

    name: str
    mesh: Mesh
    region: Region | None
    free: nicmm.Design
    guided: nicmm.Design | None

    @property
    def shares(self) -> tuple[float, float] | None:
        """`Region.share` of the free curve and of the guided curve; None without a region."""
        if self.region is None or self.guided is None:
            return None
        return (
            self.region.share(self.mesh, self.free.curves[0]),
            self.region.share(self.mesh, self.guided.curves[0]),
        )

    def results(self) -> Results:
        """Summary of the example; shares and seconds are those without and with guidance."""
        designs = [design for design in (self.free, self.guided) if design is not None]
        shares = self.shares
        return {
            "mesh": self.name,
            "vertices": len(self.mesh.vertices),
            "guidance": None if self.region is None else self.region.kind,
            "shares": None if shares is None else [round(share, 4) for share in shares],
            "status": designs[-1].status.name,
            "seconds": [round(design.seconds, 2) for design in designs],
        }

    def picture(self, title: str, free: bool = True, guided: bool = True) -> renders.Picture:
        """Painted mesh with the free curve in white and the guided curve in blue."""
        curves = [(self.free.curves[0], renders.WHITE)] if free else []
        if guided and self.guided is not None:
            curves.append((self.guided.curves[0], renders.BLUE))
        painted = {} if self.region is None else {self.region.kind: self.region.weights}
        return renders.Picture(
            title,
            self.mesh,
            curves,
            obstacles=painted.get(OBSTACLE),
            alignment=painted.get(ALIGNMENT),
        )


def measure(scale: Scale) -> Results:
    """Render the counterparts of all three figures."""
    generator = np.random.default_rng(SEED)
    first = _example(*_named_mesh("horse", scale), ALIGNMENT, generator)
    second = _example(*_named_mesh("woman", scale), OBSTACLE, generator)
    if first is None or second is None:
        raise SystemExit("There is no ring of points with a curve for Fig. 13 or 14")
    _render_alignment(first, scale)
    folder = report.figures_folder(scale)
    renders.render_sheet([second.picture("with an obstacle")], folder / AVOIDED, scale)
    examples = _gallery(scale, generator)
    if not examples:
        raise SystemExit("No mesh has a ring of points with a curve for Fig. 15")
    renders.render_sheet(
        [example.picture(example.name) for example in examples], folder / MANY, scale
    )
    return {
        "seed": SEED,
        "method": METHOD,
        "points": POINTS,
        "examples": [example.results() for example in (first, second, *examples)],
        "pictures": {"alignment": ALIGNED, "obstacle": AVOIDED, "many": MANY},
    }


def section(results: Results) -> str:
    """The pictures, and the effect of guidance in each."""
    pictures, examples = results["pictures"], results["examples"]
    alignment = report.figure(
        pictures["alignment"],
        "Alignment (Fig. 13): without guidance, and aligned with the blue region",
    )
    obstacle = report.figure(
        pictures["obstacle"], "An obstacle (Fig. 14): curve without it (white) and with it (blue)"
    )
    many = report.figure(
        pictures["many"],
        "Many meshes (Fig. 15): curves without guidance (white), and with an obstacle or an "
        "alignment region (blue)",
    )
    return (
        f"The pictures show curves of `{results['method']}` without guidance and with painted "
        "regions, as in Fig. 13, 14 and 15 of the paper. Each row of the table is one mesh. Its "
        "share is that of the curve inside the obstacle, or that of the middle line of the "
        "alignment region that is near the curve, without guidance → with guidance; the times are "
        "those of both curves. On each mesh the curve passes "
        f"{results['points']} control points on a ring around a random vertex (seed "
        f"{results['seed']}). Obstacles lie on the free curve; alignment regions are lanes beside "
        f"it, as in the section on lanes.\n\n{alignment}\n\n{obstacle}\n\n{many}\n\n"
        f"{_table(examples)}\n\n{_findings(examples)}"
    )


def _render_alignment(example: Example, scale: Scale) -> None:
    """Render the curves without and with the region, from the same view."""
    view = renders.best_view(example.picture(""))
    renders.render_sheet(
        [
            example.picture("without guidance", guided=False),
            example.picture("with alignment", free=False),
        ],
        report.figures_folder(scale) / ALIGNED,
        scale,
        views=[view, view],
    )


def _named_mesh(kind: str, scale: Scale) -> tuple[str, Mesh]:
    """First mesh of a class of SHREC16, or a disc at the scale of a smoke test."""
    if scale is Scale.SMOKE:
        return "disc", shapes.disc(16)
    for name, mesh in collections.shrec16_class(kind):
        return name, mesh
    raise SystemExit(f"SHREC16 has no class {kind}")


def _meshes(scale: Scale) -> Iterator[tuple[str, Mesh]]:
    """Meshes of several collections in turn, with numbers of vertices that suit a picture."""
    if scale is Scale.SMOKE:
        yield "disc", shapes.disc(16)
        return
    folders = [mesh_files(folder) for folder in ("clean", "thingi10k", "shapes")]
    longest = max(len(files) for files in folders)
    for number in range(longest):
        for files in folders:
            if number >= len(files):
                continue
            try:
                mesh = read_mesh(files[number])
            except nicmm.NicmmError as error:
                print(f"  {files[number].stem}: {error}", flush=True)
                continue
            if FEWEST_VERTICES <= len(mesh.vertices) <= MOST_VERTICES:
                yield files[number].stem, mesh


def _gallery(scale: Scale, generator: np.random.Generator) -> list[Example]:
    examples: list[Example] = []
    wanted = scale.choose(16, 3)
    for name, mesh in _meshes(scale):
        kind = GUIDANCE[len(examples) % len(GUIDANCE)]
        example = _example(name, mesh, kind, generator)
        if example is not None:
            examples.append(example)
        if len(examples) == wanted:
            break
    return examples


def _example(
    name: str, mesh: Mesh, kind: str | None, generator: np.random.Generator
) -> Example | None:
    """Free and guided curve through the first ring that has both; None if no ring has."""
    for _ in range(RINGS):
        points = _ring(mesh, generator)
        if points is None:
            continue
        try:
            free = nicmm.design_curve(mesh, points, order="shortest", method=METHOD)
            region = None if kind is None else _region(mesh, free.curves[0], kind)
            if kind is not None and region is None:
                print(f"  {name}: no room for a lane", flush=True)
                continue
            guided = None if region is None else _guided(mesh, points, region)
        except nicmm.NicmmError as error:
            print(f"  {name}: {error}", flush=True)
            continue
        if all(is_one_curve(design.curves) for design in (free, guided) if design is not None):
            print(f"  {name}: {kind or 'free'}, {free.seconds:.1f} s", flush=True)
            return Example(name, mesh, region, free, guided)
        print(f"  {name}: not one curve", flush=True)
    print(f"  {name}: left out, none of {RINGS} rings of points has a curve", flush=True)
    return None


def _guided(mesh: Mesh, points: IntArray, region: Region) -> nicmm.Design:
    return nicmm.design_curve(
        mesh,
        points,
        order="shortest",
        method=METHOD,
        obstacles=region.weights if region.kind == OBSTACLE else None,
        alignment=region.weights if region.kind == ALIGNMENT else None,
    )


def _ring(mesh: Mesh, generator: np.random.Generator) -> IntArray | None:
    """Ring of vertices around a random one, at about the same distance along edges."""
    component = np.bincount(mesh.face_component, weights=mesh.face_areas).argmax()
    own = mesh.face_component == component
    radius = RING_RADIUS * float(np.sqrt(mesh.face_areas[own].sum()))
    middle = int(generator.choice(np.unique(mesh.faces[own])))
    edges = unique_edges(mesh.faces)[0]
    lengths = np.linalg.norm(mesh.vertices[edges[:, 0]] - mesh.vertices[edges[:, 1]], axis=1)
    size = len(mesh.vertices)
    graph = sparse.csr_array((lengths, (edges[:, 0], edges[:, 1])), shape=(size, size))
    distance = csgraph.dijkstra(graph, directed=False, indices=middle)
    near = np.flatnonzero(np.abs(distance - radius) < 0.1 * radius)
    normal = vertex_normals(mesh.vertices, mesh.faces)[middle]
    first = np.cross(normal, np.roll(np.eye(3)[np.abs(normal).argmax()], 1))
    first /= np.linalg.norm(first)
    offset = mesh.vertices[near] - mesh.vertices[middle]
    angle = np.arctan2(offset @ np.cross(normal, first), offset @ first)
    chosen = []
    for wanted in np.arange(POINTS) * 2 * np.pi / POINTS:
        apart = np.abs(np.angle(np.exp(1j * (angle - wanted))))
        if not len(near) or apart.min() > np.pi / POINTS:
            return None
        chosen.append(int(near[apart.argmin()]))
    return np.array(chosen)


def _region(mesh: Mesh, curve: SurfaceCurve, kind: str) -> Region | None:
    """An obstacle on the curve, or a lane beside it; None if there is no room for a lane.

    Both lie at the middle of the longest part of the curve between two control points.
    """
    if kind == ALIGNMENT:
        lane = lane_beside(mesh, curve)
        if lane is None:
            return None
        return Region(kind, lane.line, FOLLOWED_WITHIN * mesh.diagonal, lane.weights)
    radius = OBSTACLE_RADIUS * float(np.sqrt(mesh.face_areas.sum()))
    stretch = _longest_stretch(curve)
    middle = stretch[len(stretch) // 2][None]
    distance = cKDTree(middle).query(mesh.vertices)[0]
    return Region(kind, middle, radius, np.clip(2.0 - 2.0 * distance / radius, 0.0, 1.0))


def _longest_stretch(curve: SurfaceCurve) -> FloatArray:
    """Evenly spaced points of the longest part of a curve between two control points."""
    count = 256
    even, segment = resample(curve.points, count)
    bounds = [int((segment < index).sum()) for index in np.sort(curve.control_index)]
    starts = np.array(bounds)
    lengths = np.diff([*bounds, bounds[0] + count])
    longest = int(lengths.argmax())
    return even[(starts[longest] + np.arange(lengths[longest])) % count]


def _table(examples: Sequence[Results]) -> str:
    rows = []
    for example in examples:
        shares = example["shares"]
        rows.append(
            (
                example["mesh"],
                example["vertices"],
                example["guidance"] or "–",
                "–" if shares is None else " → ".join(f"{100 * share:.0f} %" for share in shares),
                example["status"],
                " and ".join(f"{seconds:.1f}" for seconds in example["seconds"]),
            )
        )
    header = ("mesh", "vertices", "guidance", "share, without → with", "status", "seconds")
    return report.table(header, rows)


def _findings(examples: Sequence[Results]) -> str:
    """Whether guidance had the intended effect, which is the paper's claim."""
    text = ""
    for kind, claim in ((OBSTACLE, "avoids"), (ALIGNMENT, "follows")):
        pairs = [example["shares"] for example in examples if example["guidance"] == kind]
        if not pairs:
            continue
        works = sum(
            guided == 0.0 if kind == OBSTACLE else guided >= FOLLOWED for _, guided in pairs
        )
        without, guided = 100 * np.mean(pairs, axis=0)
        text += (
            f"The curve {claim} the {kind} region on {works} of {len(pairs)} meshes (average share "
            f"{without:.0f} % → {guided:.0f} %), which "
        )
        text += (
            "agrees with the paper. "
            if works == len(pairs)
            else "agrees with the paper only on those. "
            if works
            else "contradicts the paper. "
        )
    return text + (
        f"An alignment region counts as followed if the curve is near at least {100 * FOLLOWED:g} "
        "% of its middle line."
    )
