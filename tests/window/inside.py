# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs inside the Blender that `drive.py` drives: executes commands and reports the state.

Commands are Python files in a folder, executed one after another by a timer in Blender's main
thread. The result or the error of each is written beside it as JSON. Mouse and keys are sent from
outside, like those of a user.
"""

import hashlib
import json
import sys
import time
import traceback
from importlib import import_module
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

import bodies  # noqa: E402

FOLDER = Path(sys.argv[sys.argv.index("--") + 1])
EXTENSION = "bl_ext.user_default.nicmm_curves"
MODULE, CORE = f"{EXTENSION}.nicmm_blender", f"{EXTENSION}.nicmm_core"


class Helper:
    """Functions for commands."""

    frames: list = []

    @staticmethod
    def area():
        return next(area for area in bpy.context.window.screen.areas if area.type == "VIEW_3D")

    @classmethod
    def region(cls):
        """The region of the viewport; in a quad view that of the perspective."""
        view = cls.area().spaces.active.region_3d
        return next(
            region
            for region in cls.area().regions
            if region.type == "WINDOW" and region.data.as_pointer() == view.as_pointer()
        )

    @classmethod
    def in_view(cls):
        return bpy.context.temp_override(area=cls.area(), region=cls.region())

    @staticmethod
    def suzanne(levels=2):
        """The monkey in the middle of an empty scene; at two levels it has 15,744 triangles."""
        if bpy.context.mode != "OBJECT":
            bpy.ops.object.mode_set(mode="OBJECT")
        for found in list(bpy.data.objects):
            bpy.data.objects.remove(found)
        bpy.ops.mesh.primitive_monkey_add()
        monkey = bpy.context.active_object
        monkey.modifiers.new("Subdivision", "SUBSURF").levels = levels
        bpy.ops.object.modifier_apply(modifier="Subdivision")
        bpy.ops.object.shade_smooth()
        monkey.data.calc_loop_triangles()
        return len(monkey.data.loop_triangles)

    @classmethod
    def look(cls, x=0.15, y=-1.0, z=0.3, distance=3.6):
        """Look at the origin from a direction."""
        from mathutils import Vector

        view = cls.area().spaces.active.region_3d
        view.view_rotation = Vector((x, y, z)).to_track_quat("Z", "Y")
        view.view_location = (0.0, 0.0, 0.0)
        view.view_distance = distance
        view.view_perspective = "PERSP"
        view.update()

    @classmethod
    def pixels(cls, places, name="Suzanne"):
        """Pixels of the screen, from its top left, of positions in the monkey's local space."""
        from bpy_extras.view3d_utils import location_3d_to_region_2d

        region = cls.region()
        monkey = bpy.data.objects[name]
        found = []
        for place in np.atleast_2d(places).tolist():
            flat = location_3d_to_region_2d(
                region, cls.area().spaces.active.region_3d, monkey.matrix_world @ _vector(place)
            )
            found.append([region.x + flat.x, bpy.context.window.height - 1 - (region.y + flat.y)])
        return found

    @staticmethod
    def in_front(pairs):
        """Points of Suzanne that are visible from the front, at x and z."""
        monkey = bpy.data.objects["Suzanne"]
        found = [monkey.ray_cast((x, -5.0, z), (0.0, 1.0, 0.0)) for x, z in pairs]
        return [list(location) for _hit, location, _normal, _face in found]

    @staticmethod
    def above(pairs, name):
        """Points of an object that are visible from above, at x and y."""
        shown = bpy.data.objects[name]
        found = [shown.ray_cast((x, y, 5.0), (0.0, 0.0, -1.0)) for x, y in pairs]
        return [list(location) for _hit, location, _normal, _face in found]

    @staticmethod
    def activate_object(name):
        """Make an object active and the only selected one."""
        bpy.ops.object.select_all(action="DESELECT")
        chosen = bpy.data.objects[name]
        chosen.select_set(True)
        bpy.context.view_layer.objects.active = chosen

    @classmethod
    def nearest_to_eye(cls):
        """The index of the control point of the active curve that is nearest to the eye."""
        from mathutils import Vector

        view = cls.area().spaces.active.region_3d.view_matrix
        depths = [(view @ Vector(place)).z for place in cls.places()]
        return int(np.argmax(depths))

    @staticmethod
    def from_above(pairs):
        """Points of Suzanne that are visible from above, at x and y."""
        monkey = bpy.data.objects["Suzanne"]
        found = [monkey.ray_cast((x, y, 5.0), (0.0, 0.0, -1.0)) for x, y in pairs]
        return [list(location) for _hit, location, _normal, _face in found]

    @staticmethod
    def figure():
        """Suzanne with a subdivision, and an armature that an action bends until frame 20."""
        for found in list(bpy.data.objects):
            bpy.data.objects.remove(found)
        bpy.ops.mesh.primitive_monkey_add()
        monkey = bpy.context.active_object
        bpy.ops.object.shade_smooth()
        bpy.ops.object.armature_add()
        rig = bpy.context.active_object
        bpy.ops.object.mode_set(mode="EDIT")
        bone = rig.data.edit_bones[0]
        bone.head, bone.tail = (0, 0, -1), (0, 0, -0.2)
        upper = rig.data.edit_bones.new("Upper")
        upper.head, upper.tail, upper.parent = (0, 0, -0.2), (0, 0, 1), bone
        names = bone.name, upper.name
        bpy.ops.object.mode_set(mode="OBJECT")
        height = np.array([vertex.co.z for vertex in monkey.data.vertices])
        for name, weights in zip(names, (height < -0.1, height >= -0.1), strict=True):
            group = monkey.vertex_groups.new(name=name)
            group.add(np.flatnonzero(weights).tolist(), 1.0, "REPLACE")
        monkey.modifiers.new("Armature", "ARMATURE").object = rig
        monkey.modifiers.new("Subdivision", "SUBSURF").levels = 2
        posed = rig.pose.bones["Upper"]
        posed.rotation_mode = "XYZ"
        for frame, angle in ((1, 0.0), (20, 0.6)):
            posed.rotation_euler = (0.0, 0.0, angle)
            posed.keyframe_insert("rotation_euler", frame=frame)
        bpy.context.scene.frame_set(8)
        Helper.switch("Suzanne", "OBJECT")

    @classmethod
    def body(cls, kind):
        """Suzanne under modifiers, active in Object Mode."""
        if kind == "posed":
            cls.figure()
            return
        for found in list(bpy.data.objects):
            bpy.data.objects.remove(found)
        bpy.ops.mesh.primitive_monkey_add()
        monkey = bpy.context.active_object
        bpy.ops.object.shade_smooth()
        if kind == "mirrored":
            import bmesh

            edited = bmesh.new()
            edited.from_mesh(monkey.data)
            gone = [vertex for vertex in edited.verts if vertex.co.x < -1e-5]
            bmesh.ops.delete(edited, geom=gone, context="VERTS")
            edited.to_mesh(monkey.data)
            edited.free()
            monkey.modifiers.new("Mirror", "MIRROR")
        monkey.modifiers.new("Subdivision", "SUBSURF").levels = 2

    @classmethod
    def show_sidebar(cls):
        """Show the tab of the extension in the sidebar."""
        cls.area().spaces.active.show_region_ui = True
        sidebar = next(region for region in cls.area().regions if region.type == "UI")
        bpy.ops.wm.redraw_timer(type="DRAW_WIN_SWAP", iterations=1)  # the tabs exist when drawn
        sidebar.active_panel_category = "NICMM"

    @staticmethod
    def activate():
        """Make the first designed curve active."""
        found = next(each for each in bpy.data.objects if "nicmm_curve" in each)
        Helper.switch(found.name, "OBJECT")
        bpy.ops.ed.undo_push(message="Activate")

    @staticmethod
    def activate_mesh():
        Helper.switch("Suzanne", "OBJECT")

    @staticmethod
    def cube():
        bpy.ops.mesh.primitive_cube_add(size=0.5, location=(1.9, 0.0, 0.9))

    @staticmethod
    def shape(name):
        """A hash of the vertices of a mesh."""
        mesh = bpy.data.objects[name].data
        values = np.empty(3 * len(mesh.vertices), dtype=np.float32)
        mesh.vertices.foreach_get("co", values)
        return hashlib.sha1(values.tobytes()).hexdigest()

    @staticmethod
    def ridge():
        """A roof, with a thick curve on its far side just below the ridge."""
        for found in list(bpy.data.objects):
            bpy.data.objects.remove(found)
        bpy.ops.mesh.primitive_grid_add(x_subdivisions=40, y_subdivisions=40, size=2.0)
        roof = bpy.context.active_object
        roof.name = "Ridge"
        for vertex in roof.data.vertices:
            vertex.co.z = 1.0 - abs(vertex.co.y)
        places = [roof.closest_point_on_mesh((x, 0.04, 0.96))[1] for x in (-0.7, 0.0, 0.7)]
        points = [{"name": "", "position": place} for place in places]
        bpy.ops.nicmm.edit_curve(points=points, closed=False, radius=0.08)

    @staticmethod
    def top_of_tube():
        """A visible point of the tube, in the local space of the roof."""
        return [[0.2, 0.0, 1.02]]

    @classmethod
    def camera(cls):
        data = bpy.data.cameras.new("Camera")
        camera = bpy.data.objects.new("Camera", data)
        bpy.context.scene.collection.objects.link(camera)
        camera.location, camera.rotation_euler = (0.3, -5.0, 0.8), (1.42, 0.0, 0.06)
        bpy.context.scene.camera = camera
        cls.area().spaces.active.region_3d.view_perspective = "CAMERA"

    @classmethod
    def local_view(cls):
        with cls.in_view():
            bpy.ops.view3d.localview()

    @classmethod
    def quad_view(cls):
        with cls.in_view():
            bpy.ops.screen.region_quadview()

    @staticmethod
    def switch(name, mode):
        """Make an object active in a mode."""
        if bpy.context.mode != "OBJECT":
            bpy.ops.object.mode_set(mode="OBJECT")
        bpy.ops.object.select_all(action="DESELECT")
        chosen = bpy.data.objects[name]
        chosen.select_set(True)
        bpy.context.view_layer.objects.active = chosen
        bpy.ops.object.mode_set(mode=mode)

    @staticmethod
    def bend(angle):
        """Pose the upper bone, without a key."""
        posed = bpy.data.objects["Armature"].pose.bones["Upper"]
        posed.rotation_euler = (0.3, 0.0, angle)

    @staticmethod
    def pull_in_edit_mode():
        """Move the vertices of a cheek as the Move tool does."""
        import bmesh

        mesh = bpy.data.objects["Suzanne"].data
        edited = bmesh.from_edit_mesh(mesh)
        for vertex in edited.verts:
            vertex.select_set(vertex.co.x > 0.3 and vertex.co.z < 0.0)
        bmesh.update_edit_mesh(mesh)
        with Helper.in_view():
            bpy.ops.transform.translate(value=(0.2, 0.0, -0.1))

    @staticmethod
    def shown_in_front(pairs):
        """Points of the shown surface that are visible from the front, at x and z."""
        graph = bpy.context.evaluated_depsgraph_get()
        monkey = bpy.data.objects["Suzanne"]
        found = [monkey.ray_cast((x, -5.0, z), (0.0, 1.0, 0.0), depsgraph=graph) for x, z in pairs]
        return [list(location) for _hit, location, _normal, _face in found]

    @classmethod
    def seen(cls, places, name):
        """Points of the shown surface of an object that hide given places, or are in front."""
        graph = bpy.context.evaluated_depsgraph_get()
        body = bpy.data.objects[name]
        to_local = body.matrix_world.inverted()
        eye = to_local @ cls.area().spaces.active.region_3d.view_matrix.inverted().translation
        found = [body.ray_cast(eye, _vector(place) - eye, depsgraph=graph) for place in places]
        if not all(hit for hit, _location, _normal, _face in found):
            raise ValueError(f"nothing is seen at one of {places}")
        return [list(location) for _hit, location, _normal, _face in found]

    @staticmethod
    def gap(name, other):
        """Least distance between the points of a curve and another curve, in local units."""
        from mathutils.geometry import intersect_point_line

        points, ends = (
            [
                point.co.xyz
                for spline in bpy.data.objects[each].data.splines
                for point in [*spline.points, *spline.points[: spline.use_cyclic_u]]
            ]
            for each in (name, other)
        )

        def away(place, start, end):
            nearest, along = intersect_point_line(place, start, end)
            return (place - (nearest if 0.0 <= along <= 1.0 else (start, end)[along > 0.5])).length

        pairs = list(zip(ends[:-1], ends[1:], strict=True))
        return min(away(place, *pair) for place in points for pair in pairs)

    @staticmethod
    def away(name="Suzanne", curve_name=None):
        """Greatest distance of a curve, by default the first, from the surface, in diagonals."""
        from mathutils.bvhtree import BVHTree

        monkey = bpy.data.objects[name]
        curve = (
            bpy.data.objects[curve_name]
            if curve_name
            else next(found for found in bpy.data.objects if found.type == "CURVE")
        )
        if monkey.mode == "SCULPT" and not any(each.show_viewport for each in monkey.modifiers):
            mesh = monkey.data
        else:
            evaluated = monkey.evaluated_get(bpy.context.evaluated_depsgraph_get())
            mesh = evaluated.to_mesh()
        mesh.calc_loop_triangles()
        places = [vertex.co.copy() for vertex in mesh.vertices]
        faces = [tuple(triangle.vertices) for triangle in mesh.loop_triangles]
        tree = BVHTree.FromPolygons(places, faces, all_triangles=True)
        size = (max(places, key=lambda p: p.x) - min(places, key=lambda p: p.x)).length
        points = curve.data.splines[0].points
        return max(tree.find_nearest(point.co.xyz)[3] for point in points) / size

    @staticmethod
    def live_works():
        """Whether Live has work to do."""
        live = import_module(f"{MODULE}.operators.live_update")
        return bpy.app.timers.is_registered(live.tick)

    @staticmethod
    def curve():
        """The active designed curve, or None."""
        return import_module(f"{MODULE}.outputs.edited_curve").active(bpy.context)

    @classmethod
    def count(cls):
        """Control points of the active curve; -1 without one."""
        return len(cls.places()) if cls.curve() else -1

    @classmethod
    def places(cls):
        """Control points of the active curve in the mesh's local space."""
        return np.array(cls.curve()["nicmm_curve"]["control_positions"]).reshape(-1, 3).tolist()

    @classmethod
    def corners(cls):
        """Indices of the corners of the active curve."""
        return np.flatnonzero(cls.curve()["nicmm_curve"]["corner_points"]).tolist()

    @classmethod
    def via_places(cls):
        """Via points of the active curve in the mesh's local space."""
        return np.array(cls.curve()["nicmm_curve"]["via_positions"]).reshape(-1, 3).tolist()

    @classmethod
    def line(cls):
        """Points of the active curve object."""
        splines = cls.curve().data.splines
        return [list(point.co[:3]) for spline in splines for point in spline.points]

    @classmethod
    def mirrored_middle_of_leg(cls, leg):
        """The mirror image in x of the middle of a leg of the active curve."""
        x, y, z = cls.middle_of_leg(leg)
        return [-x, y, z]

    @classmethod
    def image_places(cls):
        """Mirror images of the control points of the active curve, in the order of the curve."""
        with cls.in_view():
            picking = import_module(f"{MODULE}.tool.picking")
            return picking.opened_now(bpy.context).image_positions().tolist()

    @classmethod
    def asymmetry(cls):
        """Greatest distance of the active curve object to its mirror image in x, in local units."""
        from mathutils.geometry import intersect_point_line

        lines = []
        for spline in cls.curve().data.splines:
            points = [point.co.xyz for point in spline.points]
            lines.append([*points, points[0]] if spline.use_cyclic_u else points)

        def away(place, ends):
            nearest, along = intersect_point_line(place, *ends)
            return (place - (nearest if 0.0 <= along <= 1.0 else ends[along > 0.5])).length

        segments = [ends for line in lines for ends in zip(line[:-1], line[1:], strict=True)]
        images = [_vector((-point.x, point.y, point.z)) for line in lines for point in line]
        return max(min(away(image, ends) for ends in segments) for image in images)

    @classmethod
    def middle_of_leg(cls, leg):
        """The visible point of a leg of the active curve that is nearest to its middle."""
        with cls.in_view():
            picking = import_module(f"{MODULE}.tool.picking")
            opened = picking.opened_now(bpy.context)
            view = picking.view_on(bpy.context, opened.mesh_object, opened.surface)
        core = import_module(f"{CORE}.geometry.curve")
        line = opened.lines()[0][core.points_of_leg(opened.curve, leg)]
        seen = np.flatnonzero(view.visible(line))
        return line[seen[np.abs(seen - len(line) // 2).argmin()]].tolist()

    @classmethod
    def middle_of_other(cls, name, leg, share=0.5):
        """A point of a leg of a curve that is not active, by default near its middle."""
        record = import_module(f"{MODULE}.scene.curve_record")
        curve = bpy.data.objects[name]
        surface = record.surface_of(curve, record.mesh_of(curve))
        (found,) = record.read_curves(curve, surface)
        index = import_module(f"{CORE}.geometry.curve").points_of_leg(found, leg)
        return found.points[index[int(share * len(index))]].tolist()

    @classmethod
    def junctions(cls, curve=None):
        """The junctions of a curve, by default the active one: point, and name of the other."""
        stored = (curve or cls.curve())["nicmm_curve"].get("junctions", ())
        return [[each["point"], each["curve"].name] for each in stored]

    @staticmethod
    def points_of(name):
        """A hash of the points of a curve object."""
        splines = bpy.data.objects[name].data.splines
        found = [list(point.co[:]) for spline in splines for point in spline.points]
        return hashlib.sha1(repr(found).encode()).hexdigest()

    @classmethod
    def state(cls):
        """A hash of everything that a designed curve consists of, for all curves."""
        found = []
        for each in sorted(bpy.data.objects, key=lambda each: each.name):
            if "nicmm_curve" in each:
                record = each["nicmm_curve"].to_dict()
                record["mesh"] = record["mesh"].name
                record["junctions"] = cls.junctions(each)
                splines = [
                    [list(point.co[:]) for point in spline.points] for spline in each.data.splines
                ]
                found.append((each.name, sorted(record.items()), splines))
        return hashlib.sha1(repr(found).encode()).hexdigest()

    @staticmethod
    def courses():
        """The number of courses among which the user chooses, and the chosen one; or None."""
        shown = import_module(f"{MODULE}.tool.course_overlay")._state.shown
        return shown and [len(shown.courses), shown.chosen]

    @staticmethod
    def chosen_course():
        """Points of the course that is chosen in the preview."""
        shown = import_module(f"{MODULE}.tool.course_overlay")._state.shown
        return shown.lines[shown.chosen].tolist()

    @classmethod
    def another_course(cls):
        """A course that is not chosen, and a pixel of the screen where a click chooses it.

        Of courses that share a leg, a click chooses the fairest.
        """
        shown = import_module(f"{MODULE}.tool.course_overlay")._state.shown
        region, opened = cls.region(), shown.opened
        with cls.in_view():
            picking = import_module(f"{MODULE}.tool.picking")
            view = picking.view_on(bpy.context, opened.mesh_object, opened.surface)
        for line in shown.lines:
            for pixel in np.round(view.project(line[view.visible(line)])):
                under = [
                    each
                    for each, other in enumerate(shown.lines)
                    if view.nearest_on_line(pixel, other, 2.0 * picking.CURVE_REACH) is not None
                ]
                if under and shown.chosen not in under:
                    x, y = pixel.tolist()
                    place = [region.x + x, bpy.context.window.height - 1 - (region.y + y)]
                    return min(under), place
        raise ValueError("the chosen course is everywhere")

    @staticmethod
    def keymap(name):
        """Choose a keymap of Blender's."""
        bpy.utils.keyconfig_set(bpy.utils.preset_find(name, "keyconfig"))

    @staticmethod
    def forget():
        """Drop what was computed for meshes."""
        import_module(f"{MODULE}.scene.surface_cache").forget()

    @staticmethod
    def is_modal():
        """Whether an operator of the extension runs."""
        running = bpy.context.window.modal_operators
        return any(each.bl_idname.startswith("NICMM") for each in running)

    @staticmethod
    def is_in_time_slices():
        """Whether an operator of the extension works in time slices."""
        return bool(import_module(f"{MODULE}.operators.sliced_operator")._running)

    @staticmethod
    def tool():
        """The tool of the current mode."""
        context = bpy.context
        found = context.workspace.tools.from_space_view3d_mode(context.mode, create=False)
        return "" if found is None else found.idname


def _vector(place):
    from mathutils import Vector

    return Vector(place)


def watch_tool():
    """Measure every event of a drag: its type, and milliseconds of CPU of Blender's thread."""
    drag = import_module(f"{MODULE}.tool.point_drag").PointDrag
    modal = drag._modal

    def watched(self, context, event):
        waiting = self._live is not None and self._live.waiting
        before = time.thread_time()  # Blender draws in other threads
        result = modal(self, context, event)
        Helper.frames.append([event.type, waiting, 1e3 * (time.thread_time() - before)])
        return result

    drag._modal = watched


def answer():
    """Execute the next command, if there is one."""
    for command in sorted(FOLDER.glob("*.command")):
        scope = {
            "bpy": bpy,
            "np": np,
            "bodies": bodies,
            "helper": Helper,
            "watch_tool": watch_tool,
        }
        try:
            exec(command.read_text(), scope)
            reply = json.dumps({"value": scope.get("value")})
        except Exception:
            reply = json.dumps({"error": traceback.format_exc()})
        command.unlink()
        partial = command.with_suffix(".partial")
        partial.write_text(reply)
        partial.rename(command.with_suffix(".reply"))
    return 0.05


bpy.context.preferences.view.show_splash = False
bpy.app.timers.register(answer, first_interval=1.0, persistent=True)
