# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects with curves at constant distances from a designed curve, along the surface.

Such an object has settings of its own, and follows the designed curve: whenever that is written,
the parallel curves are computed again.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import bpy
import numpy as np
from bpy.props import (
    BoolProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from ..scene import curve_record, surface_cache
from ..scene.messages import InputError, check_finite
from ..scene.surface import Surface
from . import curve_object, tube_radius
from .clean_curves import BEZIER, EVEN, EXACT, Drawing, splines

if TYPE_CHECKING:
    from ...nicmm_core import SurfaceCurve

UNKNOWN = -1
"""Number of splines of an object on which it was not stored."""

LARGEST_COUNT = 100
"""Greatest number of curves on a side, since each takes about as long as a curve."""

DISTANCE = FloatProperty(
    name="Distance",
    description="Distance between neighbouring curves along the surface. Positive values are to "
    "the left of the curve, seen from outside",
    default=0.1,
    soft_min=-1.0,
    soft_max=1.0,
    subtype="DISTANCE",
)
COUNT = IntProperty(
    name="Count",
    description="Number of parallel curves on each side",
    default=1,
    min=1,
    soft_max=10,
    max=LARGEST_COUNT,
)
BOTH_SIDES = BoolProperty(
    name="Both Sides",
    description="Also create parallel curves on the other side",
    default=False,
)
SPLINE = EnumProperty(
    name="Spline",
    description="How the points of the curves are placed",
    items=(
        (EVEN, "Even", "Points evenly spaced"),
        (EXACT, "Exact", "A point at every crossing with an edge of the mesh"),
        (BEZIER, "Bézier", "A few points with handles"),
    ),
    default=EVEN,
)
OFFSET = FloatProperty(
    name="Offset",
    description="Distance of the curves from the surface, along the normals of the surface",
    default=0.0,
    soft_min=-1.0,
    soft_max=1.0,
    subtype="DISTANCE",
)


class ParallelSettings(Protocol):
    """The settings of parallel curves, as properties of an operator or the sidebar."""

    parallel_distance: float
    parallel_count: int
    both_sides: bool


def _live(given: bpy.props._PropertyDeferred) -> bpy.props._PropertyDeferred:
    """A property whose change computes the curves again."""
    return given.function(**given.keywords, options=set(), update=_note_change)


def _note_change(group: bpy.types.PropertyGroup, _context: bpy.types.Context) -> None:
    parallel = group.id_data
    if is_parallel(parallel):
        _try_to_redraw(parallel)


class NICMM_PG_parallel(bpy.types.PropertyGroup):
    """Settings of an object with parallel curves. A change computes the curves again"""

    source: PointerProperty(
        name="Source",
        description="The designed curve to which these curves are parallel",
        type=bpy.types.Object,
        options={"HIDDEN"},
    )
    is_parallel: BoolProperty(options={"HIDDEN"})
    problem: StringProperty(options={"HIDDEN"})
    n_splines: IntProperty(default=UNKNOWN, options={"HIDDEN"})
    distance: _live(DISTANCE)
    count: _live(COUNT)
    both_sides: _live(BOTH_SIDES)
    spline: _live(SPLINE)
    offset: _live(OFFSET)


def is_parallel(candidate: bpy.types.Object | None) -> bool:
    """Whether an object has parallel curves."""
    return (
        candidate is not None
        and candidate.type == "CURVE"
        and candidate.nicmm_parallel.is_parallel
        and not curve_record.has_record(candidate)
    )


def source_of(parallel: bpy.types.Object) -> bpy.types.Object:
    """The designed curve of parallel curves; an error if it was deleted."""
    source = parallel.nicmm_parallel.source
    if not curve_record.has_record(source) or not source.users_scene:
        raise InputError(
            f'The designed curve of "{parallel.name}" was deleted, so its parallel curves stay as '
            "they are"
        )
    return source


def computed(
    surface: Surface, curves: list[SurfaceCurve], settings: ParallelSettings
) -> list[SurfaceCurve]:
    """Compute curves parallel to given ones; an error if no place is so far away."""
    check_finite("parallel_distance", settings.parallel_distance)
    distances = _distances(settings.parallel_distance, settings.parallel_count, settings.both_sides)
    found = _parallels(surface, curves, distances)
    if not found:
        raise InputError(
            "No place on that side of the curve is so far away. Use a smaller Distance, or the "
            "other side"
        )
    return found


def add(
    context: bpy.types.Context,
    source: bpy.types.Object,
    surface: Surface,
    found: list[SurfaceCurve],
    settings: ParallelSettings,
) -> bpy.types.Object:
    """Add an object with curves parallel to those of a designed object, from `computed`."""
    mesh_object = curve_record.mesh_in_any_scene(source)
    drawn = curve_record.drawn_as(source)
    radius = tube_radius.radius_of(source) * curve_object.scale_of(source, surface)
    shown = splines(surface, found, Drawing(radius=radius, **drawn), np.zeros(0, dtype=bool))
    parallel = curve_object.new_object(mesh_object, surface, shown, radius)
    parallel.name = f"{source.name} Parallel"
    curve_object.copy_materials(source, parallel)
    group = parallel.nicmm_parallel
    group.n_splines = len(shown)
    group.distance, group.count = settings.parallel_distance, settings.parallel_count
    group.both_sides = settings.both_sides
    group.spline, group.offset = drawn["spline"], drawn["offset"]
    group.source = source
    group.is_parallel = True  # the last one, since changes of the others are noticed from here on
    curve_object.place(context, mesh_object, parallel)
    return parallel


def set_source(converted: bpy.types.Object, original: bpy.types.Object) -> None:
    """Let the curves that are parallel to an original curve follow the converted one."""
    for parallel in bpy.data.objects:
        if parallel.nicmm_parallel.source == original:
            parallel.nicmm_parallel.source = converted


def follow(source: bpy.types.Object, surface: Surface, curves: list[SurfaceCurve]) -> None:
    """Compute the curves again that are parallel to a designed curve that was written.

    What cannot be computed keeps its shape; the sidebar shows why.
    """
    for parallel in bpy.data.objects:
        if is_parallel(parallel) and parallel.nicmm_parallel.source == source:
            _try_to_redraw(parallel, surface, curves)


def _try_to_redraw(
    parallel: bpy.types.Object,
    surface: Surface | None = None,
    curves: list[SurfaceCurve] | None = None,
) -> None:
    """Compute parallel curves again, or note why they cannot be."""
    from ... import nicmm_core as nicmm

    group = parallel.nicmm_parallel
    try:
        if surface is None or curves is None:
            surface, curves = _read_source(parallel)
        _redraw(parallel, surface, curves)
    except (InputError, nicmm.NicmmError) as error:
        group.problem = str(error)
    else:
        group.problem = ""


def _read_source(parallel: bpy.types.Object) -> tuple[Surface, list[SurfaceCurve]]:
    """The surface and the curves of the designed curve."""
    source = source_of(parallel)
    mesh_object = curve_record.mesh_in_any_scene(source)
    use_modifiers = curve_record.settings_of(source).use_modifiers
    surface = surface_cache.get(mesh_object, use_modifiers)
    return surface, curve_record.read_curves(source, surface)


def _redraw(parallel: bpy.types.Object, surface: Surface, curves: list[SurfaceCurve]) -> None:
    """Replace the splines of parallel curves; radius and materials are kept."""
    group = parallel.nicmm_parallel
    count = len(parallel.data.splines) if group.n_splines == UNKNOWN else group.n_splines
    curve_object.check_replaceable(parallel, count)
    for name in ("distance", "offset"):
        check_finite(name, getattr(group, name))
    distances = _distances(group.distance, group.count, group.both_sides)
    found = _parallels(surface, curves, distances)
    if not found:
        raise InputError(
            f'"{parallel.name}" keeps its shape: no place on that side of the curve is so far '
            "away. Use a smaller Distance"
        )
    radius = tube_radius.radius_of(parallel) * curve_object.scale_of(parallel, surface)
    drawing = Drawing(group.spline, radius, group.offset)
    shown = splines(surface, found, drawing, np.zeros(0, dtype=bool))
    curve_object.make_single_user(parallel)
    curve_object.write_splines(parallel, shown)
    group.n_splines = len(shown)


def _distances(distance: float, count: int, both_sides: bool) -> list[float]:
    """The distances of all curves, in scene units."""
    one = [distance * (number + 1) for number in range(count)]
    return [*one, *(-each for each in one)] if both_sides else one


def _parallels(
    surface: Surface, curves: list[SurfaceCurve], distances: list[float]
) -> list[SurfaceCurve]:
    """The curves at some distances from curves, in scene units."""
    # A reflection exchanges left and right. The core knows the sides by the order of the corners of
    # faces, which is the same in local space and in its own.
    handedness = float(np.sign(np.linalg.det(surface.local_to_world[:3, :3])))
    lengths = [handedness * distance / surface.unit for distance in distances]
    with surface_cache.designer_of(surface) as designer:
        return [
            found
            for curve in curves
            for at_distance in designer.offset_curves(curve, lengths)
            for found in at_distance
        ]


def register() -> None:
    bpy.utils.register_class(NICMM_PG_parallel)
    bpy.types.Object.nicmm_parallel = PointerProperty(type=NICMM_PG_parallel)


def unregister() -> None:
    del bpy.types.Object.nicmm_parallel
    bpy.utils.unregister_class(NICMM_PG_parallel)
