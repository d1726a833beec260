"""Draws meshes and curves with Matplotlib, without a window."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from .design_result import Design
from .errors import ArgumentError, MissingPackageError
from .geometry.array_types import FloatArray
from .geometry.curve import SurfaceCurve, resample
from .geometry.mesh import Mesh, MeshLike, as_mesh

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SURFACE = (0.84, 0.85, 0.87)
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
"""Colours of the curves, which people with colour-blindness can tell apart (Okabe and Ito 2008)."""

INCHES, DOTS_PER_INCH = 6.0, 150

CANDIDATES = 200
"""Number of views that are compared, unless one is given."""

SAMPLES = 64
"""Number of points of each curve by which views are compared."""

LIFTED = 3e-3
"""Distance by which curves are moved towards the viewer, relative to the diagonal of the mesh."""

LIGHT = np.array([-0.35, 0.45, 0.82])
"""Direction towards the light, in the axes of the picture."""


def plot(
    mesh: MeshLike,
    curves: Design | SurfaceCurve | Sequence[Design | SurfaceCurve] = (),
    path: str | Path | None = None,
    *,
    view: ArrayLike | None = None,
    up: ArrayLike | None = None,
) -> Figure:
    """Draw a mesh and curves on it.

    Needs Matplotlib (``pip install "nicmm-curves[plot]"``), but no screen. In a notebook the result
    is shown when it is the last value of a cell.

    Parameters
    ----------
    mesh : Mesh or object with `vertices` and `faces`
    curves : Design, SurfaceCurve or sequence of these, optional
        Curves on the mesh. Control points are drawn as dots.
    path : str or Path, optional
        File in which the picture is saved; its ending determines the format.
    view : (3,) float array_like, optional
        Direction towards the viewer. By default most of the curves can be seen.
    up : (3,) float array_like, optional
        Direction that points upwards in the picture; by default y or z, whichever the mesh is
        longer along.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    MissingPackageError
        If Matplotlib cannot be imported.
    ArgumentError
        If an argument cannot be used, or the file cannot be written.
    """
    figure_class, collections = _matplotlib()
    checked = as_mesh(mesh)
    drawn = _curves(curves)
    axes = _axes(checked, drawn, view, up)
    # The figure is made without pyplot, so that it neither opens a window nor stays in memory.
    figure: Figure = figure_class(figsize=(INCHES, INCHES), layout="constrained")
    place = figure.add_subplot()
    place.set_aspect("equal")
    place.set_axis_off()
    corners = (checked.vertices @ axes.T)[checked.faces]
    _draw_surface(place, collections, checked, corners, axes)
    for number, curve in enumerate(drawn):
        _draw_curve(place, checked, corners, curve, axes, COLOURS[number % len(COLOURS)])
    place.autoscale_view()
    if path is not None:
        try:
            figure.savefig(path, dpi=DOTS_PER_INCH)
        except (OSError, ValueError) as error:
            raise ArgumentError(
                f"path is {str(path)!r}, which cannot be written ({error}); pass the path of a "
                "file such as curve.png or curve.svg in a folder that exists"
            ) from error
    return figure


def _matplotlib() -> tuple[Any, Any]:
    try:
        from matplotlib import collections
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingPackageError(
            f"plot needs Matplotlib, which cannot be imported ({error}); install it into this "
            "Python with 'pip install matplotlib'"
        ) from error
    return Figure, collections


def _curves(given: Design | SurfaceCurve | Sequence[Design | SurfaceCurve]) -> list[SurfaceCurve]:
    """The curves of the argument `curves`, in order."""
    if isinstance(given, Design):
        return list(given.curves)
    if isinstance(given, SurfaceCurve):
        return [given]
    if not isinstance(given, list | tuple):
        raise ArgumentError(
            f"curves is a {type(given).__name__}; pass a Design, a SurfaceCurve or a list of these"
        )
    return [curve for each in given for curve in _curves(each)]


def _axes(
    mesh: Mesh, curves: list[SurfaceCurve], view: ArrayLike | None, up: ArrayLike | None
) -> FloatArray:
    """Axes of the picture (right, up, towards the viewer) as rows."""
    extent = np.ptp(mesh.vertices[mesh.referenced], axis=0)
    longer = np.array([0.0, 1.0, 0.0]) if extent[1] >= extent[2] else np.array([0.0, 0.0, 1.0])
    upwards = longer if up is None else _direction("up", up)
    towards = _best_view(mesh, curves) if view is None else _direction("view", view)
    if abs(upwards @ towards) > 0.99:  # seen from above
        upwards = np.roll(upwards, 1)
    right = np.cross(upwards, towards)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(towards, right), towards])


def _direction(name: str, given: ArrayLike) -> FloatArray:
    """A unit vector, checked."""
    try:
        vector = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ArgumentError(f"{name} is not a vector ({error}); pass three numbers") from error
    length = float(np.linalg.norm(vector))
    if vector.shape != (3,) or not 0.0 < length < np.inf:
        raise ArgumentError(f"{name} is {given!r}; pass three finite numbers that are not all zero")
    return vector / length


def _best_view(mesh: Mesh, curves: list[SurfaceCurve]) -> FloatArray:
    """The direction towards the viewer in which most of the curves faces the viewer."""
    number = np.arange(CANDIDATES) + 0.5  # a Fibonacci lattice
    height = 1.0 - 2.0 * number / CANDIDATES
    angle = np.pi * (1.0 + 5.0**0.5) * number
    radius = np.sqrt(1.0 - height**2)
    towards = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)
    if not curves:
        normals = mesh.face_normals * mesh.face_areas[:, None]
        return towards[np.argmax(np.maximum(normals @ towards.T, 0.0).sum(axis=0))]
    faces = np.concatenate([curve.faces for curve in curves])
    faces = faces[:: 1 + len(faces) // (SAMPLES * len(curves))]
    points = np.concatenate([resample(each.points, SAMPLES, each.closed)[0] for each in curves])
    centre = mesh.vertices[mesh.referenced].mean(axis=0)
    outwards = (points - centre) / mesh.diagonal
    normals = mesh.face_normals[faces]
    if (normals * (mesh.vertices[mesh.faces[faces, 0]] - centre)).sum() < 0.0:
        normals = -normals  # the mesh is inside out
    facing = np.maximum(normals @ towards.T, 0.0).mean(axis=0)
    # Of two views that face as much of the curves, the one is better in front of which they lie.
    return towards[np.argmax(facing + 0.5 * (outwards @ towards.T).mean(axis=0))]


def _draw_surface(
    place: Any, collections: Any, mesh: Mesh, corners: FloatArray, axes: FloatArray
) -> None:
    """Draw the faces that face the viewer, from back to front, each in one shade."""
    normals = mesh.face_normals @ axes.T
    order = np.argsort(corners[:, :, 2].mean(axis=1), kind="stable")
    # A mesh need not be oriented, so both sides of a face are lit.
    normals *= np.where(normals[:, 2:] < 0.0, -1.0, 1.0)
    shade = 0.45 + 0.55 * np.maximum(normals[order] @ (LIGHT / np.linalg.norm(LIGHT)), 0.0)
    colours = np.clip(shade[:, None] * np.array(SURFACE) * 1.08, 0.0, 1.0)
    place.add_collection(
        collections.PolyCollection(
            corners[order, :, :2], facecolors=colours, edgecolors=colours, linewidths=0.3,
            rasterized=True,
        )
    )  # fmt: skip


def _draw_curve(
    place: Any,
    mesh: Mesh,
    corners: FloatArray,
    curve: SurfaceCurve,
    axes: FloatArray,
    colour: str,
) -> None:
    """Draw the visible part of a curve, its hidden part thin and pale, and its control points."""
    points = curve.points @ axes.T
    if curve.closed:
        points = np.concatenate([points, points[:1]])
    visible = _visible(points, corners, mesh)
    shown = np.where((visible[:-1] & visible[1:])[:, None], points[:-1, :2], np.nan)
    ends = np.where((visible[:-1] & visible[1:])[:, None], points[1:, :2], np.nan)
    line = np.stack([shown, ends, np.full_like(shown, np.nan)], axis=1).reshape(-1, 2)
    place.plot(*points[:, :2].T, color=colour, linewidth=0.8, alpha=0.35, zorder=2)
    place.plot(*line.T, color=colour, linewidth=2.4, solid_capstyle="round", zorder=3)
    controls = curve.control_index[curve.control_index >= 0]
    place.plot(
        *points[controls[visible[controls]], :2].T,
        "o", color="black", markersize=4.5, zorder=4,
    )  # fmt: skip


def _visible(points: FloatArray, corners: FloatArray, mesh: Mesh) -> Any:
    """Which points, moved a little towards the viewer, no face hides; (n,) bool."""
    visible = np.ones(len(points), dtype=bool)
    lifted = points[:, 2] + LIFTED * mesh.diagonal
    low, high = corners[:, :, :2].min(axis=1), corners[:, :, :2].max(axis=1)
    top = corners[:, :, 2].max(axis=1)
    for index, (x, y) in enumerate(points[:, :2]):
        candidates = np.flatnonzero(
            (low[:, 0] <= x) & (x <= high[:, 0]) & (low[:, 1] <= y) & (y <= high[:, 1])
            & (top > lifted[index])
        )  # fmt: skip
        a, b, c = np.moveaxis(corners[candidates], 1, 0)
        area = _cross(b - a, c - a)
        keep = area != 0.0
        a, b, c, area = a[keep], b[keep], c[keep], area[keep]
        here = np.array([x, y])
        weights = (
            np.stack([_cross(c - b, here - b[:, :2]), _cross(a - c, here - c[:, :2])], axis=1)
            / area[:, None]
        )
        weights = np.column_stack([weights, 1.0 - weights.sum(axis=1)])
        depth = (weights * np.stack([a[:, 2], b[:, 2], c[:, 2]], axis=1)).sum(axis=1)
        visible[index] = not ((weights >= 0.0).all(axis=1) & (depth > lifted[index])).any()
    return visible


def _cross(one: FloatArray, other: FloatArray) -> FloatArray:
    """Cross product of vectors in the plane of the picture."""
    product: FloatArray = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
    return product
