"""The list of curves on a mesh, *Update Curves* and *Live*."""

import time
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from tests.blender import scenes
from tests.blender.scenes import module

CONVERGED = 4e-3
"""Largest distance between two results of one request.

An update starts from the current curve and stops when another step gains little.
"""


@pytest.fixture
def sphere(empty_scene):
    return scenes.sphere()


VERTICES = (42, 120, 123, 128)
"""Vertices of the sphere on a loop around it."""


def draw(mesh_object, **settings):
    """A designed curve on the mesh; the mesh stays active."""
    scenes.activate(mesh_object)
    scenes.select(mesh_object, VERTICES)
    bpy.ops.nicmm.design_curve(**settings)
    curve = bpy.context.active_object
    scenes.activate(mesh_object)
    return curve


def places(curve):
    """Positions of the points of a curve or hair curves object, in its local space."""
    if curve.type == "CURVE":
        return scenes.points(curve)
    values = np.empty(3 * len(curve.data.points), dtype=np.float32)
    curve.data.points.foreach_get("position", values)
    return values.reshape(-1, 3)


def pull(mesh_object, share=0.2):
    """Deform the mesh unevenly, as in sculpting."""
    place = scenes.positions(mesh_object)
    place[:, 2] += share * place[:, 0] ** 2
    mesh_object.data.vertices.foreach_set("co", place.astype(np.float32).ravel())
    mesh_object.data.update()
    bpy.context.view_layer.update()


def distances_to_line(points, line):
    """Distance of each point from a polyline."""
    start, step = line[:-1], np.diff(line, axis=0)
    share = np.einsum("psd,sd->ps", points[:, None] - start, step) / (step**2).sum(axis=1)
    nearest = start + share.clip(0.0, 1.0)[..., None] * step
    return np.linalg.norm(points[:, None] - nearest, axis=2).min(axis=1)


def assert_same_curve(one, other):
    """Assert that the points of each polyline lie on the other polyline."""
    for points, line in ((one, other), (other, one)):
        assert distances_to_line(points, line).max() <= CONVERGED


@pytest.mark.slow
@pytest.mark.parametrize("output", ["CURVE", "STICKY"])
@pytest.mark.parametrize("closed", [True, False])
def test_update_is_designing_again(sphere, output, closed):
    curve = draw(sphere, output=output, closed=closed, smoothness=2.0)
    before = places(curve)
    assert bpy.ops.nicmm.update_curves() == {"FINISHED"}
    assert_same_curve(places(curve), before)
    pull(sphere)
    expected = draw(sphere, output=output, closed=closed, smoothness=2.0)
    assert bpy.ops.nicmm.update_curves(curve=curve.name) == {"FINISHED"}
    assert_same_curve(places(curve), places(expected))
    assert abs(places(curve)[:, 2].max() - before[:, 2].max()) > 0.05


def test_update_keeps_the_object(sphere):
    curve = draw(sphere, thickness=0.02)
    curve.name = "Kante ñ 縁"
    material = bpy.data.materials.new("Red")
    curve.data.materials.append(material)
    curve.modifiers.new("Smooth", "SMOOTH")
    bevel = curve.data.bevel_depth
    pull(sphere)
    bpy.ops.nicmm.update_curves()
    assert bpy.data.objects["Kante ñ 縁"] == curve
    assert curve.data.bevel_depth == bevel
    assert list(curve.data.materials) == [material]
    assert [modifier.type for modifier in curve.modifiers] == ["SMOOTH"]
    assert bpy.context.active_object == sphere


def test_update_in_edit_mode_takes_what_is_being_edited(sphere):
    curve = draw(sphere)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.transform.resize(value=(2, 2, 2))
    bpy.ops.nicmm.update_curves()
    assert np.linalg.norm(places(curve), axis=1).min() > 1.9
    assert bpy.context.mode == "EDIT_MESH"


@pytest.mark.slow
def test_settings_of_the_panel(sphere):
    curve = draw(sphere)
    bpy.context.scene.nicmm_curves.closed = False
    bpy.ops.nicmm.update_curves(use_panel=True)
    assert not curve.data.splines[0].use_cyclic_u
    bpy.context.scene.nicmm_curves.closed = True
    bpy.ops.nicmm.update_curves()
    assert not curve.data.splines[0].use_cyclic_u


@pytest.mark.slow
def test_vertices_that_are_new_do_not_matter(sphere, capfd):
    curve = draw(sphere)
    controls = scenes.positions(sphere)[list(VERTICES)]
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.subdivide()
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.ops.nicmm.update_curves()
    assert scenes.distances_to(controls, places(curve)).max() < 1e-5
    assert "moved to the nearest positions" in capfd.readouterr().out


@pytest.mark.slow
def test_one_of_several_fails(sphere, capfd):
    good = draw(sphere)
    group = sphere.vertex_groups.new(name="Wall")
    bad = draw(sphere, obstacle_group="Wall")
    sphere.vertex_groups.remove(group)
    with pytest.raises(RuntimeError, match='no vertex group "Wall"'):
        bpy.ops.nicmm.update_curves(curve=bad.name)
    pull(sphere)
    before = places(good), places(bad)
    assert bpy.ops.nicmm.update_curves() == {"FINISHED"}
    assert np.abs(places(good).max(axis=0) - before[0].max(axis=0)).max() > 0.01
    np.testing.assert_array_equal(places(bad), before[1])
    printed = capfd.readouterr().out
    assert "1 of 2 curves updated" in printed and 'no vertex group "Wall"' in printed


@pytest.mark.slow
def test_unreachable_ones_leave_the_others(sphere, capfd):
    good = draw(sphere)
    everywhere = sphere.vertex_groups.new(name="Wall")
    bad = draw(sphere, obstacle_group="Wall")
    everywhere.add(range(len(sphere.data.vertices)), 1.0, "REPLACE")
    before = places(good), places(bad)
    pull(sphere)
    bpy.ops.nicmm.update_curves()
    assert np.abs(places(good).max(axis=0) - before[0].max(axis=0)).max() > 0.01
    np.testing.assert_array_equal(places(bad), before[1])
    assert 'the vertex group "Wall"' in capfd.readouterr().out


def test_update_says_what_is_missing(sphere):
    def refusal(**arguments):
        with pytest.raises(RuntimeError) as caught:
            bpy.ops.nicmm.update_curves(**arguments)
        return str(caught.value)

    assert f'No curve was designed on "{sphere.name}"' in refusal()
    assert 'no designed curve "Nothing"' in refusal(curve="Nothing")
    curve = draw(sphere)
    scenes.activate(curve)
    bpy.ops.object.mode_set(mode="EDIT")
    assert "is being edited" in refusal()
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.data.objects.remove(sphere)
    scenes.sphere()
    assert "is not in this scene" in refusal(curve=curve.name)


@pytest.mark.slow
def test_update_is_one_undo_step(sphere):
    curve = draw(sphere)
    name, before = curve.name, places(curve)
    pull(sphere)
    bpy.ops.ed.undo_push(message="Pull")
    bpy.ops.nicmm.update_curves("EXEC_DEFAULT", True)
    assert np.abs(places(bpy.data.objects[name]) - before[:1]).max() > 0.1
    bpy.ops.ed.undo()
    np.testing.assert_array_equal(places(bpy.data.objects[name]), before)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["CURVE", "STICKY"])
def test_update_in_edit_mode_is_one_undo_step(sphere, kind):
    curve = draw(sphere, output=kind)
    name, before = curve.name, places(curve)
    pull(sphere)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.ed.undo_push(message="Edit Mode")
    bpy.ops.nicmm.update_curves("EXEC_DEFAULT", True)
    assert np.abs(places(bpy.data.objects[name]) - before[:1]).max() > 0.1
    bpy.ops.ed.undo()
    np.testing.assert_array_equal(places(bpy.data.objects[name]), before)


def test_update_passes_over_unfinished_drawings(sphere, capfd):
    curve = draw(sphere)
    bpy.ops.nicmm.add_point(position=(1.0, 0.0, 0.0))
    drawing = bpy.context.active_object
    assert drawing != curve
    scenes.activate(sphere)
    assert bpy.ops.nicmm.update_curves() == {"FINISHED"}
    assert "1 of 1 curve updated" in capfd.readouterr().out
    with pytest.raises(RuntimeError, match="1 control point and no curve"):
        bpy.ops.nicmm.update_curves(curve=drawing.name)


def test_inverting_the_filter_of_the_list_shows_other_curves_only(empty_scene, sphere):
    curves = [draw(sphere), draw(sphere)]
    curves[0].name = "Collar"
    view = module(empty_scene, "interface.curve_list").NICMM_UL_curves

    def shown(**filters):
        state = SimpleNamespace(
            bitflag_filter_item=1, filter_name="coll", use_filter_sort_alpha=False, **filters
        )
        flags, _ = view.filter_items(state, bpy.context, bpy.data, "objects")
        return [
            found
            for found, flag in zip(bpy.data.objects, flags, strict=True)
            if bool(flag) != state.use_filter_invert  # as Blender does afterwards
        ]

    assert shown(use_filter_invert=False) == [curves[0]]
    assert shown(use_filter_invert=True) == [curves[1]]


@pytest.mark.slow
def test_list_shows_the_curves_of_the_mesh(empty_scene, sphere):
    mine = [draw(sphere), draw(sphere, output="STICKY")]
    other = scenes.sphere()
    draw(other)
    record = module(empty_scene, "scene.curve_record")
    assert record.designed_on(sphere) == sorted(mine, key=lambda found: found.name)
    scenes.activate(mine[1])
    assert record.mesh_of_context(bpy.context) == sphere
    objects = bpy.data.objects
    assert objects[bpy.context.window_manager.nicmm_active_curve] == mine[1]
    bpy.context.window_manager.nicmm_active_curve = objects.find(mine[0].name)
    assert bpy.context.active_object == mine[0]
    assert bpy.context.selected_objects == [mine[0]]


# Live update. Timers do not run in tests, so the tests call the timer function.


@pytest.fixture
def live(empty_scene, sphere):
    bpy.context.scene.nicmm_live_update = True
    return module(empty_scene, "operators.live_update")


def run_timer(live):
    """Call the timer function until no work is left; return the number of calls."""
    bpy.context.view_layer.update()
    ticks = 0
    while bpy.app.timers.is_registered(live.tick):
        bpy.app.timers.unregister(live.tick)
        while (pause := live.tick()) is not None:
            ticks += 1
            time.sleep(pause)
    return ticks


def test_live_update_is_off_at_first(empty_scene, sphere):
    live = module(empty_scene, "operators.live_update")
    curve = draw(sphere)
    before = places(curve)
    pull(sphere)
    assert run_timer(live) == 0
    np.testing.assert_array_equal(places(curve), before)


@pytest.mark.slow
@pytest.mark.parametrize("output", ["CURVE", "STICKY"])
def test_live_update_follows_the_mesh(live, sphere, output):
    curve = draw(sphere, output=output)
    run_timer(live)
    pull(sphere)
    assert run_timer(live) > 0
    expected = draw(sphere)
    assert_same_curve(places(curve), places(expected))


@pytest.mark.slow
def test_live_update_keeps_what_the_user_changes_meanwhile(live, sphere):
    """An answer to a request from before the change is not written."""
    curve = draw(sphere)
    run_timer(live)
    pull(sphere)
    bpy.context.view_layer.update()
    bpy.app.timers.unregister(live.tick)
    while (pause := live.tick(0.0)) != live.PAUSE:  # the work takes several time slices
        time.sleep(pause)
    scenes.activate(curve)
    bpy.ops.nicmm.remove_point(index=0)
    record = curve[live.curve_record.RECORD_KEY]
    assert len(record["control_corners"]) == 3 * 3  # three points
    while (pause := live.tick(0.0)) is not None:
        time.sleep(pause)
    record = curve[live.curve_record.RECORD_KEY]
    assert len(record["control_corners"]) == 3 * 3


@pytest.mark.slow
def test_list_follows_the_active_curve_in_sculpt_mode(empty_scene, sphere):
    curves = [draw(sphere), draw(sphere)]
    manager, objects = bpy.context.window_manager, bpy.data.objects
    scenes.activate(sphere)
    assert manager.nicmm_active_curve == -1
    bpy.ops.object.mode_set(mode="SCULPT")
    for curve in curves:
        manager.nicmm_active_curve = objects.find(curve.name)
        assert bpy.context.active_object == sphere
        assert objects[manager.nicmm_active_curve] == curve
    bpy.ops.object.mode_set(mode="OBJECT")


@pytest.mark.slow
def test_live_update_follows_the_scale_of_the_object(live, sphere):
    curve = draw(sphere)
    run_timer(live)
    sphere.scale = (1.0, 1.0, 3.0)
    assert run_timer(live) > 0
    assert_same_curve(places(curve), places(draw(sphere)))
    sphere.location.x = 2.0
    before = places(curve)
    run_timer(live)
    np.testing.assert_array_equal(places(curve), before)


@pytest.mark.slow
def test_live_update_follows_weights_and_edit_mode(live, sphere):
    walls = sphere.vertex_groups.new(name="Walls")
    curve = draw(sphere, obstacle_group="Walls")
    run_timer(live)
    before = places(curve)
    near = np.linalg.norm(scenes.positions(sphere) - before[len(before) // 8], axis=1) < 0.3
    walls.add(np.flatnonzero(near).tolist(), 1.0, "REPLACE")
    sphere.data.update_tag()
    run_timer(live)
    assert scenes.distances_to(before, places(curve)).max() > 0.02
    bpy.ops.object.mode_set(mode="EDIT")
    run_timer(live)
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.transform.translate(value=(0, 0, 1))
    run_timer(live)
    assert places(curve)[:, 2].min() > 0.5


def paint_near(mesh_object, group, place, radius=0.25):
    """Paint weights around a place, full in its middle."""
    away = np.linalg.norm(scenes.positions(mesh_object) - place, axis=1)
    for vertex in np.flatnonzero(away < radius).tolist():
        group.add([vertex], 1.0 - away[vertex] / radius, "REPLACE")
    mesh_object.data.update_tag()


@pytest.mark.slow
def test_painting_moves_only_the_curve_nearby(live, sphere):
    """Each dab is painted beside the curve as it is then; the rest of the curve stays."""
    group = sphere.vertex_groups.new(name="Along")
    curve = draw(sphere, alignment_group="Along")
    for number in (0.15, 0.65):
        run_timer(live)
        before = places(curve)
        place = before[int(number * len(before))] + [0.0, 0.0, 0.15]
        paint_near(sphere, group, place)
        run_timer(live)
        moved = distances_to_line(before, places(curve))
        far = np.linalg.norm(before - place, axis=1) > 1.2
        assert moved[far].max() < 1e-4 < 1e-2 < moved[~far].max()


@pytest.mark.slow
def test_live_update_does_not_feed_itself(live, sphere, empty_scene):
    curve = draw(sphere)
    run_timer(live)
    pull(sphere)
    run_timer(live)
    bpy.context.view_layer.update()
    changed = []

    def note(_scene, depsgraph):
        changed.extend(update.id.original for update in depsgraph.updates)

    bpy.app.handlers.depsgraph_update_post.append(note)
    try:
        for _ in range(3):
            bpy.context.view_layer.update()
            run_timer(live)
        sphere.data.update_tag()  # tagged as changed without a change
        run_timer(live)
        bpy.context.view_layer.update()
    finally:
        bpy.app.handlers.depsgraph_update_post.remove(note)
    assert sphere in changed
    assert curve not in changed and curve.data not in changed


@pytest.mark.slow
def test_live_update_survives_undo(live, sphere):
    name, mesh_name = draw(sphere).name, sphere.name
    bpy.ops.ed.undo_push(message="Curve")
    run_timer(live)
    pull(sphere)
    bpy.ops.ed.undo_push(message="Pull")
    run_timer(live)
    pulled = places(bpy.data.objects[name])
    bpy.ops.ed.undo()
    run_timer(live)
    sphere = bpy.data.objects[mesh_name]
    expected = places(draw(sphere))
    assert_same_curve(places(bpy.data.objects[name]), expected)
    assert np.abs(pulled.max(axis=0) - expected.max(axis=0)).max() > 0.01


@pytest.mark.slow
def test_change_during_work_starts_it_again(live, sphere):
    curve = draw(sphere)
    run_timer(live)
    pull(sphere)
    bpy.context.view_layer.update()
    time.sleep(0.35)
    live.tick()
    pull(sphere, share=0.3)
    run_timer(live)
    expected = draw(sphere)
    assert_same_curve(places(curve), places(expected))


@pytest.mark.slow
def test_what_cannot_be_updated_is_said_once(live, sphere):
    wall = sphere.vertex_groups.new(name="Wall")
    curve = draw(sphere, obstacle_group="Wall")
    run_timer(live)
    before = places(curve)
    wall.add(range(len(sphere.data.vertices)), 1.0, "REPLACE")
    sphere.data.update_tag()
    run_timer(live)
    (message,) = live.messages(sphere)
    assert message.startswith(curve.name) and '"Wall"' in message
    np.testing.assert_array_equal(places(curve), before)
    wall.remove(range(len(sphere.data.vertices)))
    sphere.data.update_tag()
    run_timer(live)
    assert not live.messages(sphere)


@pytest.mark.slow
def test_live_update_in_a_reopened_file(live, sphere, tmp_path):
    name = draw(sphere).name
    run_timer(live)
    before = places(bpy.data.objects[name])
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "live.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "live.blend"))
    assert bpy.context.scene.nicmm_live_update
    run_timer(live)
    np.testing.assert_array_equal(places(bpy.data.objects[name]), before)
    pull(bpy.data.objects["Icosphere"])
    run_timer(live)
    assert np.abs(places(bpy.data.objects[name])[:, 2].max() - before[:, 2].max()) > 0.05
