# SPDX-License-Identifier: GPL-3.0-or-later
"""The settings of a curve: one definition for the operator and for the sidebar panel."""

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, PointerProperty, StringProperty


class DesignProperties:
    """What the operator and the scene's settings have in common."""

    closed: BoolProperty(
        name="Closed",
        description="Lead the curve from the last control point back to the first, or end it there",
        default=True,
    )
    order: EnumProperty(
        name="Order",
        description="How the curve visits the selected vertices",
        items=(
            (
                "AUTO",
                "Automatic",
                "As selected where Blender knows the order of all selected vertices, "
                "otherwise the shortest way round",
            ),
            ("GIVEN", "As Selected", "In the order in which the vertices were clicked"),
            ("SHORTEST", "Shortest", "The shortest way round"),
        ),
        default="AUTO",
    )
    method: EnumProperty(
        name="Method",
        description="How the curve is computed",
        items=(
            ("NICMM", "NICMM", "The default method"),
            (
                "NICMM_PAPER",
                "NICMM (Paper)",
                "The method exactly as the paper describes it. Needs PyTorch",
            ),
            ("VARIATIONAL", "Variational", "The same energy without a network"),
        ),
        default="NICMM",
    )
    smoothness: FloatProperty(
        name="Smoothness",
        description="Weight of a fair curve against a short one, relative to the usual balance",
        default=1.0,
        min=0.001,
        soft_min=0.1,
        soft_max=10.0,
    )
    obstacle_group: StringProperty(
        name="Obstacles",
        description=(
            "Vertex group whose weights keep the curve away; where the weight is 1 the curve never "
            "enters. Leave empty for none"
        ),
    )
    clearance: FloatProperty(
        name="Clearance",
        description="Distance along the surface that the curve keeps from obstacles of weight 1",
        subtype="DISTANCE",
        default=0.0,
        min=0.0,
    )
    alignment_group: StringProperty(
        name="Alignment",
        description="Vertex group whose weights attract the curve. Leave empty for none",
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


PROPERTY_NAMES = tuple(DesignProperties.__annotations__)


class NICMM_PG_settings(DesignProperties, bpy.types.PropertyGroup):
    """Settings of the sidebar panel, kept with the scene."""


def draw(layout, properties, mesh_object) -> None:
    """Draw the settings for a curve on `mesh_object`, which may be None."""
    layout.use_property_split = True
    layout.use_property_decorate = False
    for name in ("closed", "order", "method", "smoothness"):
        layout.prop(properties, name)
    for name in ("obstacle_group", "alignment_group"):
        if mesh_object is None:
            layout.prop(properties, name, icon="GROUP_VERTEX")
        else:
            layout.prop_search(properties, name, mesh_object, "vertex_groups")
        if name == "obstacle_group":
            row = layout.row()
            row.active = bool(properties.obstacle_group)
            row.prop(properties, "clearance")
    layout.prop(properties, "thickness")


def register() -> None:
    bpy.utils.register_class(NICMM_PG_settings)
    bpy.types.Scene.nicmm_curves = PointerProperty(type=NICMM_PG_settings)


def unregister() -> None:
    del bpy.types.Scene.nicmm_curves
    bpy.utils.unregister_class(NICMM_PG_settings)
