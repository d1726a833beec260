# SPDX-License-Identifier: GPL-3.0-or-later
"""The settings of a curve, for the operators and the sidebar: options of the core, and outputs."""

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, PointerProperty, StringProperty

from ..nicmm_core.options import OPTIONS, Kind
from .outputs import sticky_curves
from .scene import curve_record

AUTOMATIC = (
    "AUTO",
    "Automatic",
    "As selected where Blender knows the order of all selected vertices, otherwise the shortest "
    "way round",
)
"""An order of Blender's own, before those of the core."""


def properties_of(options) -> dict:
    """Blender's properties for options of the core, by name; those of points have none."""
    return {
        curve_record.property_name(option): _property(option)
        for option in options
        if option.kind is not Kind.POINTS
    }


def _property(option):
    """A Blender property for an option of the core."""
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
    subtype = "DISTANCE" if option.kind is Kind.LENGTH else "NONE"
    return FloatProperty(**words, **limits, subtype=subtype, default=option.default)


class DesignProperties:
    """What the operator and the scene's settings have in common: the options of the core."""

    __annotations__ = properties_of(OPTIONS)


class EditingProperties:
    """What can be asked of a curve that is being edited: its points have an order already."""

    __annotations__ = properties_of(
        option for option in OPTIONS if option.name not in ("order", "method")
    )


def _tube_property(default: bool):
    return BoolProperty(
        name="Tube",
        description="Show the sticky curve as a mesh round it. Before Blender 5.0 the viewport "
        "draws hair curves themselves with a few points only",
        default=default,
    )


class OutputProperties:
    """What becomes of a curve; for a new one and for one that is converted."""

    output: EnumProperty(
        name="Output",
        description="What the curve becomes",
        items=(
            ("CURVE", "Curve", "A curve object of polylines. The mesh stays as it is"),
            (
                "STICKY",
                "Sticky Curves",
                "A hair curves object that follows the mesh when it is deformed. "
                "The mesh stays as it is",
            ),
            ("EDGES", "Cut Edges", "Cut the mesh, so that the curve becomes edges of it"),
            ("REGION", "Region", "The part of the mesh that the curve encloses"),
            ("PARTS", "Separate Parts", "Cut the mesh and part it along the curve"),
        ),
        default="CURVE",
    )
    thickness: FloatProperty(
        name="Thickness",
        description="Radius of the drawn curve relative to the size of the mesh. Zero draws a line",
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
                "One polygon on either side of the curve where it is flat enough, as a knife "
                "leaves it",
            ),
            ("TRIANGLES", "Triangles", "Triangles. The surface stays exactly as Blender draws it"),
        ),
        default="POLYGONS",
    )
    simplify: FloatProperty(
        name="Simplify",
        description="How far cut edges may run from the curve to save vertices inside faces, "
        "relative to the mean edge length",
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
            ("SELECTION", "Selection", "Select its faces and nothing else"),
            ("VERTEX_GROUP", "Vertex Group", "Put its vertices into a new vertex group"),
            ("FACE_SET", "Face Set", "Make it a new face set for Sculpt Mode"),
        ),
        default="SELECTION",
    )
    region_cut: BoolProperty(
        name="Cut First",
        description="Cut the mesh along the curve, so that the region ends exactly there. "
        "Otherwise it takes the faces that are inside by more than half",
        default=False,
    )
    other_side: BoolProperty(
        name="Other Side",
        description="Take the side of the curve with the larger area",
        default=False,
    )
    parts_as: EnumProperty(
        name="Parts As",
        description="Where the parts go",
        items=(
            ("LOOSE", "Loose Parts", "Both stay in this mesh and no longer share vertices"),
            ("OBJECTS", "Objects", "The part that the curve encloses becomes an object of its own"),
        ),
        default="LOOSE",
    )


PROPERTY_NAMES = (*DesignProperties.__annotations__, *OutputProperties.__annotations__)


class NICMM_PG_settings(DesignProperties, OutputProperties, bpy.types.PropertyGroup):
    """Settings of the sidebar panel, kept with the scene."""

    tube: _tube_property(not sticky_curves.are_drawn_with_all_points())


def choose_tube(operator) -> None:
    """Begin with a tube where it looks better; for operators that the window calls, not scripts.

    What the caller has set, or the user chose the last time, stays.
    """
    if not operator.properties.is_property_set("tube", ghost=False):
        operator.tube = not sticky_curves.are_drawn_with_all_points()


def draw(layout, properties, mesh_object) -> None:
    """Draw the settings for a curve on `mesh_object`, which may be None; for the redo panel."""
    draw_course(layout, properties)
    for name in ("obstacle_group", "alignment_group"):
        if mesh_object is None:
            layout.prop(properties, name, icon="GROUP_VERTEX")
        else:
            layout.prop_search(properties, name, mesh_object, "vertex_groups")
    draw_clearance(layout, properties)
    draw_output(layout, properties)


def draw_course(layout, properties) -> None:
    """Draw what leads the curve, without its maps."""
    layout.use_property_split = True
    layout.use_property_decorate = False
    for name in ("closed", "order", "method", "smoothness"):
        layout.prop(properties, name)


def draw_clearance(layout, properties) -> None:
    """Draw the distance from obstacles, greyed out where there are none."""
    row = layout.row()
    row.active = bool(properties.obstacle_group)
    row.prop(properties, "clearance")


def draw_output(layout, properties) -> None:
    """Draw what belongs to the output that is chosen."""
    layout.use_property_split = True
    layout.use_property_decorate = False
    layout.prop(properties, "output")
    output = properties.output
    cuts = output in {"EDGES", "PARTS"} or (output == "REGION" and properties.region_cut)
    shown = {
        "thickness": output in {"CURVE", "STICKY"},
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
