"""The operator in the installed extension, compared with the core."""

import re
import sys
from importlib import import_module
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from tests.blender import scenes

# Blender stores positions in single precision.
ROUNDING = 1e-6


def design(core, mesh_object, vertices, scale=(1.0, 1.0, 1.0), **arguments):
    mesh = core.Mesh(scenes.positions(mesh_object) * scale, scenes.triangles(mesh_object))
    return scenes.design(core, mesh, vertices, **arguments)


def reported_error(**arguments):
    """Run the operator, which must fail and leave the file unchanged; return its report."""
    before = [(found.name, found.select_get()) for found in bpy.data.objects]
    active = bpy.context.active_object
    with pytest.raises(RuntimeError) as caught:
        bpy.ops.nicmm.design_curve(spline="EXACT", **arguments)
    assert [(found.name, found.select_get()) for found in bpy.data.objects] == before
    assert bpy.context.active_object == active
    assert not bpy.data.curves
    return str(caught.value)


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["OBJECT", "EDIT"])
def test_equals_the_core(empty_scene, mode):
    sphere = scenes.sphere()
    vertices = scenes.ring(sphere, 5, height=0.4)
    scenes.select(sphere, vertices)
    expected = design(empty_scene.core, sphere, vertices)
    bpy.ops.object.mode_set(mode=mode)

    assert bpy.ops.nicmm.design_curve(spline="EXACT") == {"FINISHED"}

    (curve,) = scenes.curves()
    (spline,) = curve.data.splines
    assert spline.type == "POLY"
    assert spline.use_cyclic_u
    np.testing.assert_allclose(scenes.points(curve), expected.curves[0].points, atol=ROUNDING)


@pytest.mark.slow
def test_alternatives_become_curves_of_their_own(empty_scene):
    bpy.ops.mesh.primitive_torus_add(major_segments=48, minor_segments=24)
    torus = bpy.context.active_object
    vertices = [0, 400, 801]
    scenes.select(torus, vertices)
    expected = design(empty_scene.core, torus, vertices, alternatives=2)
    assert expected.alternatives
    assert bpy.ops.nicmm.design_curve(spline="EXACT", alternatives=2) == {"FINISHED"}
    made = scenes.curves()
    every = [expected, *expected.alternatives]
    assert len(made) == len(every)
    found = {len(scenes.points(curve)): scenes.points(curve) for curve in made}
    for each in every:
        points = each.curves[0].points
        np.testing.assert_allclose(found[len(points)], points, atol=ROUNDING)
    active = bpy.context.active_object
    np.testing.assert_allclose(scenes.points(active), expected.curves[0].points, atol=ROUNDING)
    assert [found for found in bpy.data.objects if found.select_get()] == [active]


def test_alternatives_of_outputs_that_change_the_mesh_are_refused(empty_scene):
    sphere = scenes.sphere()
    scenes.select(sphere, scenes.ring(sphere, 3, height=0.4))
    for output in ("EDGES", "REGION", "PARTS"):
        assert "Alternatives" in reported_error(alternatives=1, output=output)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("settings", "arguments"),
    [
        ({"order": "SHORTEST"}, {"order": "shortest"}),
        ({"order": "GIVEN"}, {"order": "given"}),
        ({"smoothness": 3.0}, {"smoothness": 3.0}),
        pytest.param({"method": "NICMM"}, {"method": "nicmm"}, marks=pytest.mark.slow),
        pytest.param({"method": "VARIATIONAL"}, {"method": "variational"}, marks=pytest.mark.slow),
    ],
)
def test_settings_reach_the_core(empty_scene, settings, arguments):
    sphere = scenes.sphere()
    vertices = scenes.ring(sphere, 4, height=0.3)
    scenes.select(sphere, vertices)
    expected = design(empty_scene.core, sphere, vertices, **arguments)

    bpy.ops.nicmm.design_curve(spline="EXACT", **settings)

    (curve,) = scenes.curves()
    np.testing.assert_allclose(scenes.points(curve), expected.curves[0].points, atol=ROUNDING)


@pytest.mark.slow
def test_vertex_groups_are_maps(empty_scene):
    sphere = scenes.sphere()
    vertices = scenes.ring(sphere, 4)
    scenes.select(sphere, vertices)
    weights = {}
    for name, centre in (("Walls", (0.7, 0.7, 0.0)), ("Rails", (-0.6, -0.6, 0.5))):
        distance = np.linalg.norm(scenes.positions(sphere) - centre, axis=1)
        weights[name] = np.clip(1.2 - 4 * distance, 0, 1).astype(np.float32)
        group = sphere.vertex_groups.new(name=name)
        for vertex in np.flatnonzero(weights[name]):
            group.add([int(vertex)], float(weights[name][vertex]), "REPLACE")
    expected = design(
        empty_scene.core, sphere, vertices, obstacles=weights["Walls"], alignment=weights["Rails"]
    )
    plain = design(empty_scene.core, sphere, vertices)

    bpy.ops.nicmm.design_curve(spline="EXACT", obstacle_group="Walls", alignment_group="Rails")

    points = scenes.points(scenes.curves()[0])
    np.testing.assert_allclose(points, expected.curves[0].points, atol=ROUNDING)
    assert scenes.distances_to(points, plain.curves[0].points).max() > 0.01


def test_complete_history_gives_the_order(empty_scene):
    sphere = scenes.sphere()
    vertices = scenes.ring(sphere, 5)[::-1]
    scenes.select(sphere, vertices)
    bpy.ops.nicmm.design_curve(spline="EXACT")
    expected = design(empty_scene.core, sphere, vertices, order="given").curves[0]
    points = scenes.points(bpy.context.active_object)
    np.testing.assert_allclose(points, expected.points, atol=ROUNDING)
    np.testing.assert_allclose(
        points[expected.control_index], scenes.positions(sphere)[vertices], atol=ROUNDING
    )


@pytest.mark.slow
@pytest.mark.parametrize("remembered", [0, 3])
def test_incomplete_history_leaves_the_shortest_order(empty_scene, remembered):
    sphere = scenes.sphere()
    vertices = sorted(scenes.ring(sphere, 5))
    scenes.select(sphere, vertices, history=vertices[:remembered])
    bpy.ops.nicmm.design_curve(spline="EXACT")
    expected = design(empty_scene.core, sphere, vertices, order="shortest").curves[0]
    points = scenes.points(bpy.context.active_object)
    np.testing.assert_allclose(points, expected.points, atol=ROUNDING)


def test_order_as_selected_needs_the_history(empty_scene):
    sphere = scenes.sphere()
    vertices = scenes.ring(sphere, 4)
    scenes.select(sphere, vertices, history=vertices[:1])
    report = reported_error(order="GIVEN")
    assert "order of 1 of the 4 selected vertices" in report
    assert "Shift-click" in report


def test_report_says_which_order_was_used(empty_scene, capfd):
    sphere = scenes.sphere()
    for history, words in ((None, "in the order of selection"), ([], "in the shortest order")):
        bpy.context.view_layer.objects.active = sphere
        scenes.select(sphere, scenes.ring(sphere, 4), history)
        capfd.readouterr()
        bpy.ops.nicmm.design_curve(spline="EXACT")
        assert words in capfd.readouterr().out


def test_curve_object_belongs_to_the_mesh(empty_scene):
    collection = bpy.data.collections.new("Models")
    bpy.context.scene.collection.children.link(collection)
    sphere = scenes.sphere()
    for other in sphere.users_collection:
        other.objects.unlink(sphere)
    collection.objects.link(sphere)
    sphere.location = (3, 0, 1)
    sphere.rotation_euler = (0.3, 0.2, 1.0)
    scenes.select(sphere, scenes.ring(sphere, 3))

    bpy.ops.nicmm.design_curve(spline="EXACT", thickness=0.01)

    curve = bpy.context.active_object
    bpy.context.view_layer.update()
    assert curve.type == "CURVE"
    assert curve.name == f"{sphere.name} Curve"
    assert bpy.context.selected_objects == [curve]
    assert list(curve.users_collection) == [collection]
    assert curve.matrix_world == sphere.matrix_world
    assert curve.parent == sphere
    diagonal = np.linalg.norm(np.ptp(scenes.positions(sphere), axis=0))
    assert curve.data.bevel_depth == pytest.approx(0.01 * diagonal)


def test_runs_again_while_the_new_curve_is_active(empty_scene):
    """Blender's redo panel needs this."""
    sphere = scenes.sphere()
    scenes.select(sphere, scenes.ring(sphere, 3))
    bpy.ops.nicmm.design_curve(spline="EXACT")
    assert bpy.context.active_object.type == "CURVE"
    assert bpy.ops.nicmm.design_curve.poll()
    bpy.ops.nicmm.design_curve(spline="EXACT")
    assert [curve.parent for curve in scenes.curves()] == [sphere, sphere]


def test_edit_mode_stays(empty_scene):
    sphere = scenes.sphere()
    scenes.select(sphere, scenes.ring(sphere, 3))
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.nicmm.design_curve(spline="EXACT")
    assert bpy.context.mode == "EDIT_MESH"
    assert bpy.context.active_object == sphere
    assert scenes.curves()[0].select_get()


@pytest.mark.parametrize("mode", ["OBJECT", "EDIT"])
def test_undo_takes_the_curve_away(empty_scene, mode):
    sphere = scenes.sphere()
    scenes.select(sphere, scenes.ring(sphere, 3))
    bpy.ops.object.mode_set(mode=mode)
    bpy.ops.ed.undo_push(message="Mode")
    bpy.ops.nicmm.design_curve("EXEC_DEFAULT", True)
    assert len(scenes.curves()) == 1
    bpy.ops.ed.undo()
    assert not scenes.curves()
    bpy.ops.ed.redo()
    assert len(scenes.curves()) == 1


@pytest.mark.slow
def test_lengths_are_those_of_the_scaled_object(empty_scene):
    sphere = scenes.sphere()
    sphere.scale = (1, 1, 3)
    bpy.context.view_layer.update()
    vertices = scenes.ring(sphere, 4, height=0.5)
    scenes.select(sphere, vertices)
    expected = design(empty_scene.core, sphere, vertices, scale=(1, 1, 3))
    unscaled = design(empty_scene.core, sphere, vertices)

    bpy.ops.nicmm.design_curve(spline="EXACT")

    curve = bpy.context.active_object
    bpy.context.view_layer.update()
    world = scenes.points(curve) @ np.array(sphere.matrix_world.to_3x3()).T
    np.testing.assert_allclose(world, expected.curves[0].points, atol=1e-5)
    assert scenes.distances_to(scenes.points(curve), unscaled.curves[0].points).max() > 1e-3


def test_turning_the_object_does_not_change_the_curve(empty_scene):
    sphere = scenes.sphere()
    vertices = scenes.ring(sphere, 4, height=0.3)
    drawn = []
    for rotation in ((0, 0, 0), (0.4, 1.0, -0.2)):
        sphere.rotation_euler = rotation
        bpy.context.view_layer.update()
        bpy.context.view_layer.objects.active = sphere
        scenes.select(sphere, vertices)
        bpy.ops.nicmm.design_curve(spline="EXACT")
        drawn.append(scenes.points(bpy.context.active_object))
    np.testing.assert_array_equal(*drawn)


def test_quads_are_cut_into_triangles(empty_scene):
    bpy.ops.mesh.primitive_torus_add(major_segments=32, minor_segments=12)
    torus = bpy.context.active_object
    patch = scenes.nearest_vertices(torus, [(1.0, 0, 0.25), (1.1, 0.6, 0), (1.1, -0.6, 0)])
    scenes.select(torus, patch)
    assert bpy.ops.nicmm.design_curve(spline="EXACT") == {"FINISHED"}
    points = scenes.points(scenes.curves()[0])
    assert scenes.distances_to(scenes.positions(torus)[patch], points).max() < ROUNDING


@pytest.mark.slow
def test_unfinished_editing_is_used(empty_scene):
    sphere = scenes.sphere()
    vertices = scenes.ring(sphere, 4)
    scenes.select(sphere, vertices)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.transform.resize(value=(2, 2, 2))
    bpy.ops.mesh.select_all(action="DESELECT")
    bpy.ops.object.mode_set(mode="OBJECT")
    scenes.select(sphere, vertices)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.transform.translate(value=(0, 0, 0.1))  # not yet written to the mesh of Object Mode
    bpy.ops.nicmm.design_curve(spline="EXACT")
    bpy.ops.object.mode_set(mode="OBJECT")
    points = scenes.points(scenes.curves()[0])
    assert scenes.distances_to(scenes.positions(sphere)[vertices], points).max() < ROUNDING


def test_poll_gives_reasons(empty_scene):
    def refusal():
        with pytest.raises(RuntimeError) as caught:
            bpy.ops.nicmm.design_curve(spline="EXACT")
        return str(caught.value)

    assert "Make a mesh object active" in refusal()
    sphere = scenes.sphere()
    bpy.ops.object.mode_set(mode="SCULPT")
    assert "Switch to Object Mode or Edit Mode" in refusal()
    bpy.ops.object.mode_set(mode="OBJECT")
    scenes.select(sphere, [])
    bpy.ops.object.mode_set(mode="EDIT")
    assert "select the vertices" in refusal()


@pytest.mark.parametrize("field", ["obstacle_group", "alignment_group"])
def test_missing_group_is_named(empty_scene, field):
    sphere = scenes.sphere()
    scenes.select(sphere, scenes.ring(sphere, 4))
    assert 'no vertex group "Wall"' in (report := reported_error(**{field: "Wall"}))
    assert "Add the group" in report
    sphere.vertex_groups.new(name="Walls")
    assert 'Choose one of "Walls"' in reported_error(**{field: "Wall"})


@pytest.mark.slow
def test_repairs_are_reported_and_keep_the_curve(empty_scene, capfd):
    """Half of the faces are turned over."""
    sphere = scenes.sphere()
    vertices = scenes.ring(sphere, 4, height=0.3)
    expected = design(empty_scene.core, sphere, vertices)
    mesh = sphere.data
    for polygon in list(mesh.polygons)[::2]:
        polygon.flip()
    scenes.select(sphere, vertices)
    assert bpy.ops.nicmm.design_curve(spline="EXACT") == {"FINISHED"}
    assert re.search(r"repaired for the curve: faces turned \([\d,]+\)", capfd.readouterr().out)
    (curve,) = scenes.curves()
    found = scenes.points(curve)
    points = expected.curves[0].points
    nearest = np.linalg.norm(found[:, None] - points, axis=2).min(axis=1)
    assert nearest.max() < 1e-2


def test_errors_of_the_core_are_reports(empty_scene):
    core = empty_scene.core
    sphere = scenes.sphere()
    scenes.select(sphere, scenes.ring(sphere, 4)[:1])
    with pytest.raises(core.NicmmError, match="control_points has 1 point, too few; ") as too_few:
        design(core, sphere, scenes.ring(sphere, 4)[:1])
    assert str(too_few.value).replace("control_points has", "There is") in reported_error()


def test_separate_parts_are_reported(empty_scene):
    bpy.ops.mesh.primitive_ico_sphere_add(location=(4, 0, 0))
    sphere = scenes.sphere()
    bpy.ops.object.select_all(action="SELECT")
    bpy.ops.object.join()
    ends = scenes.nearest_vertices(sphere, [(0, 0, 1), (1, 0, 0), (4, 0, 1)])
    scenes.select(sphere, ends)
    with pytest.raises(empty_scene.core.UnreachableError):
        design(empty_scene.core, sphere, ends)
    report = reported_error(order="GIVEN")
    first, other = (f"oint {n + 1} (vertex {ends[n]})" for n in (0, 2))
    assert f"P{first} and p{other} lie on different components" in report


@pytest.mark.slow
def test_an_order_that_works_is_counted_from_one_like_the_points(empty_scene):
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=8, y_subdivisions=8)
    grid = bpy.context.active_object
    corners = scenes.nearest_vertices(grid, [(-1, -1, 0), (1, 1, 0), (1, -1, 0), (-1, 1, 0)])
    with pytest.raises(empty_scene.core.NicmmError) as impossible:
        design(empty_scene.core, grid, corners)
    (order,) = re.findall(r"in the order \[([\d, ]+)\]", str(impossible.value))
    named = ", ".join(str(int(each) + 1) for each in order.split(","))
    report = reported_error(points=", ".join(map(str, corners)), order="GIVEN")
    assert f"visit the points in the order {named}, which works" in report


@pytest.mark.parametrize("count, text", [(0, "0 faces"), (1, "1 face"), (2, "2 faces")])
def test_things_are_counted(empty_scene, count, text):
    messages = import_module(f"{empty_scene.name}.nicmm_blender.scene.messages")
    assert messages.counted(count, "face") == text


@pytest.mark.slow
def test_open_curve_is_not_cyclic(empty_scene):
    """It runs from the first selected vertex to the last; two vertices are enough."""
    sphere = scenes.sphere()
    for count in (2, 4):
        vertices = scenes.ring(sphere, 4)[:count]
        scenes.select(sphere, vertices)
        expected = design(empty_scene.core, sphere, vertices, closed=False)

        bpy.ops.nicmm.design_curve(spline="EXACT", closed=False)

        curve = bpy.context.active_object
        assert not curve.data.splines[0].use_cyclic_u
        points = scenes.points(curve)
        np.testing.assert_allclose(points, expected.curves[0].points, atol=ROUNDING)
        ends = scenes.positions(sphere)[[vertices[0], vertices[-1]]]
        np.testing.assert_allclose(points[[0, -1]], ends, atol=ROUNDING)


def test_missing_library_is_reported(empty_scene, monkeypatch):
    scenes.module(empty_scene, "scene.surface_cache").forget()
    sphere = scenes.sphere()
    scenes.select(sphere, scenes.ring(sphere, 4))
    # Simulate a new session, in which the core has not been loaded yet.
    for name in list(sys.modules):
        if name.startswith(f"{empty_scene.name}.nicmm_core"):
            monkeypatch.delitem(sys.modules, name)
    monkeypatch.delattr(empty_scene.module, "nicmm_core")
    monkeypatch.setitem(sys.modules, "igl", None)
    report = reported_error()
    assert "igl" in report
    assert "Install the zip" in report


def test_the_same_mesh_is_factorised_once(empty_scene):
    surface_cache = scenes.module(empty_scene, "scene.surface_cache")
    read = scenes.module(empty_scene, "scene.surface").read
    name = scenes.sphere().name
    bpy.ops.ed.undo_push(message="Add")
    designers = []
    for smoothness in (1.0, 2.0):
        sphere = bpy.data.objects[name]
        bpy.context.view_layer.objects.active = sphere
        scenes.select(sphere, scenes.ring(sphere, 4))
        bpy.ops.nicmm.design_curve(spline="EXACT", smoothness=smoothness)
        with surface_cache.designer_of(read(sphere, True)) as designer:
            designers.append(designer)
        bpy.ops.ed.undo()  # as the redo panel does
    assert designers[0] is designers[1]


@pytest.mark.slow
def test_modifiers_are_mentioned(empty_scene, capfd):
    sphere = scenes.sphere()
    scenes.select(sphere, scenes.ring(sphere, 4))
    sphere.modifiers.new("Subdivision", "SUBSURF")
    bpy.ops.nicmm.design_curve(spline="EXACT", use_modifiers=False)
    assert "without its modifiers" in capfd.readouterr().out


def test_two_points_of_a_closed_curve_name_the_way_out(empty_scene):
    sphere = scenes.sphere()
    scenes.select(sphere, scenes.ring(sphere, 4)[:2])
    assert "Turn Closed off for an open curve" in reported_error()


def test_selections_on_other_meshes_are_mentioned(empty_scene, capfd):
    other = scenes.sphere()
    other.name = "Other"
    scenes.select(other, scenes.ring(other, 4))
    sphere = scenes.sphere()
    scenes.select(sphere, scenes.ring(sphere, 4))
    other.select_set(True)
    bpy.ops.object.mode_set(mode="EDIT")
    assert bpy.ops.nicmm.design_curve() == {"FINISHED"}
    assert 'The vertices selected on "Other" are ignored' in capfd.readouterr().out
    bpy.ops.object.mode_set(mode="OBJECT")


@pytest.mark.slow
def test_alternatives_have_no_effect_with_other_methods(empty_scene):
    sphere = scenes.sphere()
    scenes.select(sphere, scenes.ring(sphere, 4))
    settings = {"method": "VARIATIONAL", "alternatives": 2}
    assert bpy.ops.nicmm.design_curve(**settings) == {"FINISHED"}
    assert len(scenes.curves()) == 1


def test_a_call_from_a_menu_takes_the_settings_of_the_sidebar(empty_scene):
    """In the window, menus pass no settings; the last ones must not count."""
    settings = import_module(f"{empty_scene.name}.nicmm_blender.settings")
    panel = bpy.context.scene.nicmm_curves
    panel.smoothness, panel.closed = 3.0, False
    given = {"closed"}
    operator = SimpleNamespace(
        properties=SimpleNamespace(is_property_set=lambda name: name in given),
        smoothness=1.0,
        closed=True,
    )
    settings.take_from_sidebar(operator, panel)
    assert operator.smoothness == 3.0 and operator.closed
    assert operator.output == panel.output


def test_the_option_to_replace_settings_is_not_remembered(extension):
    assert bpy.ops.nicmm.update_curves.get_rna_type().properties["use_panel"].is_skip_save


def test_the_redo_panel_stays_after_a_conversion_of_the_mesh(empty_scene):
    """Blender shows it only while the operator could run again."""
    sphere = scenes.sphere()
    scenes.select(sphere, scenes.ring(sphere, 4))
    bpy.ops.nicmm.design_curve()
    assert bpy.ops.nicmm.convert_curve(output="EDGES") == {"FINISHED"}
    assert bpy.context.active_object == sphere
    assert bpy.ops.nicmm.convert_curve.poll()
    with pytest.raises(RuntimeError, match="Make a designed curve active"):
        bpy.ops.nicmm.convert_curve(output="EDGES")
