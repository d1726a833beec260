# SPDX-License-Identifier: GPL-3.0-or-later
"""The operators that create and paint obstacle and alignment maps, which are vertex groups."""

import bpy
import numpy as np
from bpy.props import BoolProperty, EnumProperty, FloatProperty

from ..outputs import curve_object, edited_curve
from ..scene import curve_record, mesh_data
from ..scene.messages import InputError, counted
from ..scene.selection import selected_vertices
from ..scene.surface import read, vertex_group
from . import curve_settings, polls
from .error_reports import with_error_reports

ROLES = (
    ("OBSTACLES", "Obstacles", "Weights that keep curves away"),
    ("ALIGNMENT", "Alignment", "Weights that attract curves"),
)
FIELDS = {"OBSTACLES": "obstacle_group", "ALIGNMENT": "alignment_group"}
NAMES = {"OBSTACLES": "Obstacles", "ALIGNMENT": "Alignment"}

SOURCES = (
    ("PAINT", "Empty", "Start without weights and paint them", "BRUSH_DATA", 0),
    ("SELECTION", "Selected Vertices", "The selected vertices", "RESTRICT_SELECT_OFF", 1),
    ("CURVATURE", "Curvature", "Where the surface is strongly curved", "SPHERECURVE", 2),
    (
        "SHARP_EDGES",
        "Sharp Edges",
        "Edges where the normals of the faces differ by Angle or more",
        "MOD_EDGESPLIT",
        3,
    ),
    ("MARKED_SHARP", "Edges Marked Sharp", "Edges marked as sharp", "EDGESEL", 4),
    ("SEAMS", "Seams", "Edges marked as UV seams", "UV_EDGESEL", 5),
)
ATTRIBUTES = {"MARKED_SHARP": ("use_edge_sharp", "marked sharp"), "SEAMS": ("use_seam", "a seam")}


class NICMM_OT_new_map(bpy.types.Operator):
    """Create a vertex group that keeps curves away or attracts them"""

    bl_idname = "nicmm.new_map"
    bl_label = "New Map"
    bl_options = {"REGISTER", "UNDO"}

    role: EnumProperty(name="Use As", description="Effect of the weights on curves", items=ROLES)
    source: EnumProperty(name="From", description="Source of the weights", items=SOURCES)
    angle: FloatProperty(
        name="Angle",
        description="Minimum angle between the normals of two faces at a sharp edge",
        subtype="ANGLE",
        default=np.radians(30.0),
        min=0.0,
        max=np.pi,
    )
    strength: FloatProperty(
        name="Strength",
        description="Maximum weight. Curves never enter an obstacle of weight 1",
        default=1.0,
        min=0.0,
        max=1.0,
        subtype="FACTOR",
    )
    show: BoolProperty(
        name="Weight Paint",
        description="Switch to Weight Paint mode to show and paint the weights",
        default=True,
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _poll(cls, context)

    def draw(self, _context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(self, "role")
        layout.prop(self, "source")
        if self.source == "SHARP_EDGES":
            layout.prop(self, "angle")
        if self.source != "PAINT":
            layout.prop(self, "strength")
        layout.prop(self, "show")

    def execute(self, context: bpy.types.Context) -> set[str]:
        return with_error_reports(self, lambda: self._execute(context))

    def _execute(self, context: bpy.types.Context) -> set[str]:
        mesh_object, curve = _mesh_to_change(context), edited_curve.active(context)
        mesh_data.synchronise(mesh_object)
        weights = self.strength * _weights(mesh_object, self.source, self.angle)
        if self.source != "PAINT" and not weights.any():
            self.report({"WARNING"}, f'All weights on "{mesh_object.name}" are zero')
        mode = mesh_object.mode
        _enter(context, mesh_object, "OBJECT")
        group = mesh_object.vertex_groups.new(name=NAMES[self.role])
        ascending = np.argsort(weights, kind="stable")
        values, begins = np.unique(weights[ascending], return_index=True)
        for weight, vertices in zip(values.tolist(), np.split(ascending, begins[1:]), strict=True):
            if weight:
                group.add(vertices.tolist(), weight, "REPLACE")
        # The mesh is active now, but the map is for the curve that was.
        setattr(_settings(context, curve), FIELDS[self.role], group.name)
        mesh_object.vertex_groups.active_index = group.index
        _enter(context, mesh_object, "WEIGHT_PAINT" if self.show else mode)
        _keep_active(context, curve)
        created = f'Vertex group "{group.name}" with {counted(np.count_nonzero(weights), "weight")}'
        if curve is not None and (problem := curve_settings.problem_of(curve)):
            self.report({"WARNING"}, f'{created}; "{curve.name}" does not use it: {problem}')
        else:
            self.report({"INFO"}, created)
        return {"FINISHED"}


class NICMM_OT_paint_map(bpy.types.Operator):
    """Paint the weights of a map, or return to Object Mode"""

    bl_idname = "nicmm.paint_map"
    bl_label = "Paint Map"
    bl_options = {"REGISTER", "UNDO"}

    role: EnumProperty(name="Map", description="Map to paint", items=ROLES)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _poll(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        return with_error_reports(self, lambda: self._execute(context))

    def _execute(self, context: bpy.types.Context) -> set[str]:
        mesh_object = curve_record.mesh_of_context(context)
        if mesh_object is None:
            raise InputError(polls.NO_MESH_OR_CURVE)
        name = getattr(settings_of(context), FIELDS[self.role])
        if is_painting(context, mesh_object, name):
            curve = edited_curve.active(context)
            _enter(context, mesh_object, "OBJECT")
            _keep_active(context, curve)
            return {"FINISHED"}
        if not name:
            raise InputError(
                f"No vertex group is chosen for {NAMES[self.role]}. Choose one, or create a new map"
            )
        group = vertex_group(_mesh_to_change(context), name)
        mesh_object.vertex_groups.active_index = group.index
        _enter(context, mesh_object, "WEIGHT_PAINT")
        return {"FINISHED"}


def settings_of(context: bpy.types.Context) -> bpy.types.PropertyGroup:
    """The settings that name the maps: those of the active curve, or of a new curve."""
    return _settings(context, edited_curve.active(context))


def _settings(
    context: bpy.types.Context, curve: bpy.types.Object | None
) -> bpy.types.PropertyGroup:
    return context.scene.nicmm_curves if curve is None else curve.nicmm_settings


def _mesh_to_change(context: bpy.types.Context) -> bpy.types.Object:
    """The active mesh, or the mesh of the active curve; an error if its weights cannot change."""
    active = context.active_object
    if curve_record.has_record(active):
        mesh_object = curve_record.mesh_in_view_layer(context, active)
    else:
        mesh_object = mesh_data.mesh_object(context)
    mesh_data.check_local(mesh_object, "its weights cannot be changed")
    if not mesh_object.visible_get():
        raise InputError(f'"{mesh_object.name}" is hidden. Show it to create or paint maps')
    return mesh_object


def is_painting(
    context: bpy.types.Context, mesh_object: bpy.types.Object | None, name: str
) -> bool:
    """Whether Weight Paint mode is active and paints this group."""
    active = None if mesh_object is None else mesh_object.vertex_groups.active
    return context.mode == "PAINT_WEIGHT" and active is not None and active.name == name


def _poll(cls: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    has_mesh = curve_record.mesh_of_context(context) is not None
    missing = polls.NO_MESH_OR_CURVE
    return polls.usable(cls, context, has_mesh, missing, polls.OBJECT_EDIT_OR_WEIGHTS)


def _weights(mesh_object: bpy.types.Object, source: str, angle: float) -> np.ndarray:
    """The weight of every vertex, (V,)."""
    from ... import nicmm_core as nicmm

    weights = np.zeros(len(mesh_object.data.vertices))
    if source == "PAINT":
        return weights
    if source == "SELECTION":
        weights[selected_vertices(mesh_object)] = 1.0
        return weights
    surface = read(mesh_object, use_modifiers=False)
    mesh = nicmm.Mesh(surface.core_positions, surface.faces)
    if source == "CURVATURE":
        return nicmm.curvature_map(mesh)
    if source == "SHARP_EDGES":
        return nicmm.sharp_edge_map(mesh, angle)
    attribute, words = ATTRIBUTES[source]
    edges = mesh_data.marked_edges(mesh_object, attribute)
    if len(edges) == 0:
        raise InputError(
            f'No edge of "{mesh_object.name}" is {words}. Mark edges in Edit Mode '
            "(Edge menu), or choose another source for the map"
        )
    return nicmm.edge_map(mesh, edges)


def _enter(context: bpy.types.Context, mesh_object: bpy.types.Object, mode: str) -> None:
    """Make the mesh active and switch it to a mode."""
    if context.view_layer.objects.active != mesh_object:
        context.view_layer.objects.active = mesh_object
    if mesh_object.mode != mode:
        bpy.ops.object.mode_set(mode=mode)


def _keep_active(context: bpy.types.Context, curve: bpy.types.Object | None) -> None:
    """Make the curve that a map is for active again, if the mode is Object Mode."""
    if curve is not None and context.mode == "OBJECT":
        curve_object.select_only(context, curve)


CLASSES = (NICMM_OT_new_map, NICMM_OT_paint_map)


def register() -> None:
    for found in CLASSES:
        bpy.utils.register_class(found)


def unregister() -> None:
    for found in reversed(CLASSES):
        bpy.utils.unregister_class(found)
