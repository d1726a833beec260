# SPDX-License-Identifier: GPL-3.0-or-later
"""The settings of a curve for the operators and the sidebar: core options and outputs."""

import bpy
from bpy.props import (
    BoolProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from ..nicmm_core.options import OPTIONS, Kind
from .outputs import sticky_curves, writing
from .scene import curve_record

AUTOMATIC = (
    "AUTO",
    "Automatic",
    "The order of selection where Blender has recorded it for all selected vertices, otherwise "
    "the shortest order",
)
"""An order that only the extension has, listed before those of the core."""


def properties_of(options) -> dict:
    """Blender properties for core options, by name; options that hold points are left out."""
    return {
        curve_record.property_name(option): _property(option)
        for option in options
        if option.kind is not Kind.POINTS
    }


def _property(option):
    """The Blender property for a core option."""
    words = {"name": option.label, "description": option.description}
    if option.kind is Kind.SWITCH:
        return BoolProperty(**words, default=option.default)
    if option.kind is Kind.CHOICE:
        items = [
            (curve_record.identifier(each.name), each.label, each.description)
            for each in option.choices
        ]
        if option.name == "order":
            items.insert(0, AUTOMATIC)
            return EnumProperty(**words, items=items, default="AUTO")
        return EnumProperty(**words, items=items, default=curve_record.identifier(option.default))
    if option.kind is Kind.WEIGHTS:
        words["description"] += ": a vertex group. Leave empty for none"
        return StringProperty(**words)
    names, values = ("min", "max", "soft_min", "soft_max"), (*option.limits, *option.usual)
    limits = {
        name: value for name, value in zip(names, values, strict=True) if value < float("inf")
    }
    if option.kind is Kind.COUNT:
        whole = {name: int(value) for name, value in limits.items()}
        return IntProperty(**words, **whole, default=option.default)
    subtype = "DISTANCE" if option.kind is Kind.LENGTH else "NONE"
    return FloatProperty(**words, **limits, subtype=subtype, default=option.default)


SURFACE = {
    "use_modifiers": BoolProperty(
        name="Use Modifiers",
        description="Draw on the surface that the viewport shows, with modifiers and shape keys. "
        "Otherwise on the mesh without them",
        default=True,
    )
}


class DesignProperties:
    """The options of a new curve, shared by the operator and the scene settings."""

    __annotations__ = properties_of(OPTIONS) | SURFACE


class EditingProperties:
    """The options of a curve that is being edited; its points already have an order."""

    __annotations__ = (
        properties_of(
            option for option in OPTIONS if option.name not in (*curve_record.OF_A_DESIGN, "method")
        )
        | SURFACE
    )


def _tube_property(default: bool):
    return BoolProperty(
        name="Tube",
        description="Show the sticky curve as a tube mesh. Before Blender 5.0 the viewport "
        "draws hair curves with only a few points",
        default=default,
    )


class OutputProperties:
    """The output of a new curve or of one that is converted."""

    output: EnumProperty(
        name="Output",
        description="What the curve becomes",
        items=(
            ("CURVE", "Curve", "A curve object of polylines. The mesh stays unchanged"),
            (
                "STICKY",
                "Sticky Curves",
                "A hair curves object that follows the mesh when it is deformed. "
                "The mesh stays unchanged",
            ),
            ("EDGES", "Cut Edges", "Cut the mesh so that the curve becomes edges of it"),
            ("REGION", "Region", "The part of the mesh that the curve encloses"),
            ("PARTS", "Separate Parts", "Cut the mesh and separate it along the curve"),
        ),
        default="CURVE",
    )
    spline: EnumProperty(
        name="Spline",
        description="The points of the curve object",
        items=(
            (
                "EVEN",
                "Even",
                "Evenly spaced from control point to control point, within a ten-thousandth of the "
                "size of the mesh and a tenth of the radius",
            ),
            ("EXACT", "Exact", "Every crossing with an edge of the mesh: exactly on its faces"),
            (
                "BEZIER",
                "Bézier",
                "Few knots with handles, the control points among them. Sticky curves are spaced "
                "evenly instead",
            ),
        ),
        default="EVEN",
    )
    radius: FloatProperty(
        name="Radius",
        description="Radius of the curve. Zero: a share of the size of the mesh, Thickness",
        default=0.0,
        min=0.0,
        soft_max=1.0,
        subtype="DISTANCE",
    )
    offset: FloatProperty(
        name="Offset",
        description="Distance of the curve from the surface along its normals",
        default=0.0,
        soft_min=-1.0,
        soft_max=1.0,
        subtype="DISTANCE",
    )
    thickness: FloatProperty(
        name="Thickness",
        description="Radius of the curve relative to the size of the mesh, if Radius is zero. Zero "
        "gives a line",
        default=0.004,
        min=0.0,
        soft_max=0.05,
        precision=4,
        step=0.1,
    )
    tube: _tube_property(False)
    mark_seam: BoolProperty(
        name="Mark Seam",
        description="Make the edges along the curve UV seams",
        default=True,
    )
    mark_sharp: BoolProperty(
        name="Mark Sharp",
        description="Make the edges along the curve sharp",
        default=False,
    )
    cut_faces: EnumProperty(
        name="Faces",
        description="What cut faces become",
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
                "Triangles. The shape of the surface stays exactly the same",
            ),
        ),
        default="POLYGONS",
    )
    simplify: FloatProperty(
        name="Simplify",
        description="Largest distance between the cut edges and the curve, relative to the mean "
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
            ("SELECTION", "Selection", "Select only its faces"),
            ("VERTEX_GROUP", "Vertex Group", "Assign its vertices to a new vertex group"),
            ("FACE_SET", "Face Set", "Make its faces a new face set for Sculpt Mode"),
        ),
        default="SELECTION",
    )
    region_cut: BoolProperty(
        name="Cut First",
        description="Cut the mesh along the curve so that the region ends exactly there. "
        "Otherwise the region consists of the faces with more than half of their area inside",
        default=False,
    )
    other_side: BoolProperty(
        name="Other Side",
        description="Use the side of the curve with the larger area",
        default=False,
    )
    parts_as: EnumProperty(
        name="Parts As",
        description="What the parts become",
        items=(
            ("LOOSE", "Loose Parts", "Both stay in this mesh and no longer share vertices"),
            ("OBJECTS", "Objects", "The part that the curve encloses becomes a separate object"),
        ),
        default="LOOSE",
    )


PROPERTY_NAMES = (*DesignProperties.__annotations__, *OutputProperties.__annotations__)


class NICMM_PG_settings(DesignProperties, OutputProperties, bpy.types.PropertyGroup):
    """Settings of the sidebar panel, saved with the scene."""

    tube: _tube_property(not sticky_curves.are_drawn_with_all_points())


def choose_tube(operator) -> None:
    """Enable *Tube* where strands look coarse; for operators called from the window.

    A value that the caller has set, or that the user chose last time, is kept.
    """
    if not operator.properties.is_property_set("tube", ghost=False):
        operator.tube = not sticky_curves.are_drawn_with_all_points()


def draw(layout, properties, mesh_object) -> None:
    """Draw the settings for a curve on `mesh_object` or None, in the redo panel."""
    draw_course(layout, properties)
    for name in ("obstacle_group", "alignment_group"):
        if mesh_object is None:
            layout.prop(properties, name, icon="GROUP_VERTEX")
        else:
            layout.prop_search(properties, name, mesh_object, "vertex_groups")
    draw_clearance(layout, properties)
    draw_output(layout, properties)


def draw_course(layout, properties) -> None:
    """Draw the settings of the curve itself, without its maps."""
    layout.use_property_split = True
    layout.use_property_decorate = False
    for name in ("closed", "order", "method", "smoothness"):
        layout.prop(properties, name)
    row = layout.row()
    row.active = properties.method == "NICMM"
    row.prop(properties, "alternatives")
    layout.prop(properties, "use_modifiers")


def draw_clearance(layout, properties) -> None:
    """Draw the clearance, greyed out without obstacles."""
    row = layout.row()
    row.active = bool(properties.obstacle_group)
    row.prop(properties, "clearance")


def draw_output(layout, properties) -> None:
    """Draw the output and its settings."""
    layout.use_property_split = True
    layout.use_property_decorate = False
    layout.prop(properties, "output")
    output = properties.output
    cuts = output in {"EDGES", "PARTS"} or (output == "REGION" and properties.region_cut)
    shown = {
        "spline": output in writing.SEPARATE,
        "radius": output in writing.SEPARATE,
        "thickness": output in writing.SEPARATE and not properties.radius,
        "offset": output in writing.SEPARATE,
        "tube": output == "STICKY",
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
