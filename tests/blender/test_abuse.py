"""Random sequences of our operators, undo, mode changes, deletions, links and damaged records.

A state machine of Hypothesis. Every step may be refused with a message; none may end in a
traceback, lose an object, or leave data, handlers or timers behind. NICMM_ABUSE_RUNS sets the
number of sequences, NICMM_ABUSE_SEED another seed.
"""

import math
import os
import shutil
import sys
import tempfile
from importlib import import_module

import bpy
import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, seed, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    rule,
    run_state_machine_as_test,
)

from tests.blender import scenes

RUNS = int(os.environ.get("NICMM_ABUSE_RUNS", "4"))
SEED = int(os.environ.get("NICMM_ABUSE_SEED", "0"))
STEPS = 50
"""Steps of a sequence."""

MODES = ("OBJECT", "EDIT", "SCULPT", "WEIGHT_PAINT")
NUMBERS = st.integers(0, 1000)
DIRECTIONS = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(
    lambda given: np.linalg.norm(given) > 0.1
)

DAMAGES = (
    lambda record: record.__setitem__("control_barycentric", [0.5, 0.5]),
    lambda record: record.__setitem__("barycentric", [math.nan] * len(record["barycentric"])),
    lambda record: record.__setitem__("corners", [2**30] * len(record["corners"])),
    lambda record: record.__setitem__("corners", [-5] * len(record["corners"])),
    lambda record: record.__setitem__("control_corners", [-1] * len(record["control_corners"])),
    lambda record: record.__setitem__("control_index", [10**6] * len(record["control_index"])),
    lambda record: record.__setitem__("counts", [7]),
    lambda record: record.__setitem__("counts", "many"),
    lambda record: record.__setitem__("version", 99),
    lambda record: record.__setitem__("version", "old"),
    lambda record: record.__setitem__("asked", 3),
    lambda record: record["asked"].__setitem__("smoothness", math.nan),
    lambda record: record["asked"].__setitem__("closed", "yes"),
    lambda record: record.__setitem__("drawn", {"spline": "NONE", "offset": 0.0}),
    lambda record: record.__setitem__("mesh", 5),
    lambda record: record.__setitem__("vertices", "x"),
    lambda record: record.pop("closed"),
    lambda record: record.pop("control_positions"),
)


class Watch:
    """Stands in for the error stream: Blender prints the tracebacks of callbacks there."""

    def __init__(self, stream):
        self.stream, self.text = stream, ""

    def write(self, text):
        self.text += text
        return self.stream.write(text)

    def flush(self):
        self.stream.flush()


class Abuse(RuleBasedStateMachine):
    name, steps = "", 0

    @initialize()
    def begin(self):
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        self.folder = tempfile.mkdtemp(prefix="nicmm-abuse-")
        self.watch, sys.stderr = Watch(sys.stderr), None
        sys.stderr = self.watch
        self.done = []
        scenes.sphere(3)
        bpy.ops.mesh.primitive_cube_add(location=(3, 0, 0))
        library = os.path.join(self.folder, "library.blend")
        scenes.activate(bpy.data.objects["Icosphere"])
        for place in scenes.five_places()[:3]:
            bpy.ops.nicmm.add_point(
                position=bpy.data.objects["Icosphere"].closest_point_on_mesh(place)[1]
            )
        bpy.ops.wm.save_as_mainfile(filepath=library, copy=True)
        self.library = library
        bpy.ops.ed.undo_push(message="Start")
        self.handlers = self.count_handlers()

    def teardown(self):
        if hasattr(self, "folder"):
            sys.stderr = self.watch.stream
            shutil.rmtree(self.folder, ignore_errors=True)

    @staticmethod
    def count_handlers():
        return {
            name: len(getattr(bpy.app.handlers, name))
            for name in dir(bpy.app.handlers)
            if isinstance(getattr(bpy.app.handlers, name), list)
        }

    # Helpers.

    def call(self, operator, *arguments, removes=False, **named):
        """Run an operator; a message is fine."""
        self.done.append((str(operator), named))
        before = {each.session_uid for each in bpy.data.objects}
        spare = sum(not data.users for data in bpy.data.curves)
        try:
            if operator.poll():
                operator(*(arguments or ("EXEC_DEFAULT", True)), **named)
        except TypeError as error:  # a mode that this object does not have
            assert "mode" in named and "not found in" in str(error), (self.done[-12:], str(error))
        except RuntimeError as error:
            assert "Traceback" not in str(error), (self.done[-12:], str(error))
        if str(operator).startswith("<function bpy.ops.nicmm") or "nicmm" in repr(operator):
            after = {each.session_uid for each in bpy.data.objects}
            assert removes or before <= after, self.done[-12:]
            assert sum(not data.users for data in bpy.data.curves) <= spare, self.done[-12:]

    @staticmethod
    def pick(objects, number):
        objects = sorted(objects, key=lambda each: each.name)
        return objects[number % len(objects)] if objects else None

    @staticmethod
    def curves():
        return [each for each in bpy.data.objects if "nicmm_curve" in each]

    def push(self, message):
        self.done.append(message)
        bpy.ops.ed.undo_push(message=message)

    def place(self, direction):
        active = bpy.context.active_object
        if active is not None and "nicmm_curve" in active:
            active = active.parent
        if active is None or active.type != "MESH" or not len(active.data.polygons):
            return direction
        if active.mode == "EDIT":
            return direction
        try:
            return active.closest_point_on_mesh(direction)[1]
        except RuntimeError:
            return direction

    # Our operators.

    @rule(direction=DIRECTIONS)
    def add_point(self, direction):
        self.call(bpy.ops.nicmm.add_point, position=self.place(direction))

    @rule(direction=DIRECTIONS)
    def add_another_point(self, direction):
        self.call(bpy.ops.nicmm.add_point, position=self.place(direction))

    @rule(direction=DIRECTIONS, index=st.integers(0, 6))
    def insert_point(self, direction, index):
        self.call(bpy.ops.nicmm.insert_point, position=self.place(direction), index=index)

    @rule(direction=DIRECTIONS, index=st.integers(0, 6))
    def move_point(self, direction, index):
        self.call(bpy.ops.nicmm.move_point, position=self.place(direction), index=index)

    @rule(index=st.integers(0, 6))
    def remove_point(self, index):
        self.call(bpy.ops.nicmm.remove_point, index=index)

    @rule()
    def end_curve(self):
        self.call(bpy.ops.nicmm.end_curve)

    @rule(number=NUMBERS)
    def activate_curve(self, number):
        chosen = self.pick(self.curves(), number)
        if chosen is not None:
            self.call(bpy.ops.nicmm.activate_curve, curve=chosen.name)

    @rule(
        number=NUMBERS,
        change=st.sampled_from(
            [
                ("closed", False),
                ("closed", True),
                ("smoothness", 3.0),
                ("spline", "BEZIER"),
                ("spline", "EVEN"),
                ("offset", 0.1),
                ("radius", 0.0),
                ("radius", 0.1),
                ("use_modifiers", False),
                ("obstacle_group", "Group"),
                ("alignment_group", "Gone"),
                ("clearance", 0.1),
            ]
        ),
    )
    def set_property(self, number, change):
        chosen = self.pick(self.curves(), number)
        if chosen is not None and chosen.library is None:
            self.done.append(change)
            setattr(chosen.nicmm_settings, *change)
            self.push("set")

    @rule()
    def update_curves(self):
        self.call(bpy.ops.nicmm.update_curves)

    @rule(output=st.sampled_from(["CURVE", "STICKY", "EDGES"]), keep=st.booleans())
    def convert_curve(self, output, keep):
        self.call(bpy.ops.nicmm.convert_curve, removes=True, output=output, keep_original=keep)

    @rule()
    def edit_curve(self):
        self.call(bpy.ops.nicmm.edit_curve)

    @rule(first=NUMBERS)
    def design_curve(self, first):
        mesh = bpy.context.active_object
        if mesh is not None and mesh.type == "MESH" and len(mesh.data.vertices):
            vertices = [(first * step) % len(mesh.data.vertices) for step in (1, 3, 7, 11)]
            self.call(bpy.ops.nicmm.design_curve, points=", ".join(map(str, vertices)))

    @rule(output=st.sampled_from(["CURVE", "STICKY", "REGION"]))
    def set_panel(self, output):
        bpy.context.scene.nicmm_curves.output = output

    @rule(on=st.booleans())
    def live(self, on):
        bpy.context.scene.nicmm_live_update = on
        live = import_module(f"{self.name}.nicmm_blender.operators.live_update")
        live._updates.last_change = 0.0
        for _ in range(200):
            if live.tick() is None:
                break
        self.push("live")

    @rule(number=NUMBERS)
    def look(self, number):
        """What panels, overlay and hover read."""
        chosen = self.pick(self.curves(), number)
        if chosen is None:
            return
        for name in ("closed", "smoothness", "spline", "offset", "radius", "obstacle_group"):
            getattr(chosen.nicmm_settings, name)
        picking = import_module(f"{self.name}.nicmm_blender.tool.picking")
        messages = import_module(f"{self.name}.nicmm_blender.scene.messages")
        core = import_module(f"{self.name}.nicmm_core")
        try:
            mesh_object, curve = picking.mesh_and_curve(bpy.context)
            if mesh_object is not None and picking.is_ready(bpy.context, mesh_object, curve):
                picking.opened_now(bpy.context).polyline()
                picking.other_lines(bpy.context)
        except (messages.InputError, core.NicmmError):
            return

    # What users and other scripts do.

    @rule()
    def undo(self):
        self.call(bpy.ops.ed.undo, "EXEC_DEFAULT")

    @rule()
    def redo(self):
        self.call(bpy.ops.ed.redo, "EXEC_DEFAULT")

    @rule(mode=st.sampled_from(MODES))
    def change_mode(self, mode):
        self.call(bpy.ops.object.mode_set, mode=mode)

    @rule()
    def to_object_mode(self):
        self.call(bpy.ops.object.mode_set, mode="OBJECT")

    @rule(number=NUMBERS)
    def activate(self, number):
        chosen = self.pick(bpy.context.view_layer.objects, number)
        if chosen is not None and bpy.context.mode == "OBJECT":
            scenes.activate(chosen)
            self.push(f"activate {chosen.name}")

    @rule(number=NUMBERS, remove=st.booleans())
    def delete(self, number, remove):
        chosen = self.pick(bpy.context.view_layer.objects, number)
        if chosen is None or bpy.context.mode != "OBJECT" or len(bpy.data.objects) < 3:
            return
        if remove:
            bpy.data.objects.remove(chosen)
            self.push("remove")
        else:
            scenes.activate(chosen)
            self.call(bpy.ops.object.delete)

    @rule(number=NUMBERS)
    def rename(self, number):
        chosen = self.pick(bpy.data.objects, number)
        if chosen is not None and chosen.library is None:
            chosen.name = f"Named {number % 5}"
            self.push("rename")

    @rule()
    def duplicate(self):
        if len(bpy.data.objects) < 12:
            self.call(bpy.ops.object.duplicate)

    @rule()
    def add_mesh(self):
        if len(bpy.data.objects) < 12:
            self.call(bpy.ops.mesh.primitive_uv_sphere_add, segments=12, ring_count=8)

    @rule(
        number=NUMBERS,
        kind=st.sampled_from(["move", "SUBSURF", "MIRROR", "clear", "group", "scale"]),
    )
    def change_mesh(self, number, kind):
        meshes = [each for each in bpy.data.objects if each.type == "MESH" and each.library is None]
        chosen = self.pick(meshes, number)
        if chosen is None or chosen.mode != "OBJECT" or chosen.data.library is not None:
            return
        if kind == "move":
            for vertex in chosen.data.vertices:
                vertex.co.z *= 1.1
            chosen.data.update()
        elif kind == "clear":
            chosen.data.clear_geometry()
        elif kind == "group":
            group = chosen.vertex_groups.new(name="Group")
            group.add(list(range(min(20, len(chosen.data.vertices)))), 1.0, "REPLACE")
        elif kind == "scale":
            chosen.scale = (1.0, 1.0, 2.0) if number % 3 else (1.0, 1.0, 0.0)
        elif len(chosen.modifiers) < 2:
            chosen.modifiers.new(kind, kind)
        self.push(kind)

    @rule()
    def subdivide(self):
        mesh = bpy.context.active_object
        if bpy.context.mode == "EDIT_MESH" and len(mesh.data.polygons) < 3000:
            bpy.ops.mesh.select_all(action="SELECT")
            self.call(bpy.ops.mesh.subdivide)

    @rule()
    def delete_vertices(self):
        if bpy.context.mode == "EDIT_MESH":
            bpy.ops.mesh.select_all(action="DESELECT")
            bpy.ops.mesh.select_random(ratio=0.2)
            self.call(bpy.ops.mesh.delete, type="VERT")

    @rule(link=st.booleans())
    def from_library(self, link):
        if bpy.context.mode != "OBJECT" or len(bpy.data.objects) > 12:
            return
        with bpy.data.libraries.load(self.library, link=link) as (given, wanted):
            wanted.objects = list(given.objects)
        for found in wanted.objects:
            if found is not None and found.name not in bpy.context.collection.objects:
                bpy.context.collection.objects.link(found)
        self.push("library")

    @rule()
    def reload(self):
        path = os.path.join(self.folder, "saved.blend")
        self.call(bpy.ops.object.mode_set, mode="OBJECT")
        bpy.ops.wm.save_as_mainfile(filepath=path)
        bpy.ops.wm.open_mainfile(filepath=path)
        self.done.append("reload")
        bpy.ops.ed.undo_push(message="Reload")

    @rule(number=NUMBERS, damage=st.integers(0, len(DAMAGES) - 1))
    def damage(self, number, damage):
        chosen = self.pick(self.curves(), number)
        if chosen is None or chosen.library is not None:
            return
        try:
            DAMAGES[damage](chosen["nicmm_curve"])
        except (KeyError, TypeError, AttributeError):
            return  # it is damaged already
        self.push(f"damage {damage}")

    @rule(number=NUMBERS, value=st.sampled_from([1, "x", [1.0, 2.0]]))
    def replace_record(self, number, value):
        chosen = self.pick(self.curves(), number)
        if chosen is not None and chosen.library is None and number % 4 == 0:
            chosen["nicmm_curve"] = value
            self.push("replace the record")

    # What must always hold.

    @invariant()
    def no_traceback(self):
        Abuse.steps += 1
        if hasattr(self, "watch"):
            assert "Traceback" not in self.watch.text, (self.done[-15:], self.watch.text[-3000:])

    @invariant()
    def nothing_is_left_behind(self):
        if hasattr(self, "watch"):
            assert not [each for each in bpy.data.meshes if each.name.startswith("NICMM")]
            assert not [each for each in bpy.data.scenes if each.name.startswith("NICMM")]
            assert self.count_handlers() == self.handlers


@pytest.mark.slow
def test_abuse(extension):
    Abuse.name = extension.name
    run_state_machine_as_test(
        seed(SEED)(Abuse),
        settings=settings(
            max_examples=RUNS,
            stateful_step_count=STEPS,
            deadline=None,
            database=None,
            phases=[Phase.generate],
            suppress_health_check=list(HealthCheck),
        ),
    )
    print(f"{Abuse.steps} steps")
    assert Abuse.steps > RUNS
