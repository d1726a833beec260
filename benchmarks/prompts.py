"""Prompts as people give them: the weight of normal bending, and courses by how much is seen."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory

import bpy  # noqa: F401 - Blender's other modules are found only after it
import numpy as np
from matplotlib import colors, pyplot
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

from mathutils import Vector
from mathutils.bvhtree import BVHTree

import nicmm_core as nicmm
from nicmm_core.geometry.array_types import BoolArray, FloatArray
from nicmm_core.geometry.curve import resample
from nicmm_core.geometry.mesh import Mesh
from nicmm_core.relaxation.curve_energies import energies_of
from nicmm_core.relaxation.curve_nodes import curve_surface
from nicmm_core.relaxation.discrete_curve import DiscreteCurve
from nicmm_core.relaxation.elastic_energy import bending_energy

from . import evidence, prompt_bodies, renders, report
from .evidence import DESIGN, Results
from .polylines import NearestPoints
from .scale import Scale

TITLE = "Prompts as people give them"
ROOMS = DESIGN

WEIGHTS = (0.0, 0.1, 0.3, 1.0)
"""Values of `normal_bending` that are compared."""

COST_OF = 0.3
"""Weight whose CPU time is compared with that of weight 0."""

CHOSEN_AT = (0.0, COST_OF)
"""Weights with which the most visible course is compared with the default."""

REPEATS = 3
"""Times that a curve is designed; the least CPU time counts."""

ALTERNATIVES = 4
"""Further courses among which the most visible one is taken, as many as *Next Course* has."""

NEARLY_LEAST = 1.5
"""Energy, relative to the least one, up to which a course may be taken because it is seen."""

CLEARLY_MORE = 0.01
"""Share of the length by which more of a curve must be seen for its course to be taken."""

SAMPLES = 512
"""Points of a curve at which it is tested whether the camera sees it."""

LIFT = 2e-3
"""Distance from the surface at which that is tested, in diagonals."""

ROWS = 10
"""Prompts on each sheet."""

INCHES, DPI = 2.1, 105
"""Width of an image on a sheet, and its resolution."""

GREYS, TINTS, PALE = 56, 8, 0.85
"""Numbers of greys and of tints of each colour on a sheet, and the grey that tints are mixed with.
"""

VISIBLE, HIDDEN, POINT = "#0b3fd0", "#d05a0b", "black"
"""Colours of visible and hidden parts of a curve, and of the clicked points."""

FRONT, SIDE, TOP, CORNER = (0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (1.0, -1.2, 0.9)
"""Directions towards the camera."""


@dataclass(frozen=True)
class Prompt:
    """Points clicked on a body from one view.

    Attributes
    ----------
    name : str
        What the person wants to draw.
    make : callable
        Function from a number of subdivisions to the body.
    levels : int
        Number of subdivisions.
    towards : (float, float, float)
        Direction towards the camera.
    clicks : tuple of (float, float)
        Positions to the right and above the origin of the body, as the camera sees them.
    closed : bool
    """

    name: str
    make: Callable[[int], Mesh]
    levels: int
    towards: tuple[float, float, float]
    clicks: tuple[tuple[float, float], ...]
    closed: bool = True

    @property
    def axes(self) -> FloatArray:
        """Axes of the camera (right, up, towards the camera) as rows."""
        towards = np.array(self.towards) / np.linalg.norm(self.towards)
        upright = np.array([0.0, 1.0, 0.0] if self.towards == TOP else [0.0, 0.0, 1.0])
        right = np.cross(upright, towards)
        right /= np.linalg.norm(right)
        return np.stack([right, np.cross(towards, right), towards])


PROMPTS = (
    Prompt(
        "mask round the face", prompt_bodies.suzanne, 2, FRONT,
        ((0.0, -0.88), (0.55, -0.08), (0.45, 0.62), (-0.45, 0.62), (-0.55, -0.08)),
    ),
    Prompt(
        "brow", prompt_bodies.suzanne, 2, FRONT,
        ((-0.65, 0.35), (-0.35, 0.48), (0.0, 0.4), (0.35, 0.48), (0.65, 0.35)), closed=False,
    ),
    Prompt("headband", prompt_bodies.suzanne, 2, FRONT, ((-0.6, 0.72), (0.0, 0.75), (0.6, 0.72))),
    Prompt(
        "ring round the muzzle", prompt_bodies.suzanne, 2, FRONT,
        ((-0.24, -0.45), (0.0, -0.5), (0.24, -0.45)),
    ),
    Prompt(
        "ring round an ear", prompt_bodies.suzanne, 2, FRONT,
        ((0.96, 0.36), (0.87, 0.17), (0.96, -0.02)),
    ),
    Prompt(
        "chin strap", prompt_bodies.suzanne, 2, SIDE, ((0.05, 0.85), (0.0, 0.3), (-0.25, -0.35))
    ),
    Prompt(
        "goggle", prompt_bodies.suzanne, 2, FRONT,
        ((0.37, 0.53), (0.67, 0.25), (0.37, -0.04), (0.1, 0.25)),
    ),
    Prompt("collar", prompt_bodies.figure, 3, FRONT, ((-0.07, 1.55), (0.0, 1.52), (0.07, 1.55))),
    Prompt(
        "belt", prompt_bodies.figure, 3, FRONT,
        ((-0.12, 1.08), (-0.04, 1.06), (0.04, 1.06), (0.12, 1.08)),
    ),
    Prompt(
        "ring round an arm", prompt_bodies.figure, 3, FRONT,
        ((-0.365, 1.339), (-0.33, 1.31), (-0.295, 1.281)),
    ),
    Prompt("garter", prompt_bodies.figure, 3, FRONT, ((0.115, 0.6), (0.17, 0.59), (0.225, 0.61))),
    Prompt("sash", prompt_bodies.figure, 3, FRONT, ((0.13, 1.5), (0.0, 1.28), (-0.14, 1.0))),
    Prompt(
        "seam of a leg", prompt_bodies.figure, 3, SIDE,
        ((0.0, 0.95), (-0.02, 0.7), (-0.05, 0.48), (0.02, 0.15)), closed=False,
    ),
    Prompt("armhole", prompt_bodies.figure, 3, FRONT, ((0.16, 1.5), (0.19, 1.4), (0.17, 1.32))),
    Prompt(
        "ring round the neck of a vase", prompt_bodies.vase, 2, FRONT,
        ((-0.2, 1.4), (0.0, 1.38), (0.2, 1.4)),
    ),
    Prompt(
        "wave round a vase", prompt_bodies.vase, 2, FRONT,
        ((-0.5, 0.6), (-0.25, 0.8), (0.0, 0.6), (0.25, 0.8), (0.5, 0.6)),
    ),
    Prompt(
        "ring on top of a torus", prompt_bodies.torus, 2, TOP,
        ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)),
    ),
    Prompt(
        "panel line over an edge", prompt_bodies.box, 2, CORNER,
        ((-0.95, 0.1), (-0.2, -0.24), (0.85, -0.13)), closed=False,
    ),
    Prompt(
        "panel round a corner", prompt_bodies.box, 2, CORNER,
        ((0.2, 0.2), (-0.1, -0.35), (0.7, -0.3)),
    ),
    Prompt(
        "ring round a limb", prompt_bodies.creature, 2, FRONT,
        ((-0.42, -0.7), (-0.33, -0.72), (-0.24, -0.7)),
    ),
)  # fmt: skip


class Scene:
    """A body, and what the camera of a prompt sees of it."""

    def __init__(self, prompt: Prompt, mesh: Mesh) -> None:
        self.prompt, self.mesh, self.axes = prompt, mesh, prompt.axes
        self._tree = BVHTree.FromPolygons(mesh.vertices.tolist(), mesh.faces.tolist())

    @cached_property
    def points(self) -> FloatArray:
        """The clicked points of the surface."""
        right, up, towards = self.axes
        found = []
        for x, y in self.prompt.clicks:
            start = x * right + y * up + 2.0 * self.mesh.diagonal * towards
            place = self._tree.ray_cast(Vector(start), Vector(-towards))[0]
            if place is None:
                raise ValueError(f"{self.prompt.name}: the click at {x, y} misses the body")
            found.append(place[:])
        return np.array(found)

    def is_seen(self, places: FloatArray) -> BoolArray:
        """Which points of the surface the camera sees.

        Normals are turned to the camera, so the orientation of the faces does not matter; from the
        far side of a body the rays hit its near side.
        """
        surface, towards = NearestPoints(self.mesh), self.axes[2]
        _, faces, barycentric = surface.project(places)
        normals = surface.normals(faces, barycentric)
        normals *= np.where(normals @ towards < 0.0, -1.0, 1.0)[:, None]
        starts = places + LIFT * self.mesh.diagonal * normals
        away = Vector(towards)
        return np.array([self._tree.ray_cast(Vector(s), away)[0] is None for s in starts])


@dataclass(frozen=True)
class Shown:
    """A curve as the camera of its prompt sees it, with the words above its image."""

    words: str
    places: FloatArray
    seen: BoolArray

    @property
    def share(self) -> float:
        """Share of the length that the camera sees."""
        return round(float(self.seen.mean()), 4)


Row = tuple[Scene, list[Shown]]
"""One prompt on a sheet: its scene and its curves."""


def measure(scale: Scale) -> Results:
    """Draw every prompt with each weight, and choose among its courses."""
    answers: list[Results] = []
    by_weight: list[Row] = []
    by_course: list[Row] = []
    for scene in islice(_scenes(scale), scale.choose(len(PROMPTS), 4, 2)):
        designer = nicmm.Designer(scene.mesh)
        designer.design(scene.points, closed=scene.prompt.closed)  # prepares the mesh
        answer: Results = {"prompt": scene.prompt.name, "weights": [], "courses": []}
        curves, courses = [], []
        for weight in WEIGHTS:
            design, seconds = _timed(designer, scene, weight, scale)
            shown = _shown(scene, design, f"{weight:g}")
            figures = {**_terms(scene.mesh, design), "seen": shown.share, "seconds": seconds}
            answer["weights"].append({"weight": weight, **figures})
            curves.append(shown)
            if weight in CHOSEN_AT:
                chosen, pair = _most_visible(designer, scene, design, weight)
                answer["courses"].append({"weight": weight, **chosen})
                courses += pair
        answers.append(answer)
        by_weight.append((scene, curves))
        if any(each["taken"] for each in answer["courses"]):
            by_course.append((scene, courses))
        print(f"  {answer}", flush=True)
    sheets = {
        f"prompts-{1 + start // ROWS}.png": by_weight[start : start + ROWS]
        for start in range(0, len(by_weight), ROWS)
    }
    if by_course:
        sheets["prompts-visible.png"] = by_course
    for name, rows in sheets.items():
        _draw_sheet(rows, images_folder(scale) / name, scale)
    return {"answers": answers, "sheets": list(sheets)}


def section(results: Results) -> str:
    """Tables of the prompts and of the courses taken, and the cost of normal bending."""
    answers = results["answers"]
    header = ("prompt", *(f"w = {weight:g}" for weight in WEIGHTS))
    rows = [
        (
            each["prompt"],
            *(
                f"{curve['length']:.3f}, {curve['geodesic']:.1f}, {curve['normal']:.1f}"
                for curve in each["weights"]
            ),
        )
        for each in answers
    ]
    taken = [
        (
            f"{each['prompt']}, w = {course['weight']:g}",
            *(f"{course['seen'][i]:.0%}" for i in (0, course["taken"])),
            *(f"{course['energies'][i]:.2f}" for i in (0, course["taken"])),
        )
        for each in answers
        for course in each["courses"]
        if course["taken"]
    ]
    changed = report.listed(
        f"{sum(each['courses'][i]['taken'] > 0 for each in answers)} with w = {weight:g}"
        for i, weight in enumerate(CHOSEN_AT)
    )
    sheets = "\n\n".join(f"![Prompts](../docs/images/{name})" for name in results["sheets"])
    return (
        f"{len(answers)} prompts on generated bodies. All points of a prompt are clicked from one "
        "view, which the pictures show; [normal bending](../docs/normal_bending.md) says "
        "which curves look right. The table has the length of each curve in diagonals, L ∮ κ_g² ds "
        "and L ∮ κ_n² ds.\n\n"
        f"{report.table(header, rows)}\n\n{cost(results)}\n\n"
        "The second table is for another rule: of the default and up to "
        f"{1 + ALTERNATIVES} courses with at most {NEARLY_LEAST:g} times the least energy, the one "
        "of which the camera sees the largest share of the length. It changes the curves of "
        f"{changed}. Columns: the share seen of the default and of the course taken, and their "
        "energies relative to the least one.\n\n"
        + report.table(("prompt", "default", "taken", "default", "taken"), taken)
        + f"\n\n{sheets}\n\n*Blue: seen from where the points were clicked. Orange, dotted: "
        "hidden*"
    )


def summary(results: Results) -> str:
    """What the documents say of it."""
    return report.paragraph(cost(results))


def cost(results: Results) -> str:
    """CPU time of a curve with `COST_OF` relative to one without normal bending, in words."""
    at = WEIGHTS.index(COST_OF)
    seconds = np.array(
        [[each["weights"][i]["seconds"] for i in (0, at)] for each in results["answers"]]
    )
    ratios = seconds[:, 1] / seconds[:, 0]
    return (
        f"With w = {COST_OF:g} a curve takes {np.exp(np.log(ratios).mean()):.2f} times the CPU "
        f"time of w = 0 (geometric mean of {len(ratios)} prompts; {ratios.min():.2f} to "
        f"{ratios.max():.2f}; all together {seconds[:, 1].sum() / seconds[:, 0].sum():.2f} times)."
    )


def images_folder(scale: Scale) -> Path:
    """Folder of the sheets; those of a full run are in the documentation."""
    full = scale is Scale.FULL
    folder = evidence.ROOT / "docs" / "images" if full else evidence.QUICK_OUTPUT / "images"
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def _scenes(scale: Scale) -> Iterator[Scene]:
    """The scenes of all prompts; prompts on the same body share its mesh."""
    meshes: dict[Callable[[int], Mesh], Mesh] = {}
    for prompt in PROMPTS:
        if prompt.make not in meshes:
            meshes[prompt.make] = prompt.make(scale.choose(prompt.levels, prompt.levels, 1))
        yield Scene(prompt, meshes[prompt.make])


def _terms(mesh: Mesh, design: nicmm.Design) -> Results:
    """Length of a curve in diagonals, and its scale-free geodesic and normal bending."""
    curve = _discrete(design)
    geodesic = bending_energy(curve.nodes)
    normal = bending_energy(curve.nodes, 1.0) - geodesic
    return {
        "length": round(design.curves[0].length / mesh.diagonal, 4),
        "geodesic": round(geodesic * curve.length, 3),
        "normal": round(normal * curve.length, 3),
    }


def _timed(
    designer: nicmm.Designer, scene: Scene, weight: float, scale: Scale
) -> tuple[nicmm.Design, float]:
    """The curve of a prompt, and the least CPU time that it took."""
    seconds = []
    for _ in range(scale.choose(REPEATS, 1)):
        started = time.process_time()
        design = designer.design(scene.points, closed=scene.prompt.closed, normal_bending=weight)
        seconds.append(time.process_time() - started)
    return design, round(min(seconds), 4)


def _most_visible(
    designer: nicmm.Designer, scene: Scene, default: nicmm.Design, weight: float
) -> tuple[Results, list[Shown]]:
    """Energies and visible shares of courses, and the default beside the most visible one."""
    found = designer.design(
        scene.points,
        closed=scene.prompt.closed,
        normal_bending=weight,
        alternatives=ALTERNATIVES,
    )
    designs = [default, found, *found.alternatives]
    surface = replace(curve_surface(scene.mesh), normal_bending=weight)
    energies = np.array(energies_of(surface, [_discrete(each) for each in designs], 1.0))
    energies /= energies.min()
    seen = np.array([_shown(scene, each, "").share for each in designs])
    taken = int(np.where(energies <= NEARLY_LEAST, seen, 0.0).argmax())
    if seen[taken] < seen[0] + CLEARLY_MORE:
        taken = 0
    pair = [
        _shown(scene, designs[i], f"{label}, w = {weight:g}: {seen[i]:.0%} seen")
        for i, label in ((0, "default"), (taken, "most visible"))
    ]
    courses = {
        "energies": [round(each, 3) for each in energies.tolist()],
        "seen": [round(each, 3) for each in seen.tolist()],
        "taken": taken,
    }
    return courses, pair


def _discrete(design: nicmm.Design) -> DiscreteCurve:
    if design.resumable is None:
        raise ValueError("The curve of a prompt has no nodes")
    return design.resumable.curve


def _shown(scene: Scene, design: nicmm.Design, words: str) -> Shown:
    curve = design.curves[0]
    places, _ = resample(curve.points, SAMPLES, curve.closed)
    return Shown(words, places, scene.is_seen(places))


def _draw_sheet(rows: Sequence[Row], path: Path, scale: Scale) -> None:
    """Draw curves over images of their bodies, one prompt a row, and write them to a PNG file."""
    columns = len(rows[0][1])
    figure, axes = pyplot.subplots(
        len(rows), columns, figsize=(INCHES * columns, 1.2 * INCHES * len(rows)), squeeze=False
    )
    for (scene, row), places in zip(rows, axes, strict=True):
        _draw_row(scene, row, places, scale)
    figure.tight_layout(pad=0.3)
    _save(figure, path)


def _draw_row(scene: Scene, row: list[Shown], places: Sequence[Axes], scale: Scale) -> None:
    frame = np.concatenate([scene.points, *(shown.places for shown in row)])
    picture = renders.Picture(scene.prompt.name, scene.mesh, frame=frame)
    centre, width = renders.framing(picture, scene.axes)
    unit = scene.mesh.diagonal
    left, low = unit * (centre[:2] - 0.5 * width)
    with TemporaryDirectory() as folder:
        still = Path(folder) / "still.png"
        # The images of a full run are as small on the sheet as those of a quick one.
        quality = Scale.QUICK if scale is Scale.FULL else scale
        renders.render(picture, still, quality, scene.axes)
        image = pyplot.imread(still)
    clicks = scene.points @ scene.axes.T
    for place, shown in zip(places, row, strict=True):
        place.imshow(image, extent=(left, left + unit * width, low, low + unit * width))
        x, y = (shown.places @ scene.axes.T)[:, :2].T
        if scene.prompt.closed:
            x, y, seen = (np.append(each, each[:1]) for each in (x, y, shown.seen))
        else:
            seen = shown.seen
        place.plot(np.where(seen, np.nan, x), y, ":", color=HIDDEN, linewidth=1.2)
        place.plot(np.where(seen, x, np.nan), y, color=VISIBLE, linewidth=1.8)
        place.plot(clicks[:, 0], clicks[:, 1], "o", color=POINT, markersize=3.5)
        place.set_title(f"{scene.prompt.name}\n{shown.words}", fontsize=7)
        place.axis("off")


def _save(figure: Figure, path: Path) -> None:
    """Write a figure with the few colours that it has, which takes a third of the space."""
    with TemporaryDirectory() as folder:
        whole = Path(folder) / "whole.png"
        figure.savefig(whole, dpi=DPI)
        pyplot.close(figure)
        image = Image.open(whole).convert("RGB")
    greys = np.linspace(0.0, 1.0, GREYS)[:, None].repeat(3, axis=1)
    shares = np.linspace(0.2, 1.0, TINTS)[:, None]
    tints = [shares * colors.to_rgb(hue) + (1.0 - shares) * PALE for hue in (VISIBLE, HIDDEN)]
    palette = Image.new("P", (1, 1))
    levels = np.rint(255.0 * np.concatenate([greys, *tints])).astype(int)
    palette.putpalette(levels.ravel().tolist())
    image.quantize(palette=palette, dither=Image.Dither.NONE).save(path, optimize=True)
