"""The editing tool: its operator in scripts, the record of curves, and its mouse and keys.

Blender has no window here. Events are handed to the operator's own methods, with a view that the
test makes; `tests/window` does the same in a real window.
"""

from importlib import import_module
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from tests.blender import scenes
from tests.blender.test_edit_session import looking, ring

ROUNDING = 2e-6


def on_surface(mesh_object, positions):
    """The points of the object nearest to positions."""
    return [list(mesh_object.closest_point_on_mesh(place)[1]) for place in positions]


def as_points(positions):
    return [{"name": "", "position": tuple(place)} for place in positions]


def edit(**arguments):
    assert bpy.ops.nicmm.edit_curve(spline="EXACT", **arguments) == {"FINISHED"}
    return bpy.context.active_object


def refusal(**arguments):
    with pytest.raises(RuntimeError) as caught:
        bpy.ops.nicmm.edit_curve(spline="EXACT", **arguments)
    return str(caught.value)


def expected_curve(core, mesh_object, positions, **arguments):
    from_mesh = core.Mesh(scenes.positions(mesh_object), scenes.triangles(mesh_object))
    return core.design_curve(from_mesh, np.array(positions), **arguments).curves[0]


def module(extension, name):
    return import_module(f"{extension.name}.nicmm_blender.{name}")


@pytest.fixture
def sphere(empty_scene):
    return scenes.sphere()


@pytest.fixture
def places(sphere):
    return on_surface(sphere, ring())


# In scripts.


def test_points_inside_faces(empty_scene, sphere, places):
    curve = edit(points=as_points(places))
    assert curve.type == "CURVE" and curve.parent == sphere
    expected = expected_curve(empty_scene.core, sphere, places)
    np.testing.assert_allclose(scenes.points(curve), expected.points, atol=ROUNDING)


@pytest.mark.slow
@pytest.mark.parametrize(
    "settings", [{"closed": False}, {"smoothness": 4.0}, {"smoothness": 0.25, "closed": True}]
)
def test_settings_reach_the_core(empty_scene, sphere, places, settings):
    curve = edit(points=as_points(places), **settings)
    expected = expected_curve(empty_scene.core, sphere, places, **settings)
    np.testing.assert_allclose(scenes.points(curve), expected.points, atol=ROUNDING)
    # An existing curve gets other settings.
    bpy.context.view_layer.objects.active = sphere
    other = edit(points=as_points(places))
    assert edit(**settings) == other
    np.testing.assert_allclose(scenes.points(other), expected.points, atol=ROUNDING)


@pytest.mark.slow
def test_groups_reach_the_core(empty_scene, sphere, places):
    middle = ring()[:2].mean(axis=0)
    away = np.linalg.norm(scenes.positions(sphere) - middle / np.linalg.norm(middle), axis=1)
    weights = {"Wall": (away < 0.3).astype(float), "Rail": np.clip(1.2 - 2.0 * away, 0.0, 1.0)}
    for name, values in weights.items():
        group = sphere.vertex_groups.new(name=name)
        for vertex in np.flatnonzero(values).tolist():
            group.add([vertex], values[vertex], "REPLACE")
    plain = scenes.points(edit(points=as_points(places)))
    for settings, arguments in (
        (
            {"obstacle_group": "Wall", "clearance": 0.1},
            {"obstacles": weights["Wall"], "clearance": 0.1},
        ),
        ({"alignment_group": "Rail"}, {"alignment": weights["Rail"].astype(np.float32)}),
    ):
        bpy.context.view_layer.objects.active = sphere
        curve = edit(points=as_points(places), **settings)
        expected = expected_curve(empty_scene.core, sphere, places, **arguments)
        np.testing.assert_allclose(scenes.points(curve), expected.points, atol=ROUNDING)
        assert scenes.distances_to(scenes.points(curve), plain).max() > 0.005


def test_new_curve_takes_the_settings_of_the_panel(sphere, places):
    bpy.context.scene.nicmm_curves.closed = False
    bpy.context.scene.nicmm_curves.smoothness = 2.0
    curve = edit(points=as_points(places))
    assert not curve.data.splines[0].use_cyclic_u
    assert curve["nicmm_curve"]["asked"]["smoothness"] == 2.0


@pytest.mark.parametrize("mode", ["OBJECT", "EDIT"])
@pytest.mark.parametrize("output", ["CURVE", "STICKY"])
def test_outputs_thickness_and_undo(empty_scene, sphere, places, mode, output):
    bpy.ops.object.mode_set(mode=mode)
    bpy.ops.ed.undo_push(message="Mode")
    before = len(bpy.data.objects)
    arguments = {"points": as_points(places), "output": output, "thickness": 0.02}
    assert bpy.ops.nicmm.edit_curve("EXEC_DEFAULT", True, **arguments) == {"FINISHED"}
    (made,) = (found for found in bpy.data.objects if "nicmm_curve" in found)
    diagonal = np.linalg.norm(np.ptp(scenes.positions(bpy.data.objects["Icosphere"]), axis=0))
    if output == "CURVE":
        assert made.data.bevel_depth == pytest.approx(0.02 * diagonal)
    else:
        assert made.type == "CURVES"
        assert made.data.attributes["radius"].data[0].value == pytest.approx(0.02 * diagonal)
    bpy.ops.ed.undo()
    assert len(bpy.data.objects) == before


def test_errors_say_what_to_do(empty_scene, sphere, places):
    assert "There are no control points" in refusal()
    assert "off the surface" in refusal(points=as_points([[0, 0, 3], *places]))
    assert 'no designed curve "Icosphere"' in refusal(curve="Icosphere")
    assert "at least two points" in refusal(points=as_points(places[:1]))
    assert "point 1 and point 2 are the same point" in refusal(
        points=as_points([places[0], places[0], places[1]])
    ).replace("Point", "point")
    assert 'no vertex group "Wall"' in refusal(points=as_points(places), obstacle_group="Wall")
    assert not bpy.data.curves
    sphere.data.clear_geometry()
    assert "has no faces" in refusal(points=as_points(places))


def test_poll_gives_reasons(empty_scene):
    assert "Make a mesh or a designed curve active" in refusal()
    scenes.sphere()
    bpy.ops.object.mode_set(mode="SCULPT")
    assert "Switch to Object Mode or Edit Mode" in refusal()


# The record of a curve.


def controls(curve):
    return np.array(curve["nicmm_curve"]["control_positions"]).reshape(-1, 3)


@pytest.mark.slow
def test_edited_again_after_reopening(empty_scene, sphere, places, tmp_path):
    """The same object, with its points, its settings, its material and its thickness."""
    curve = edit(points=as_points(places), closed=False, smoothness=2.0)
    material = bpy.data.materials.new("Gold")
    curve.data.materials.append(material)
    curve.data.bevel_depth = 0.123
    before = scenes.points(curve)
    path = str(tmp_path / "saved.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    curve = bpy.data.objects["Icosphere Curve"]
    bpy.context.view_layer.objects.active = curve
    edited_curve = module(empty_scene, "tool.edited_curve")
    record = module(empty_scene, "scene.curve_record")
    opened = edited_curve.open_session(bpy.context, curve, record.asked_of(curve))
    assert opened.session.idle and opened.session.state.converged
    assert not opened.session.asked.closed and opened.session.asked.smoothness == 2.0
    np.testing.assert_allclose(opened.session.positions(), places, atol=ROUNDING)
    np.testing.assert_allclose(opened.session.polyline(), before, atol=ROUNDING)

    assert edit() == curve
    np.testing.assert_allclose(scenes.points(curve), before, atol=ROUNDING)
    assert edit(closed=True) == curve
    assert curve.data.splines[0].use_cyclic_u
    assert curve.data.bevel_depth == pytest.approx(0.123)
    assert [slot.name for slot in curve.data.materials] == ["Gold"]
    np.testing.assert_allclose(controls(curve), places, atol=ROUNDING)
    assert len([found for found in bpy.data.objects if found.type == "CURVE"]) == 1


def test_a_curve_through_vertices_can_be_edited(empty_scene, sphere):
    vertices = scenes.ring(sphere, 5, height=0.2)
    scenes.select(sphere, vertices)
    bpy.ops.nicmm.design_curve(spline="EXACT", smoothness=3.0)
    curve = bpy.context.active_object
    np.testing.assert_allclose(controls(curve), scenes.positions(sphere)[vertices], atol=ROUNDING)
    before = scenes.points(curve)
    edit()
    np.testing.assert_allclose(scenes.points(curve), before, atol=ROUNDING)
    assert curve["nicmm_curve"]["asked"]["smoothness"] == 3.0
    edit(points=as_points(on_surface(sphere, ring())))
    np.testing.assert_allclose(controls(curve), on_surface(sphere, ring()), atol=ROUNDING)


@pytest.mark.slow
def test_sticky_curves_are_edited_in_place(sphere, places):
    curve = edit(points=as_points(places), output="STICKY", thickness=0.01)
    radius = curve.data.attributes["radius"].data[0].value
    edit(closed=False)
    assert bpy.context.active_object == curve and len(curve.modifiers) == 1
    data = curve.data
    assert len(data.curves) == 1
    assert not data.attributes["cyclic"].data[0].value
    assert data.attributes["radius"].data[0].value == pytest.approx(radius)
    evaluated = curve.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    placed = np.array([point.position[:] for point in evaluated.points])
    written = np.array([point.position[:] for point in data.points])
    np.testing.assert_allclose(placed, written, atol=1e-5)


@pytest.mark.slow
def test_converted_curves_can_be_edited(sphere, places):
    edit(points=as_points(places), smoothness=2.0)
    bpy.ops.nicmm.convert_curve(spline="EXACT", output="STICKY")
    sticky = bpy.context.active_object
    np.testing.assert_allclose(controls(sticky), places, atol=ROUNDING)
    assert sticky["nicmm_curve"]["asked"]["smoothness"] == 2.0
    assert edit(closed=False) == sticky


def test_points_follow_a_sculpted_mesh(sphere, places):
    curve = edit(points=as_points(places))
    for vertex in sphere.data.vertices:
        vertex.co *= 1.5
    edit()
    np.testing.assert_allclose(scenes.points(curve)[0], np.array(places[0]) * 1.5, atol=1e-5)


@pytest.mark.parametrize("change", ["subdivide", "delete"])
def test_on_a_changed_mesh_points_move_to_the_nearest_position(sphere, places, change, capfd):
    curve = edit(points=as_points(places))
    bpy.ops.object.select_all(action="DESELECT")
    bpy.context.view_layer.objects.active = sphere
    if change == "subdivide":
        scenes.select(sphere, range(len(sphere.data.vertices)))
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.subdivide()
    else:
        top = np.flatnonzero(scenes.positions(sphere)[:, 2] > 0.9).tolist()
        scenes.select(sphere, top)
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.delete(type="VERT")
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.context.view_layer.objects.active = curve
    edit()
    assert "the mesh has changed: 5 points" in capfd.readouterr().out
    np.testing.assert_allclose(controls(curve), places, atol=1e-5)
    bpy.ops.nicmm.convert_curve(spline="EXACT", output="CURVE")


def test_a_deleted_group_is_left_out(sphere, places, capfd):
    group = sphere.vertex_groups.new(name="Wall")
    group.add([0], 0.5, "REPLACE")
    curve = edit(points=as_points(places), obstacle_group="Wall")
    sphere.vertex_groups.remove(group)
    edit()
    assert 'without the vertex group "Wall"' in capfd.readouterr().out
    assert curve["nicmm_curve"]["asked"]["obstacle_group"] == ""


def test_modifiers_are_mentioned(sphere, places, capfd):
    sphere.modifiers.new("Subdivision", "SUBSURF")
    edit(points=as_points(places), use_modifiers=False)
    assert "without its modifiers" in capfd.readouterr().out


def test_a_deleted_mesh_is_named(sphere, places):
    curve = edit(points=as_points(places))
    bpy.data.objects.remove(sphere)
    bpy.ops.mesh.primitive_cube_add()
    assert "is not in this scene" in refusal(curve=curve.name)


def test_the_redo_panel_runs_it_again(sphere, places):
    """As in Blender: with the properties of the last call, on the state before it."""
    bpy.ops.ed.undo_push(message="Before")
    bpy.ops.nicmm.edit_curve("EXEC_DEFAULT", True, points=as_points(places), closed=False)
    last = bpy.context.window_manager.operators
    if last:  # kept in a window only
        assert len(last[-1].points) == len(places)
    bpy.ops.ed.undo()
    assert not scenes.curves()


# Its places in the interface.


def test_the_tool_is_in_the_toolbar(empty_scene):
    from bl_ui.space_toolsystem_common import ToolSelectPanelHelper

    panel = ToolSelectPanelHelper._tool_class_from_space_type("VIEW_3D")
    for mode in ("OBJECT", "EDIT_MESH"):
        names = [tool.idname for tool in panel._tools_flatten(panel._tools[mode]) if tool]
        assert any(name.startswith("nicmm.surface_curve") for name in names), mode


def test_hints_have_icons_that_exist(empty_scene):
    icons = bpy.types.UILayout.bl_rna.functions["label"].parameters["icon"].enum_items.keys()
    for icon, _ in module(empty_scene, "tool.edit_operator").HINTS:
        assert icon in icons


# Mouse and keys.

CENTRE = np.array([400.0, 300.0])


class Tool:
    """The operator's methods on a session, looking along the y axis; no window."""

    def __init__(self, extension, mesh_object, edited=None):
        operator = module(extension, "tool.edit_operator")
        for name, value in vars(operator.NICMM_OT_edit_curve).items():
            if callable(value) and name.startswith("_") and not name.startswith("__"):
                setattr(self, name, value.__get__(self))
        self.reports, self.redraws = [], 0
        self._keep = lambda *_: {"FINISHED"}
        self._end = lambda _context: setattr(self, "ended", True)
        self._show = self._redraw = lambda _context: None
        self.report = lambda _kind, text: self.reports.append(text)
        self.ended = False
        edited_curve = module(extension, "tool.edited_curve")
        record = module(extension, "scene.curve_record")
        asked = record.Asked() if edited is None else record.asked_of(edited)
        self._opened = edited_curve.open_session(bpy.context, edited, asked)
        self.session = self._opened.session
        self._edited_name = ""
        self._grabbed, self._grip, self._last_move = None, np.zeros(2), 0.0
        self._overlay = SimpleNamespace(hover=None)
        parts = SimpleNamespace(edit_view=module(extension, "tool.edit_view"))
        view = looking(parts, self.session, -5.0, True)
        self.view = view
        self._view = lambda _context, event, anywhere=False: (view, event.pixel)

    def send(self, kind, value="PRESS", pixel=CENTRE, **keys):
        pressed = dict.fromkeys(("ctrl", "shift", "alt", "oskey"), False) | keys
        event = SimpleNamespace(type=kind, value=value, pixel=np.array(pixel), **pressed)
        system = SimpleNamespace(ui_scale=1.0)  # Blender has none without a window
        return self._modal(SimpleNamespace(preferences=SimpleNamespace(system=system)), event)

    def click(self, pixel, **keys):
        self.send("LEFTMOUSE", "PRESS", pixel, **keys)
        self.send("LEFTMOUSE", "RELEASE", pixel, **keys)
        self.wait()

    def wait(self):
        """Timer events until the session is idle."""
        for _ in range(100):
            if self.session.idle:
                return
            self.send("TIMER", "NOTHING")
        raise AssertionError("never at rest")

    def pixel_of(self, number):
        return self.view.project(self.session.positions())[number]


CLICKS = [CENTRE + offset for offset in ([-60, 50], [70, 60], [60, -50], [-50, -60])]


@pytest.fixture
def tool(empty_scene):
    """With four points where the clicks would have put them."""
    made = Tool(empty_scene, scenes.sphere(4))
    faces, barycentric = zip(*(made.view.place_at(pixel) for pixel in CLICKS), strict=True)
    made.session.set_points(made.session.surface.points(np.array(faces), np.array(barycentric)))
    made.wait()
    return made


@pytest.mark.slow
def test_clicks_add_points(empty_scene):
    tool = Tool(empty_scene, scenes.sphere(4))
    for pixel in CLICKS:
        tool.click(pixel)
    assert len(tool.session.points) == 4
    for number, pixel in enumerate(CLICKS):
        np.testing.assert_allclose(tool.pixel_of(number), pixel, atol=0.1)
    assert tool.session.curve.closed
    tool.click([5.0, 5.0])  # beside the mesh
    assert len(tool.session.points) == 4


def test_a_point_is_dragged_with_the_mouse(tool):
    """It follows the pointer at a constant distance; off the mesh it stays still."""
    grip = np.array([4.0, -3.0])
    tool.send("LEFTMOUSE", "PRESS", CLICKS[1] + grip)
    for step in range(1, 6):
        tool.send("MOUSEMOVE", "NOTHING", CLICKS[1] + grip + [0, 5.0 * step])
    np.testing.assert_allclose(tool.pixel_of(1), CLICKS[1] + [0, 25.0], atol=0.1)
    tool.send("MOUSEMOVE", "NOTHING", [5.0, 5.0])
    np.testing.assert_allclose(tool.pixel_of(1), CLICKS[1] + [0, 25.0], atol=0.1)
    tool.send("LEFTMOUSE", "RELEASE", [5.0, 5.0])
    tool.wait()
    tool.send("MOUSEMOVE", "NOTHING", CENTRE)
    np.testing.assert_allclose(tool.pixel_of(1), CLICKS[1] + [0, 25.0], atol=0.1)
    tool.send("Z", ctrl=True)
    np.testing.assert_allclose(tool.pixel_of(1), CLICKS[1], atol=0.1)
    tool.send("Z", ctrl=True, shift=True)
    np.testing.assert_allclose(tool.pixel_of(1), CLICKS[1] + [0, 25.0], atol=0.1)


def test_right_click_ends_a_drag_as_it_began(tool):
    before = tool.session.state
    tool.send("LEFTMOUSE", "PRESS", CLICKS[1])
    tool.send("MOUSEMOVE", "NOTHING", CLICKS[1] + [0, 20.0])
    tool.send("RIGHTMOUSE")
    assert tool.session.state == before
    # If nothing has moved yet, it undoes nothing else.
    tool.send("LEFTMOUSE", "PRESS", CLICKS[1])
    tool.send("RIGHTMOUSE")
    assert tool.session.state == before


def test_a_click_on_the_curve_inserts(tool):
    line = tool.view.project(tool.session.polyline())
    index = tool.session.curve.control_index
    tool.click(line[(index[1] + index[2]) // 2] + [2.0, 2.0])
    assert len(tool.session.points) == 5
    np.testing.assert_allclose(tool.pixel_of(2), line[(index[1] + index[2]) // 2], atol=5.0)
    np.testing.assert_allclose(tool.pixel_of(3), CLICKS[2], atol=0.1)


def test_removing(tool):
    tool.click(CLICKS[1], ctrl=True)
    assert len(tool.session.points) == 3
    tool.click(CENTRE, ctrl=True)  # on no point
    assert len(tool.session.points) == 3
    tool.send("MOUSEMOVE", "NOTHING", CLICKS[0])
    tool.send("X")
    np.testing.assert_allclose(tool.pixel_of(0), CLICKS[2], atol=0.1)


@pytest.mark.parametrize("on", [{"kind": "UP_ARROW"}, {"kind": "WHEELUPMOUSE", "ctrl": True}])
def test_keys_change_what_is_asked(tool, on):
    session, mesh_object = tool.session, tool._opened.mesh_object
    for name in ("Wall", "Rail"):
        mesh_object.vertex_groups.new(name=name).add([0], 0.5, "REPLACE")
    tool.send("C")
    assert not session.asked.closed
    tool.send(**on)
    assert session.asked.smoothness > 1.0
    tool.send("DOWN_ARROW")
    assert session.asked.smoothness == pytest.approx(1.0)
    for key, field in (("O", "obstacle_group"), ("A", "alignment_group")):
        for expected in ("Wall", "Rail", "", "Wall"):
            tool.send(key)
            assert getattr(session.asked, field) == expected
        tool.send(key, shift=True)
        assert getattr(session.asked, field) == ""
    tool.wait()
    assert not session.problem


@pytest.mark.parametrize("kind", ["MIDDLEMOUSE", "WHEELUPMOUSE", "NUMPAD_1", "TRACKPADPAN"])
def test_the_view_can_be_turned(tool, kind):
    assert tool.send(kind) == {"PASS_THROUGH"}


def test_other_keys_are_kept_from_blender(tool):
    before = tool.session.state
    for kind in ("G", "TAB", "DEL_", "RIGHTMOUSE", "F"):
        assert tool.send(kind) == {"RUNNING_MODAL"}
    assert tool.session.state == before


def test_escape_and_enter(tool):
    assert tool.send("RET") == {"FINISHED"} and tool.ended
    tool.ended = False
    assert tool.send("ESC") == {"CANCELLED"} and tool.ended


def test_enter_without_a_curve(empty_scene):
    tool = Tool(empty_scene, scenes.sphere(4))
    assert tool.send("RET") == {"CANCELLED"} and tool.ended
    tool = Tool(empty_scene, scenes.sphere(4))
    tool.click(CENTRE)
    assert tool.send("RET") == {"RUNNING_MODAL"} and not tool.ended


def test_enter_in_the_middle_of_things(tool):
    """The curve that is kept has converged, also immediately after a change."""
    tool.send("C")
    assert not tool.session.idle
    assert tool.send("RET") == {"FINISHED"}
    assert tool.session.state.converged and not tool.session.curve.closed


def test_a_long_design_waits_while_the_mouse_moves(tool):
    tool.session.ask_for(closed=False)
    tool.send("LEFTMOUSE", "PRESS", CLICKS[1])
    assert tool.session.waiting
    tool._last_move = 1e12
    tool.send("TIMER", "NOTHING")
    assert tool.session.waiting
    tool._last_move = 0.0
    tool.send("TIMER", "NOTHING")
    assert not tool.session.waiting
