# SPDX-License-Identifier: GPL-3.0-or-later
"""Defines and draws the settings of a curve for operators and sidebar: core options and outputs."""

from collections.abc import Iterable

import bpy
from bpy.props import (
    BoolProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from ..nicmm_core.options import COMPOUND_KINDS, OPTIONS, Kind, Option
from .outputs import parallel_curves, sticky_curves, writing
from .scene import curve_record, mirror_plane

AUTOMATIC = (
    "AUTO",
    "Automatic",
    "In the order of selection if Blender has recorded it for all selected vertices, otherwise in "
    "the shortest order",
)
"""A choice of the option `order` that only the extension has, listed before those of the core."""


NORMAL_BENDING = 0.3
"""Default of the option `normal_bending` in Blender; see docs/normal_bending.md."""

CURVE = StringProperty(
    name="Curve Object",
    description="Name of the designed curve. Leave empty for the active one",
    options={"HIDDEN", "SKIP_SAVE"},
)
"""The property of operators that names a designed curve."""


CORNERS = StringProperty(
    name="Corners",
    description="Control points at which the curve may turn freely, for scripts: their indices "
    "among the points given, from 0, separated by commas, such as 0, 2",
    options={"HIDDEN", "SKIP_SAVE"},
)
"""The property of operators that names corners."""


# The type of an unregistered property is private, so its name is not evaluated at run time.
def properties_of(options: Iterable[Option]) -> dict[str, "bpy.props._PropertyDeferred"]:
    """Blender properties for core options, without those of compound kinds."""
    return {
        curve_record.property_name(option): _property(option)
        for option in options
        if option.kind not in COMPOUND_KINDS
    }


def _property(option: Option) -> "bpy.props._PropertyDeferred":
    """The Blender property for a core option."""
    words = {"name": option.label, "description": option.description}
    if option.kind is Kind.SWITCH:
        return BoolProperty(**words, default=option.default)
    if option.kind is Kind.CHOICE:
        # Blender numbers the items in this order, and files store the numbers of scene settings.
        items = [
            (curve_record.identifier(each.name), each.label, each.description)
            for each in option.choices
        ]
        if option.name == "order":
            items.insert(0, AUTOMATIC)
            return EnumProperty(**words, items=items, default="AUTO")
        return EnumProperty(
            **words, items=items, default=curve_record.identifier(str(option.default))
        )
    if option.kind is Kind.WEIGHTS:
        words["description"] += ". Choose a vertex group, or leave empty for none"
        return StringProperty(**words)
    names, values = ("min", "max", "soft_min", "soft_max"), (*option.limits, *option.usual)
    limits = {
        name: value for name, value in zip(names, values, strict=True) if value < float("inf")
    }
    if option.kind is Kind.COUNT:
        whole = {name: int(value) for name, value in limits.items()}
        return IntProperty(**words, **whole, default=option.default)
    subtype = "DISTANCE" if option.kind is Kind.LENGTH else "NONE"
    default = NORMAL_BENDING if option.name == "normal_bending" else option.default
    return FloatProperty(**words, **limits, subtype=subtype, default=default)


OTHERS = {
    "avoid_others": BoolProperty(
        name="Avoid Other Curves",
        description="Keep the curve from crossing the curves above it in the list of curves, and "
        "at Clearance from them. It follows when they change. Control points on another curve are "
        "junctions. Only with the method Elastic",
        default=False,
    )
}
"""The property of a curve that it avoids other curves."""

SURFACE = {
    "use_modifiers": BoolProperty(
        name="Use Modifiers",
        description="Draw on the surface that the viewport shows, with modifiers and shape keys. "
        "If disabled, draw on the mesh without them",
        default=True,
    )
}


MIRROR = {
    "mirror_axis": EnumProperty(
        name="Mirror",
        description="The plane in which a curve of the method Elastic is mirrored",
        items=(
            (mirror_plane.NONE, "None", "No mirror"),
            ("X", "X", "The plane through the object's origin across its local X axis"),
            ("Y", "Y", "The plane through the object's origin across its local Y axis"),
            ("Z", "Z", "The plane through the object's origin across its local Z axis"),
            (
                mirror_plane.MODIFIER,
                "Mirror Modifier",
                "The plane of the first Mirror modifier of the mesh that the viewport shows",
            ),
        ),
        default=mirror_plane.NONE,
    ),
    "mirror_as": EnumProperty(
        name="Mirror As",
        description="What becomes of the mirror image",
        items=(
            (
                mirror_plane.JOINED,
                "Joined",
                "One curve through the points of one side and their mirror images, which is its "
                "own mirror image",
            ),
            (
                mirror_plane.PAIR,
                "Pair",
                "The curve and its mirror image, as two splines of one object",
            ),
        ),
        default=mirror_plane.JOINED,
    ),
}


class DesignProperties:
    """The options of a new curve, shared by the operator and the scene settings."""

    __annotations__ = properties_of(OPTIONS) | OTHERS | SURFACE | MIRROR


class EditingProperties:
    """The options of a curve that is being edited, without those that only a new curve has."""

    __annotations__ = (
        properties_of(
            option
            for option in OPTIONS
            if option.name not in (*curve_record.NEW_CURVE_OPTIONS, "method")
        )
        | OTHERS
        | SURFACE
        | MIRROR
    )


def _tube_property(default: bool) -> "bpy.props._PropertyDeferred":
    return BoolProperty(
        name="Tube",
        description="Show the sticky curve as a tube mesh. Before Blender 5.0 the viewport "
        "draws hair curves with only a few points",
        default=default,
    )


class OutputProperties:
    """The output settings of a new or converted curve."""

    output: EnumProperty(
        name="Output",
        description="What to create from the curve",
        items=(
            ("CURVE", "Curve", "A curve object on the surface. The mesh stays unchanged"),
            (
                "STICKY",
                "Sticky Curves",
                "A hair curves object that follows the mesh when it is deformed. "
                "The mesh stays unchanged",
            ),
            (
                "PARALLEL",
                "Parallel Curves",
                "A curve object with curves at constant distances from the curve along the "
                "surface, which follows the curve. The curve itself is kept",
            ),
            ("EDGES", "Cut Edges", "Cut the mesh so that the curve becomes a chain of its edges"),
            ("REGION", "Region", "The part of the mesh that the curve encloses"),
            ("PARTS", "Separate Parts", "Cut the mesh and separate it along the curve"),
        ),
        default="CURVE",
    )
    spline: EnumProperty(
        name="Spline",
        description="How the points of the curve object are placed",
        items=(
            (
                "EVEN",
                "Even",
                "Points evenly spaced between control points. They stay within a ten-thousandth of "
                "the size of the mesh, and a tenth of the radius, of the exact curve",
            ),
            (
                "EXACT",
                "Exact",
                "A point at every crossing with an edge of the mesh, so that the curve lies "
                "exactly on its faces",
            ),
            (
                "BEZIER",
                "Bézier",
                "A few points with handles, including all control points. Sticky curves use evenly "
                "spaced points instead",
            ),
        ),
        default="EVEN",
    )
    radius: FloatProperty(
        name="Radius",
        description="Radius of the curve. If zero, Thickness sets it relative to the size of the "
        "mesh",
        default=0.0,
        min=0.0,
        soft_max=1.0,
        subtype="DISTANCE",
    )
    offset: FloatProperty(
        name="Offset",
        description="Distance of the curve from the surface, along the normals of the surface",
        default=0.0,
        soft_min=-1.0,
        soft_max=1.0,
        subtype="DISTANCE",
    )
    thickness: FloatProperty(
        name="Thickness",
        description="Radius of the curve relative to the size of the mesh, used if Radius is zero. "
        "Set to zero for a line",
        default=0.004,
        min=0.0,
        soft_max=0.05,
        precision=4,
        step=0.1,
    )
    tube: _tube_property(False)
    parallel_distance: parallel_curves.DISTANCE
    parallel_count: parallel_curves.COUNT
    both_sides: parallel_curves.BOTH_SIDES
    mark_seam: BoolProperty(
        name="Mark Seam",
        description="Mark the edges along the curve as UV seams",
        default=True,
    )
    mark_sharp: BoolProperty(
        name="Mark Sharp",
        description="Mark the edges along the curve as sharp",
        default=False,
    )
    cut_faces: EnumProperty(
        name="Faces",
        description="How cut faces are divided",
        items=(
            (
                "POLYGONS",
                "Polygons",
                "One polygon on each side of the curve where the face is flat enough, as with "
                "the Knife tool",
            ),
            (
                "TRIANGLES",
                "Triangles",
                "Only triangles. The shape of the surface stays exactly the same",
            ),
        ),
        default="POLYGONS",
    )
    simplify: FloatProperty(
        name="Simplify",
        description="Maximum distance between the cut edges and the curve, relative to the mean "
        "edge length. Larger values give fewer vertices inside faces",
        default=0.01,
        min=0.0,
        soft_max=0.2,
        max=1.0,
        precision=3,
        step=1,
    )
    region_as: EnumProperty(
        name="Region As",
        description="How the region is marked",
        items=(
            ("SELECTION", "Selection", "Select its faces, and nothing else"),
            ("VERTEX_GROUP", "Vertex Group", "Assign its vertices to a new vertex group"),
            ("FACE_SET", "Face Set", "Assign its faces to a new face set for Sculpt Mode"),
        ),
        default="SELECTION",
    )
    region_cut: BoolProperty(
        name="Cut First",
        description="Cut the mesh along the curve so that the region ends exactly there. "
        "If disabled, the region consists of the faces with more than half of their area inside",
        default=False,
    )
    other_side: BoolProperty(
        name="Other Side",
        description="Use the side of the curve with the larger area",
        default=False,
    )
    parts_as: EnumProperty(
        name="Parts As",
        description="How the parts are separated",
        items=(
            ("LOOSE", "Loose Parts", "Both parts stay in this mesh, but no longer share vertices"),
            ("OBJECTS", "Objects", "The part that the curve encloses becomes a separate object"),
        ),
        default="LOOSE",
    )


def output_property(name: str) -> "bpy.props._PropertyDeferred":
    """The property of an output setting."""
    return OutputProperties.__annotations__[name]


APPEARANCE = ("spline", "radius", "offset", "thickness")
"""Output settings of curve objects; a conversion takes them from the converted curve."""

PROPERTY_NAMES = (*DesignProperties.__annotations__, *OutputProperties.__annotations__)


def with_options(
    given: "bpy.props._PropertyDeferred", options: set[str]
) -> "bpy.props._PropertyDeferred":
    """A copy of a property of Blender with other options."""
    return given.function(**{**given.keywords, "options": options})


TOOL = {
    "tool_action": EnumProperty(
        name="Click",
        description="What clicking on the surface with the Surface Curve tool does",
        items=(
            ("POINTS", "Points", "Add control points", "CURVE_PATH", 0),
            (
                "FREEHAND",
                "Freehand",
                "Draw a stroke, which becomes a curve with few control points. A stroke from the "
                "active curve to itself redraws the stretch between",
                "GREASEPENCIL",
                1,
            ),
            (
                "FEATURE",
                "Feature",
                "Create the curve along the ridge, valley, sharp edge or boundary that is clicked",
                "MOD_EDGESPLIT",
                2,
            ),
        ),
        default="POINTS",
    ),
    "stroke_tolerance": FloatProperty(
        name="Tolerance",
        description="Greatest distance between a stroke and its curve, in pixels",
        default=8.0,
        min=1.0,
        soft_max=50.0,
        subtype="PIXEL",
    ),
}
"""Settings of the tool alone."""


class NICMM_PG_settings(bpy.types.PropertyGroup):
    """Settings of the sidebar panel, saved with the scene."""

    __annotations__ = {  # noqa: RUF012 - as Blender reads it
        name: with_options(given, set())  # not animatable
        for name, given in {
            **DesignProperties.__annotations__,
            **OutputProperties.__annotations__,
            **TOOL,
            "tube": _tube_property(not sticky_curves.are_drawn_with_all_points()),
        }.items()
    }


def take_from_sidebar(operator: bpy.types.Operator, properties: bpy.types.PropertyGroup) -> None:
    """Give an operator the settings of the sidebar, except those that its caller has set."""
    for name in PROPERTY_NAMES:
        if not operator.properties.is_property_set(name):
            setattr(operator, name, getattr(properties, name))


def choose_tube(operator: bpy.types.Operator) -> None:
    """Enable *Tube* in Blender versions that draw strands coarsely; for calls from the window.

    A value that the caller has set, or that the user chose last time, is kept.
    """
    if not operator.properties.is_property_set("tube", ghost=False):
        operator.tube = not sticky_curves.are_drawn_with_all_points()


def draw(
    layout: bpy.types.UILayout,
    properties: bpy.types.Operator | bpy.types.PropertyGroup,
    mesh_object: bpy.types.Object | None,
) -> None:
    """Draw all settings in the redo panel; `mesh_object` may be None."""
    draw_design(layout, properties, mesh_object)
    for name in ("obstacle_group", "alignment_group"):
        if mesh_object is None:
            layout.prop(properties, name, icon="GROUP_VERTEX")
        else:
            layout.prop_search(properties, name, mesh_object, "vertex_groups")
    draw_clearance(layout, properties)
    draw_output(layout, properties)


def draw_design(
    layout: bpy.types.UILayout,
    properties: bpy.types.Operator | bpy.types.PropertyGroup,
    mesh_object: bpy.types.Object | None,
) -> None:
    """Draw the settings of the curve itself, without its maps."""
    layout.use_property_split = True
    layout.use_property_decorate = False
    for name in ("closed", "order", "method", "smoothness"):
        layout.prop(properties, name)
    column = layout.column()
    column.active = properties.method == "ELASTIC"
    column.prop(properties, "normal_bending")
    column.prop(properties, "alternatives")
    draw_avoid_others(column, properties)
    draw_mirror(column, properties, mesh_object)
    layout.prop(properties, "use_modifiers")


def draw_avoid_others(
    layout: bpy.types.UILayout,
    properties: bpy.types.Operator | bpy.types.PropertyGroup,
    label: str = "Avoid Other Curves",
) -> None:
    """Draw whether the curve avoids others, greyed out if it is joined to its mirror image."""
    has_mirror = properties.mirror_axis != mirror_plane.NONE
    row = layout.row()
    row.active = not (has_mirror and properties.mirror_as == mirror_plane.JOINED)
    row.prop(properties, "avoid_others", text=label)


def draw_mirror(
    layout: bpy.types.UILayout,
    properties: bpy.types.Operator | bpy.types.PropertyGroup,
    mesh_object: bpy.types.Object | None,
) -> None:
    """Draw the mirror: its axis as Blender's own tools have it, and its modifier if there is one.

    What becomes of the image is greyed out without a mirror.
    """
    chosen = properties.mirror_axis
    # Buttons of single items do not take part in the split of labels and values.
    split = layout.split(factor=0.4)
    label = split.row()
    label.alignment = "RIGHT"
    label.label(text="Mirror")
    items = split.column(align=True)
    items.use_property_split = False
    row = items.row(align=True)
    for axis in mirror_plane.AXES:
        row.prop_enum(properties, "mirror_axis", axis)
    items.prop_enum(properties, "mirror_axis", mirror_plane.NONE)
    if chosen == mirror_plane.MODIFIER or mirror_plane.modifier_of(mesh_object) is not None:
        items.prop_enum(properties, "mirror_axis", mirror_plane.MODIFIER, icon="MOD_MIRROR")
    row = layout.row()
    row.active = chosen != mirror_plane.NONE
    row.prop(properties, "mirror_as", expand=True)


def draw_mirror_in_header(layout: bpy.types.UILayout, properties: bpy.types.PropertyGroup) -> None:
    """Draw the mirror in the header of the tool, where there is little room."""
    row = layout.row(align=True)
    row.label(icon="MOD_MIRROR")
    row.prop(properties, "mirror_axis", text="")
    if properties.mirror_axis != mirror_plane.NONE:
        row.prop(properties, "mirror_as", text="")


def draw_clearance(
    layout: bpy.types.UILayout, properties: bpy.types.Operator | bpy.types.PropertyGroup
) -> None:
    """Draw the clearance, greyed out if there is nothing to keep it from."""
    row = layout.row()
    row.active = bool(properties.obstacle_group) or properties.avoid_others
    row.prop(properties, "clearance")


def draw_output(
    layout: bpy.types.UILayout,
    properties: bpy.types.Operator | bpy.types.PropertyGroup,
    appearance: bool = True,
) -> None:
    """Draw the output and its settings; `appearance` tells whether to draw APPEARANCE too."""
    layout.use_property_split = True
    layout.use_property_decorate = False
    layout.prop(properties, "output")
    output = properties.output
    cuts = output in {"EDGES", "PARTS"} or (output == "REGION" and properties.region_cut)
    shown = {
        "spline": appearance and output in writing.SEPARATE,
        "radius": appearance and output in writing.SEPARATE,
        "thickness": appearance and output in writing.SEPARATE and not properties.radius,
        "offset": appearance and output in writing.SEPARATE,
        "tube": output == "STICKY",
        "parallel_distance": output == "PARALLEL",
        "parallel_count": output == "PARALLEL",
        "both_sides": output == "PARALLEL",
        "region_as": output == "REGION",
        "region_cut": output == "REGION",
        "parts_as": output == "PARTS",
        "other_side": output == "REGION"
        or (output == "PARTS" and properties.parts_as == "OBJECTS"),
        "mark_seam": output == "EDGES",
        "mark_sharp": output == "EDGES",
        "cut_faces": cuts,
        "simplify": cuts,
    }
    for name, is_shown in shown.items():
        if is_shown:
            layout.prop(properties, name)


def register() -> None:
    bpy.utils.register_class(NICMM_PG_settings)
    bpy.types.Scene.nicmm_curves = PointerProperty(type=NICMM_PG_settings)


def unregister() -> None:
    del bpy.types.Scene.nicmm_curves
    bpy.utils.unregister_class(NICMM_PG_settings)
