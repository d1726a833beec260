"""Setting all control points of a curve in a script, the record of a curve, and the toolbar."""

import bpy
import numpy as np
import pytest

from tests.blender import scenes
from tests.blender.scenes import module

pytestmark = pytest.mark.usefixtures("remembered_designs")

ROUNDING = 2e-6


def on_surface(mesh_object, positions):
    """The points on the object nearest to some positions."""
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
    return scenes.design(core, from_mesh, np.array(positions), **arguments).curves[0]


@pytest.fixture
def sphere(empty_scene):
    return scenes.sphere()


@pytest.fixture
def places(sphere):
    return on_surface(sphere, scenes.five_places())


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
    # The settings of an existing curve are changed.
    bpy.context.view_layer.objects.active = sphere
    other = edit(points=as_points(places))
    assert edit(**settings) == other
    np.testing.assert_allclose(scenes.points(other), expected.points, atol=ROUNDING)


@pytest.mark.slow
def test_groups_reach_the_core(empty_scene, sphere, places):
    middle = scenes.five_places()[:2].mean(axis=0)
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


@pytest.mark.slow
def test_clearance_is_a_length_of_the_scene(sphere, places):
    """It is the same fraction of the sphere whatever the scale of the object."""
    middle = scenes.five_places()[:2].mean(axis=0)
    away = np.linalg.norm(scenes.positions(sphere) - middle / np.linalg.norm(middle), axis=1)
    sphere.vertex_groups.new(name="Wall").add(np.flatnonzero(away < 0.3).tolist(), 1.0, "REPLACE")
    drawn = []
    for scale in (1.0, 0.01):
        sphere.scale = (scale,) * 3
        bpy.context.view_layer.update()
        bpy.context.view_layer.objects.active = sphere
        curve = edit(points=as_points(places), obstacle_group="Wall", clearance=0.1 * scale)
        drawn.append(scenes.points(curve))
    np.testing.assert_allclose(*drawn, atol=ROUNDING)
    before = curve.data["nicmm_designed_on"]
    sphere.scale = (1.0, 1.0, 1.0)
    bpy.context.view_layer.update()
    assert bpy.ops.nicmm.update_curves(curve=curve.name) == {"FINISHED"}
    assert curve.data["nicmm_designed_on"] != before


def test_settings_of_a_curve_cannot_be_animated(sphere, places):
    curve = edit(points=as_points(places))
    for name in ("closed", "smoothness", "clearance", "offset", "radius"):
        with pytest.raises(TypeError, match="not animatable"):
            curve.nicmm_settings.keyframe_insert(name)


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
    bpy.ops.object.mode_set(mode="VERTEX_PAINT")
    assert "Switch to Object Mode, Edit Mode, Sculpt Mode or Weight Paint" in refusal()


# The record of a curve.


def controls(curve):
    return np.array(curve["nicmm_curve"]["control_positions"]).reshape(-1, 3)


@pytest.mark.slow
def test_edited_again_after_reopening(empty_scene, sphere, places, tmp_path):
    """The object keeps its points, settings, material and thickness."""
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
    opened = module(empty_scene, "outputs.edited_curve").open_curve(bpy.context, curve)
    assert not opened.settings.closed and opened.settings.smoothness == 2.0
    np.testing.assert_allclose(opened.positions(), places, atol=ROUNDING)
    np.testing.assert_allclose(opened.lines()[0], before, atol=ROUNDING)

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
    edit(points=as_points(on_surface(sphere, scenes.five_places())))
    np.testing.assert_allclose(
        controls(curve), on_surface(sphere, scenes.five_places()), atol=ROUNDING
    )


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
    """Like Blender, use the properties of the last call on the state before it."""
    bpy.ops.ed.undo_push(message="Before")
    bpy.ops.nicmm.edit_curve("EXEC_DEFAULT", True, points=as_points(places), closed=False)
    last = bpy.context.window_manager.operators
    if last:  # Blender keeps the list in a window only
        assert len(last[-1].points) == len(places)
    bpy.ops.ed.undo()
    assert not scenes.curves()


# The tool in the interface.


def test_the_tool_is_in_the_toolbar(empty_scene):
    from bl_ui.space_toolsystem_common import ToolSelectPanelHelper

    panel = ToolSelectPanelHelper._tool_class_from_space_type("VIEW_3D")
    for mode in ("OBJECT", "SCULPT", "PAINT_WEIGHT"):
        names = [tool.idname for tool in panel._tools_flatten(panel._tools[mode]) if tool]
        assert any(name.startswith("nicmm.surface_curve") for name in names), mode


def test_hints_have_icons_that_exist(empty_scene):
    icons = bpy.types.UILayout.bl_rna.functions["label"].parameters["icon"].enum_items.keys()
    for found, _ in module(empty_scene, "tool.toolbar").HINTS:
        assert set(found) <= set(icons)
