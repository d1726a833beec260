# SPDX-License-Identifier: GPL-3.0-or-later
"""The operator that draws a curve through the selected vertices."""

import sys
from contextlib import contextmanager

import bpy

from . import curve_object, designers, mesh_data, settings

ORDER_NAMES = {"given": "in the order of selection", "shortest": "in the shortest order"}


class NICMM_OT_design_curve(settings.DesignProperties, bpy.types.Operator):
    """Draw a smooth curve on the surface of the mesh through its selected vertices"""

    bl_idname = "nicmm.design_curve"
    bl_label = "Design Curve on Surface"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        mesh_object = mesh_data.mesh_object(context)
        if mesh_object is None:
            cls.poll_message_set("Make a mesh object active")
            return False
        if context.mode not in {"OBJECT", "EDIT_MESH"}:
            cls.poll_message_set("Switch to Object Mode or Edit Mode")
            return False
        if context.mode == "EDIT_MESH" and not mesh_object.data.total_vert_sel:
            cls.poll_message_set("Select the vertices that the curve should pass through")
            return False
        return True

    def draw(self, context):
        settings.draw(self.layout, self, mesh_data.mesh_object(context))

    def execute(self, context):
        mesh_object = mesh_data.mesh_object(context)
        try:
            from .. import nicmm_core as nicmm

            surface, order, design = self._design(context, mesh_object)
        except ImportError as error:
            self.report(
                {"ERROR"},
                f"A library that NICMM Curves needs cannot be loaded ({error}). "
                "Install the zip that was made for this platform and this Blender",
            )
            return {"CANCELLED"}
        except nicmm.MissingPackageError as error:
            self.report(
                {"ERROR"},
                f"{error}. Blender's Python is {sys.executable}; a zip of NICMM Curves that was "
                "built with --with-torch brings PyTorch along",
            )
            return {"CANCELLED"}
        except nicmm.UnreachableError as error:
            group = f' (obstacles: the vertex group "{self.obstacle_group}")'
            self.report({"ERROR"}, f"{error}{group if self.obstacle_group else ''}")
            return {"CANCELLED"}
        except (mesh_data.InputError, nicmm.NicmmError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}

        if not design.curves:
            self.report({"ERROR"}, str(design.status))
            return {"CANCELLED"}
        curve_object.add(
            context,
            mesh_object,
            [
                (surface.points(curve.faces, curve.barycentric), curve.closed)
                for curve in design.curves
            ],
            self.thickness * surface.diagonal,
        )
        summary = _summary(mesh_object, design, order)
        if design.status == nicmm.Status.CONVERGED:
            self.report({"INFO"}, summary)
        else:
            self.report({"WARNING"}, f"{summary}; {design.status}")
        return {"FINISHED"}

    def _design(self, context, mesh_object):
        """Read the mesh and let the core draw; return the triangles, the order and the design."""
        mesh_data.synchronise(mesh_object)
        vertices, order = mesh_data.control_points(mesh_object, self.order)
        obstacles = mesh_data.group_weights(mesh_object, self.obstacle_group)
        alignment = mesh_data.group_weights(mesh_object, self.alignment_group)
        surface = mesh_data.triangles(mesh_object)
        with _progress(context) as progress:
            designer = designers.designer_for(surface.solved, surface.faces)
            # The same settings give the same curve, whatever was designed before.
            designer.forget()
            design = designer.design(
                vertices,
                closed=self.closed,
                order=order,
                method=self.method.lower().replace("_", "-"),
                obstacles=obstacles,
                alignment=alignment,
                clearance=0.0 if obstacles is None else self.clearance,
                smoothness=self.smoothness,
                progress=progress,
            )
        return surface, order, design


def _summary(mesh_object, design, order: str) -> str:
    curve = design.curves[0]
    summary = (
        f"Curve through {len(curve.control_index)} vertices {ORDER_NAMES[order]}: "
        f"{len(curve.points)} points, {design.seconds:.1f} s"
    )
    if any(modifier.show_viewport for modifier in mesh_object.modifiers):
        summary += ", on the mesh without its modifiers"
    return summary


@contextmanager
def _progress(context):
    """Show progress at the mouse pointer; gives the callable that the core reports to."""
    window_manager = context.window_manager
    window_manager.progress_begin(0.0, 1.0)
    try:
        yield lambda fraction, _polyline: window_manager.progress_update(fraction)
    finally:
        window_manager.progress_end()


def register() -> None:
    bpy.utils.register_class(NICMM_OT_design_curve)


def unregister() -> None:
    bpy.utils.unregister_class(NICMM_OT_design_curve)
