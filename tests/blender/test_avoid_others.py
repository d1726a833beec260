"""Curves that avoid those above them in the list: distance, order, following, messages.

Junctions are tested in test_junctions.py.
"""

from importlib import import_module

import bpy
import numpy as np
import pytest
from scipy.spatial import cKDTree

import nicmm_core as nicmm
from tests.blender import scenes
from tests.blender.scenes import module
from tests.blender.test_curve_list import run_timer
from tests.blender.test_point_operators import call, controls, refusal
from tests.blender.test_time_slices import Window, no_patience
from tests.oracles.curve_pairs import contacts

pytestmark = [pytest.mark.usefixtures("remembered_designs")]

__all__ = ["no_patience"]  # a fixture

CLEARANCE = 0.1
LEAST = 0.975
"""Least distance in space from an avoided curve, in clearances; along the sphere it is greater."""


@pytest.fixture
def sphere(empty_scene):
    made = scenes.sphere(4)
    bpy.ops.ed.undo_push(message="Sphere")
    return made


def ring(degrees, heights):
    """Positions on the unit sphere by their longitudes and heights, (k, 3)."""
    angles, heights = np.radians(degrees), np.asarray(heights, dtype=np.float64)
    radii = np.sqrt(1.0 - heights**2)
    return np.stack([radii * np.cos(angles), radii * np.sin(angles), heights], axis=1)


def around(height, count=4):
    """Positions around the unit sphere at a height, (count, 3)."""
    return ring(360.0 / count * np.arange(count), [height] * count)


TILTED = ring([0.0, 90.0, 270.0], [0.5, 0.2, 0.2])
"""Free, a curve through these points passes below the equator at a longitude of 180 degrees."""


def on(mesh_object, places):
    """The nearest positions on a mesh."""
    return [list(mesh_object.closest_point_on_mesh(place)[1]) for place in places]


def draw(mesh_object, places, name, **settings):
    """A designed curve through positions, which becomes the active object."""
    scenes.activate(mesh_object)
    points = [{"name": "", "position": place} for place in on(mesh_object, places)]
    assert bpy.ops.nicmm.edit_curve("EXEC_DEFAULT", True, points=points, **settings) == {"FINISHED"}
    made = bpy.context.active_object
    made.name = name
    bpy.ops.ed.undo_push(message="Name")
    return made


def curve_of(extension, name):
    """The recorded curve, as a curve of the core."""
    record, designed = module(extension, "scene.curve_record"), bpy.data.objects[name]
    use_modifiers = record.settings_of(designed).use_modifiers
    surface = module(extension, "scene.surface").read(record.mesh_of(designed), use_modifiers)
    (found,) = record.read_curves(designed, surface)
    return found


def points_of(extension, name):
    return curve_of(extension, name).points


def mesh_of(mesh_object):
    return nicmm.Mesh(scenes.positions(mesh_object), scenes.triangles(mesh_object))


def assert_apart(extension, mesh_object, names, clearance=CLEARANCE):
    """Assert that no two curves meet, and that each keeps the clearance from those before it."""
    mesh = mesh_of(mesh_object)
    curves = [curve_of(extension, name) for name in names]
    for number, curve in enumerate(curves):
        for other in curves[:number]:
            assert not contacts(mesh, curve, other)
            assert distance(curve, other) >= LEAST * clearance


def distance(one, other):
    """Least distance in space between two curves."""
    tree = cKDTree(sampled(one))
    return tree.query(sampled(other))[0].min()


def sampled(curve, count=8):
    """Points of a curve, evenly spaced on each of its segments."""
    shares = np.linspace(0.0, 1.0, count)[:, None, None]
    start = curve.points[: len(curve.steps)]
    return (start + shares * curve.steps).reshape(-1, 3)


def order(extension, mesh_object):
    return [each.name for each in module(extension, "scene.curve_record").designed_on(mesh_object)]


def is_current(extension, name):
    """Whether a curve was designed on the present surface with the present curves above it."""
    record, avoided = (
        module(extension, f"scene.{each}") for each in ("curve_record", "avoided_curves")
    )
    designed = bpy.data.objects[name]
    mesh_object, settings = record.mesh_of(designed), record.settings_of(designed)
    surface = module(extension, "scene.surface").read(mesh_object, settings.use_modifiers)
    others = avoided.above(designed, mesh_object, surface, settings)
    now = record.digest(mesh_object, surface, settings, others)
    return record.is_current(designed, now)


@pytest.fixture
def pair(empty_scene, sphere):
    """Two curves around the sphere; free, the second would cross the first."""
    draw(sphere, around(0.0), "First")
    draw(sphere, TILTED, "Second", avoid_others=True, clearance=CLEARANCE)
    return sphere


def raise_first(mesh_object, height=0.06, number=2):
    """Move a point of the first curve, at a longitude of 180 degrees, towards the second."""
    place = on(mesh_object, around(height))[number]
    call("move_point", curve="First", index=number, position=place)


def test_two_curves_keep_the_clearance(empty_scene, pair):
    assert_apart(empty_scene, pair, ["First", "Second"])
    draw(pair, TILTED, "Free")
    assert contacts(mesh_of(pair), *(curve_of(empty_scene, each) for each in ("Free", "First")))


@pytest.mark.slow
def test_five_curves_keep_the_clearance(empty_scene, sphere):
    names = ["A", "B", "C", "D", "E"]
    tilts = (0.0, 0.3, -0.3, 0.3, -0.3)
    for name, height, tilt in zip(names, (0.0, 0.2, -0.2, 0.4, -0.4), tilts, strict=True):
        places = ring([0.0, 90.0, 270.0], [height + tilt, height, height])
        draw(sphere, places, name, avoid_others=True, clearance=CLEARANCE)
    assert order(empty_scene, sphere) == names
    assert_apart(empty_scene, sphere, names)
    call("move_point", curve="A", index=0, position=on(sphere, around(0.05, 4))[0])
    assert_apart(empty_scene, sphere, names)
    assert all(is_current(empty_scene, name) for name in names)


def test_without_clearance_they_only_do_not_cross(empty_scene, sphere):
    draw(sphere, around(0.0), "First")
    places = np.array([*around(0.04, 8)[[0, 2, 4]], *around(0.5, 8)[[6]]])
    draw(sphere, places, "Second", avoid_others=True)
    assert_apart(empty_scene, sphere, ["First", "Second"], 0.0)


def test_the_clearance_is_in_scene_units(empty_scene, sphere):
    sphere.scale = (2.0, 2.0, 2.0)
    bpy.context.view_layer.update()
    draw(sphere, around(0.0), "First")
    draw(sphere, TILTED, "Second", avoid_others=True, clearance=2.0 * CLEARANCE)
    assert_apart(empty_scene, sphere, ["First", "Second"])


def test_only_those_above_are_avoided(empty_scene, pair):
    """The first one avoids others too, but has none above it."""
    before = points_of(empty_scene, "First")
    bpy.data.objects["First"].nicmm_settings.avoid_others = True
    bpy.data.objects["First"].nicmm_settings.clearance = 0.3
    np.testing.assert_allclose(points_of(empty_scene, "First").mean(0), before.mean(0), atol=1e-3)


class TestOrder:
    @pytest.mark.slow
    def test_new_curves_come_last(self, empty_scene, sphere):
        for name, height in (("Zebra", 0.0), ("Ant", 0.3), ("Mole", 0.6)):
            draw(sphere, around(height), name)
        assert order(empty_scene, sphere) == ["Zebra", "Ant", "Mole"]

    def test_moving_up_and_down(self, empty_scene, sphere):
        for name, height in (("A", 0.0), ("B", 0.3), ("C", 0.6)):
            draw(sphere, around(height), name)
        call("move_curve", curve="C", direction="UP")
        assert order(empty_scene, sphere) == ["A", "C", "B"]
        call("move_curve", curve="A", direction="DOWN")
        assert order(empty_scene, sphere) == ["C", "A", "B"]
        bpy.ops.ed.undo()
        assert order(empty_scene, bpy.data.objects[sphere.name]) == ["A", "C", "B"]
        bpy.ops.ed.undo()
        assert order(empty_scene, bpy.data.objects[sphere.name]) == ["A", "B", "C"]
        ends = (("A", "UP"), ("C", "DOWN"))
        for name, direction in ends:
            moved = bpy.ops.nicmm.move_curve(curve=name, direction=direction)
            assert moved == {"CANCELLED"}
        assert order(empty_scene, bpy.data.objects[sphere.name]) == ["A", "B", "C"]

    @pytest.mark.slow
    def test_curves_of_equal_rank_are_ordered_by_name(self, empty_scene, sphere):
        for name, height in (("New", 0.0), ("Old B", 0.3), ("Old A", 0.6)):
            draw(sphere, around(height), name)
        for name in ("Old A", "Old B"):
            bpy.data.objects[name]["nicmm_curve"]["rank"] = -1
        assert order(empty_scene, sphere) == ["Old A", "Old B", "New"]
        call("move_curve", curve="New", direction="UP")
        assert order(empty_scene, sphere) == ["Old A", "New", "Old B"]
        draw(sphere, around(-0.3), "Newest")
        assert order(empty_scene, sphere)[-1] == "Newest"

    def test_duplicates_are_told_apart(self, empty_scene, sphere):
        draw(sphere, around(0.0), "A")
        draw(sphere, around(0.3), "B")
        scenes.activate(bpy.data.objects["A"])
        bpy.ops.object.duplicate()
        assert order(empty_scene, sphere) == ["A", "A.001", "B"]
        call("move_curve", curve="A.001", direction="UP")
        assert order(empty_scene, sphere) == ["A.001", "A", "B"]
        call("move_curve", curve="A.001", direction="DOWN")
        call("move_curve", curve="A.001", direction="DOWN")
        assert order(empty_scene, sphere) == ["A", "B", "A.001"]

    def test_the_list_shows_the_order(self, empty_scene, sphere):
        from types import SimpleNamespace

        for name, height in (("Zebra", 0.0), ("Ant", 0.3), ("Mole", 0.6)):
            draw(sphere, around(height), name)
        view = module(empty_scene, "interface.curve_list").NICMM_UL_curves
        state = SimpleNamespace(
            bitflag_filter_item=1,
            filter_name="",
            use_filter_invert=False,
            use_filter_sort_alpha=False,
        )
        flags, places = view.filter_items(state, bpy.context, bpy.data, "objects")
        objects = list(bpy.data.objects)
        assert sorted(places) == list(range(len(objects)))
        shown = [
            found.name
            for _, found, flag in sorted(
                zip(places, objects, flags, strict=True), key=lambda row: row[0]
            )
            if flag
        ]
        assert shown == ["Zebra", "Ant", "Mole"]
        state.use_filter_sort_alpha = True
        assert view.filter_items(state, bpy.context, bpy.data, "objects")[1] == []

    @pytest.mark.slow
    def test_a_curve_keeps_its_place_when_edited_and_converted(self, empty_scene, sphere):
        for name, height in (("A", 0.0), ("B", 0.3), ("C", 0.6)):
            draw(sphere, around(height), name)
        call("move_point", curve="A", index=0, position=on(sphere, around(0.05))[0])
        assert order(empty_scene, sphere) == ["A", "B", "C"]
        scenes.activate(bpy.data.objects["B"])
        bpy.ops.nicmm.convert_curve(output="STICKY")
        assert order(empty_scene, sphere) == ["A", "B", "C"]
        assert bpy.data.objects["B"].type == "CURVES"

    @pytest.mark.slow
    def test_a_curve_moved_above_is_free_and_the_other_gives_way(self, empty_scene, sphere):
        both = {"avoid_others": True, "clearance": CLEARANCE}
        draw(sphere, ring([0.0, 90.0, 270.0], [0.0, 0.0, 0.0]), "First", **both)
        draw(sphere, TILTED, "Second", **both)
        before = {name: points_of(empty_scene, name) for name in ("First", "Second")}
        assert min(points[:, 2].min() for points in before.values()) > -0.01
        call("move_curve", curve="Second", direction="UP")
        assert_apart(empty_scene, sphere, ["Second", "First"])
        assert is_current(empty_scene, "First") and is_current(empty_scene, "Second")
        second, first = (points_of(empty_scene, name)[:, 2] for name in ("Second", "First"))
        assert second.min() < 0.0 and first.min() < second.min() - LEAST * CLEARANCE
        bpy.ops.ed.undo()
        for name in ("First", "Second"):
            np.testing.assert_array_equal(points_of(empty_scene, name), before[name])


class TestFollowing:
    def test_an_edit_takes_the_curves_below_along_in_one_undo_step(self, empty_scene, pair):
        before = {name: points_of(empty_scene, name) for name in ("First", "Second")}
        raise_first(pair)
        after = {name: points_of(empty_scene, name) for name in ("First", "Second")}
        assert len(after["Second"]) != len(before["Second"])
        assert_apart(empty_scene, pair, ["First", "Second"])
        assert is_current(empty_scene, "Second")
        bpy.ops.ed.undo()
        for name, points in before.items():
            np.testing.assert_array_equal(points_of(empty_scene, name), points)
        bpy.ops.ed.redo()
        for name, points in after.items():
            np.testing.assert_array_equal(points_of(empty_scene, name), points)

    def test_those_above_and_those_that_do_not_avoid_stay(self, empty_scene, pair):
        draw(pair, around(-0.4), "Third")
        before = {name: points_of(empty_scene, name) for name in ("First", "Third")}
        call("move_point", curve="Second", index=0, position=on(pair, around(0.3))[0])
        for name, points in before.items():
            np.testing.assert_array_equal(points_of(empty_scene, name), points)

    @pytest.mark.slow
    @pytest.mark.parametrize("mode", ["SCULPT", "WEIGHT_PAINT"])
    def test_in_other_modes(self, empty_scene, pair, mode):
        scenes.activate(pair)
        bpy.ops.object.mode_set(mode=mode)
        bpy.ops.ed.undo_push(message="Mode")
        before = points_of(empty_scene, "Second")
        raise_first(pair)
        assert_apart(empty_scene, pair, ["First", "Second"])
        bpy.ops.ed.undo()
        np.testing.assert_array_equal(points_of(empty_scene, "Second"), before)

    @pytest.mark.slow
    def test_a_changed_setting_takes_them_along(self, empty_scene, pair):
        before = points_of(empty_scene, "Second")
        bpy.data.objects["First"].nicmm_settings.smoothness = 0.1
        raise_first(pair, 0.05)
        assert is_current(empty_scene, "Second")
        bpy.data.objects["First"].nicmm_settings.closed = False
        assert is_current(empty_scene, "Second")
        assert len(points_of(empty_scene, "Second")) != len(before)
        assert_apart(empty_scene, pair, ["First", "Second"])

    @pytest.mark.slow
    def test_edit_curve_takes_them_along(self, empty_scene, pair):
        points = [{"name": "", "position": place} for place in on(pair, around(0.03))]
        bpy.ops.nicmm.edit_curve("EXEC_DEFAULT", True, curve="First", points=points)
        assert is_current(empty_scene, "Second")
        assert_apart(empty_scene, pair, ["First", "Second"])

    @pytest.mark.slow
    def test_another_course_takes_them_along(self, empty_scene, pair):
        scenes.activate(bpy.data.objects["First"])
        draw(pair, around(-0.5, 3), "Side", avoid_others=True)
        scenes.activate(bpy.data.objects["First"])
        bpy.ops.nicmm.next_course("EXEC_DEFAULT", True, course=2)
        report = is_current(empty_scene, "Second"), is_current(empty_scene, "Side")
        assert any(report)  # points of the other may be cut off by this course

    @pytest.mark.slow
    def test_a_curve_that_loses_its_points_is_avoided_no_more(self, empty_scene, pair):
        for _ in range(3):
            call("remove_point", curve="First", index=0)
        assert is_current(empty_scene, "Second")
        assert points_of(empty_scene, "Second")[:, 2].min() < 0.0

    def test_after_a_deletion_it_is_outdated_and_updated(self, empty_scene, pair):
        before = points_of(empty_scene, "Second")
        scenes.activate(bpy.data.objects["First"])
        bpy.ops.object.delete()
        assert not is_current(empty_scene, "Second")
        scenes.activate(pair)
        assert bpy.ops.nicmm.update_curves() == {"FINISHED"}
        assert is_current(empty_scene, "Second")
        assert len(points_of(empty_scene, "Second")) != len(before)

    @pytest.mark.slow
    def test_one_that_cannot_follow_keeps_its_shape_and_says_why(self, empty_scene, pair, capfd):
        before = points_of(empty_scene, "Second")
        raise_first(pair, 0.25, 1)  # beyond a point of the second curve
        out = capfd.readouterr().out
        assert '"Second" keeps its shape' in out and "in the list" in out, out
        assert "avoid[" not in out and "curve of avoid" not in out
        np.testing.assert_array_equal(points_of(empty_scene, "Second"), before)
        assert not is_current(empty_scene, "Second")
        raise_first(pair, 0.0, 1)
        assert is_current(empty_scene, "Second")

    @pytest.mark.slow
    def test_the_panel_says_why_one_cannot_follow_a_setting(self, empty_scene, pair):
        second = bpy.data.objects["Second"]
        scenes.activate(second)
        bpy.ops.object.mode_set(mode="EDIT")  # its points cannot be replaced
        settings = module(empty_scene, "operators.curve_settings")
        first = bpy.data.objects["First"]
        first.nicmm_settings.closed = False
        assert not first.nicmm_settings.closed
        assert '"Second" keeps its shape' in settings.problem_of(first)
        bpy.ops.object.mode_set(mode="OBJECT")
        first.nicmm_settings.closed = True
        assert not settings.problem_of(first)

    def test_edit_curve_designs_an_outdated_curve_again(self, empty_scene, pair):
        before = points_of(empty_scene, "Second")
        scenes.activate(bpy.data.objects["First"])
        bpy.ops.object.delete()
        scenes.activate(pair)
        bpy.ops.nicmm.edit_curve("EXEC_DEFAULT", True, curve="Second")
        assert is_current(empty_scene, "Second")
        assert points_of(empty_scene, "Second")[:, 2].min() < before[:, 2].min() - 0.05

    def test_an_update_of_one_takes_those_below_along(self, empty_scene, pair):
        pair.data.vertices[0].co *= 1.01
        pair.data.update()
        bpy.context.view_layer.update()
        bpy.ops.nicmm.update_curves("EXEC_DEFAULT", True, curve="First")
        assert is_current(empty_scene, "First") and is_current(empty_scene, "Second")

    @pytest.mark.slow
    def test_an_update_goes_in_the_order_of_the_list(self, empty_scene, sphere):
        """The second one is called before the first by name, and sees the new first one."""
        draw(sphere, around(0.0), "Zebra")
        draw(sphere, TILTED, "Ant", avoid_others=True, clearance=CLEARANCE)
        places = scenes.positions(sphere)
        places[:, 2] += 0.3 * places[:, 0] ** 2
        sphere.data.vertices.foreach_set("co", places.astype(np.float32).ravel())
        sphere.data.update()
        scenes.activate(sphere)
        assert bpy.ops.nicmm.update_curves() == {"FINISHED"}
        assert is_current(empty_scene, "Zebra") and is_current(empty_scene, "Ant")
        assert_apart(empty_scene, sphere, ["Zebra", "Ant"])

    @pytest.mark.slow
    def test_an_update_after_a_subdivision(self, empty_scene, pair):
        """No triangle of the former curves exists any more."""
        pair.modifiers.new("Subdivision", "SUBSURF").levels = 1
        scenes.activate(pair)
        assert bpy.ops.nicmm.update_curves() == {"FINISHED"}
        assert is_current(empty_scene, "First") and is_current(empty_scene, "Second")


class TestInTheWindow:
    """Long work continues in time slices: first the changed curve, then those that follow."""

    @pytest.fixture
    def moving(self, empty_scene, pair, no_patience, monkeypatch):
        """A window with an operator that moves a point of the first curve."""
        request = module(empty_scene, "scene.design_request")
        cancelled = import_module(f"{empty_scene.core.__name__}.design_result").cancelled_design
        plain = request.answer

        def answer(asked, progress):
            """Takes at least two time slices, also for a design that is remembered."""
            if progress(0.0, np.zeros((0, 3))) is False:
                return cancelled(0.0)
            return plain(asked, progress)

        monkeypatch.setattr(request, "answer", answer)
        changes = module(empty_scene, "tool.changes_points")
        edited_curve = module(empty_scene, "outputs.edited_curve")

        class Moving(changes.ChangesPoints):
            curve, index, from_mouse = "First", 2, False
            position = on(pair, around(0.06))[2]

            def changed(self, opened):
                place = self.place(opened)
                return edited_curve.with_point(opened.points, self.index, place, replaced=True)

        window = Window(Moving)
        for name in ("scene", "view_layer", "active_object", "selected_objects"):
            setattr(window.context, name, getattr(bpy.context, name))
        operator, context = window.operator, window.context
        assert operator.answer(context, operator.requests(context)) == {"RUNNING_MODAL"}
        return window

    @pytest.mark.slow
    def test_the_others_follow_in_time_slices(self, empty_scene, pair, moving):
        before = {name: points_of(empty_scene, name) for name in ("First", "Second")}
        assert moving.finish() == {"RUNNING_MODAL"}  # now the second curve
        assert len(moving.handlers) == len(moving.timers) == 1
        assert not np.array_equal(points_of(empty_scene, "First"), before["First"])
        np.testing.assert_array_equal(points_of(empty_scene, "Second"), before["Second"])
        assert moving.finish() == {"FINISHED"}
        assert is_current(empty_scene, "Second")
        assert_apart(empty_scene, pair, ["First", "Second"])
        assert not moving.timers and moving.texts[-1] is None
        assert not moving.reports and not vars(moving.operator)

    def test_escape_changes_nothing_at_first(self, empty_scene, moving):
        before = {name: points_of(empty_scene, name) for name in ("First", "Second")}
        assert moving.send("ESC", "PRESS") == {"CANCELLED"}
        for name, points in before.items():
            np.testing.assert_array_equal(points_of(empty_scene, name), points)

    @pytest.mark.slow
    def test_escape_leaves_what_has_not_followed(self, empty_scene, pair, moving):
        """The operator ends with an undo step, since the first curve has changed."""
        before = {name: points_of(empty_scene, name) for name in ("First", "Second")}
        assert moving.finish() == {"RUNNING_MODAL"}
        assert moving.send("ESC", "PRESS") == {"FINISHED"}
        assert not np.array_equal(points_of(empty_scene, "First"), before["First"])
        np.testing.assert_array_equal(points_of(empty_scene, "Second"), before["Second"])
        ((kind, message),) = moving.reports
        assert kind == {"WARNING"}
        assert message == '"Second" keeps its shape: It was cancelled. Run Update Curves'
        assert not moving.timers and not vars(moving.operator)
        assert not is_current(empty_scene, "Second")
        scenes.activate(pair)
        bpy.ops.nicmm.update_curves()
        assert is_current(empty_scene, "Second")


class TestLive:
    @pytest.fixture
    def live(self, empty_scene, pair):
        bpy.context.scene.nicmm_live_update = True
        live = module(empty_scene, "operators.live_update")
        run_timer(live)
        return live

    @pytest.mark.slow
    def test_both_follow_the_mesh(self, empty_scene, pair, live):
        places = scenes.positions(pair)
        places[:, 2] += 0.3 * places[:, 0] ** 2
        pair.data.vertices.foreach_set("co", places.astype(np.float32).ravel())
        pair.data.update()
        run_timer(live)
        assert is_current(empty_scene, "First") and is_current(empty_scene, "Second")
        assert_apart(empty_scene, pair, ["First", "Second"])
        assert not live.messages(pair)

    @pytest.mark.slow
    def test_a_deleted_curve_is_noticed(self, empty_scene, pair, live):
        before = points_of(empty_scene, "Second")
        scenes.activate(bpy.data.objects["First"])
        bpy.ops.object.delete()
        run_timer(live)
        assert is_current(empty_scene, "Second")
        assert len(points_of(empty_scene, "Second")) != len(before)

    @pytest.mark.slow
    def test_what_could_not_follow_is_tried_again(self, empty_scene, pair, live):
        raise_first(pair, 0.25, 1)
        run_timer(live)
        pair.data.update_tag()
        run_timer(live)
        (message,) = live.messages(pair)
        assert message.startswith("Second") and "in the list" in message
        raise_first(pair, 0.0, 1)
        run_timer(live)
        assert not live.messages(pair)
        assert is_current(empty_scene, "Second")

    @pytest.mark.slow
    def test_nothing_to_do_after_an_edit(self, empty_scene, pair, live):
        raise_first(pair)
        before = points_of(empty_scene, "Second")
        pair.data.update_tag()
        run_timer(live)
        np.testing.assert_array_equal(points_of(empty_scene, "Second"), before)


class TestRecords:
    def test_saved_and_reopened(self, empty_scene, pair, tmp_path):
        mesh_name = pair.name
        before = {name: points_of(empty_scene, name) for name in ("First", "Second")}
        path = str(tmp_path / "saved.blend")
        bpy.ops.wm.save_as_mainfile(filepath=path)
        bpy.ops.wm.open_mainfile(filepath=path)
        for name, points in before.items():
            np.testing.assert_array_equal(points_of(empty_scene, name), points)
            assert is_current(empty_scene, name)
        raise_first(bpy.data.objects[mesh_name])
        assert is_current(empty_scene, "Second")

    @pytest.mark.slow
    def test_a_duplicate_of_the_curve_above_is_avoided_too(self, empty_scene, pair):
        scenes.activate(bpy.data.objects["First"])
        bpy.ops.object.duplicate()
        assert order(empty_scene, pair) == ["First", "First.001", "Second"]
        assert not is_current(empty_scene, "Second")
        call("move_point", curve="First.001", index=1, position=on(pair, around(-0.3))[1])
        assert is_current(empty_scene, "Second")
        assert_apart(empty_scene, pair, ["First", "Second"])

    def test_a_duplicate_of_a_curve_that_avoids_is_left_alone(self, empty_scene, pair):
        """It would have to avoid its original, on which it lies."""
        scenes.activate(bpy.data.objects["Second"])
        bpy.ops.object.duplicate()
        assert order(empty_scene, pair) == ["First", "Second", "Second.001"]
        assert is_current(empty_scene, "Second.001")
        scenes.activate(bpy.data.objects["Second"])
        bpy.ops.nicmm.convert_curve(output="STICKY", keep_original=True)
        assert is_current(empty_scene, order(empty_scene, pair)[-1])

    @pytest.mark.slow
    def test_the_name_of_the_curve_above_does_not_matter(self, empty_scene, pair):
        bpy.data.objects["First"].name = "Renamed"
        assert is_current(empty_scene, "Second")
        call("move_point", curve="Renamed", index=2, position=on(pair, around(0.05))[2])
        assert is_current(empty_scene, "Second")
        assert_apart(empty_scene, pair, ["Renamed", "Second"])

    @pytest.mark.parametrize("rank", ["first", 1.5])
    def test_a_damaged_rank(self, empty_scene, pair, rank):
        bpy.data.objects["Second"]["nicmm_curve"]["rank"] = rank
        assert len(order(empty_scene, pair)) == 2
        assert "its rank is" in refusal("remove_point", curve="Second", index=0)

    @pytest.mark.slow
    def test_a_damaged_curve_above_is_named(self, empty_scene, pair, capfd):
        before = points_of(empty_scene, "Second")
        bpy.data.objects["First"]["nicmm_curve"]["barycentric"] = [1.0]
        draw(pair, around(-0.6), "Other")
        scenes.activate(pair)
        bpy.ops.nicmm.update_curves()
        report = capfd.readouterr().out
        assert "1 of 3 curves updated" in report
        assert '"Second": The record of "First" is damaged' in report
        np.testing.assert_array_equal(points_of(empty_scene, "Second"), before)


class TestMessages:
    def test_another_surface(self, empty_scene, pair, capfd):
        before = points_of(empty_scene, "Second")
        bpy.data.objects["First"].nicmm_settings.use_modifiers = False
        settings = module(empty_scene, "operators.curve_settings")
        problem = settings.problem_of(bpy.data.objects["First"])
        assert '"First", which is to be avoided, lies on another surface' in problem
        np.testing.assert_array_equal(points_of(empty_scene, "Second"), before)
        assert "lies on another surface" in refusal("remove_point", curve="Second", index=0)

    def test_points_that_are_too_close_or_cut_off(self, empty_scene, pair):
        """A control point beside a curve, and one on its other side."""
        close = on(pair, around(0.04))[0]
        assert "is closer to a curve above it in the list" in refusal(
            "move_point", curve="Second", index=0, position=close
        )
        beyond = on(pair, around(-0.4))[0]
        assert (
            "the curves above it in the list, with their clearance, separate".lower()
            in refusal("move_point", curve="Second", index=0, position=beyond).lower()
        )

    def test_a_linked_curve_does_not_move(self, empty_scene, pair, tmp_path):
        path = str(tmp_path / "library.blend")
        bpy.ops.wm.save_as_mainfile(filepath=path)
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        with bpy.data.libraries.load(path, link=True) as (_given, wanted):
            wanted.objects = ["First", "Second"]
        for each in wanted.objects:
            bpy.context.scene.collection.objects.link(each)
        linked = module(empty_scene, "scene.curve_record").mesh_of(wanted.objects[0])
        bpy.context.scene.collection.objects.link(linked)
        scenes.activate(wanted.objects[1])
        assert "is linked from" in refusal("move_curve", curve="Second", direction="UP")

    @pytest.mark.slow
    def test_other_methods_avoid_nothing(self, empty_scene, sphere):
        draw(sphere, around(0.0), "First")
        scenes.activate(sphere)
        scenes.select(sphere, scenes.ring(sphere, 4, 0.0))
        made = bpy.ops.nicmm.design_curve(method="VARIATIONAL", avoid_others=True, clearance=0.1)
        assert made == {"FINISHED"}

    @pytest.mark.slow
    def test_alternatives_come_after_the_fairest_curve(self, empty_scene, sphere):
        draw(sphere, around(0.0), "First")
        scenes.activate(sphere)
        places = on(sphere, ring([0.0, 180.0], [0.35, 0.3]))
        points = ", ".join(" ".join(map(str, place)) for place in places)
        bpy.ops.nicmm.design_curve(points=points, closed=False, avoid_others=True, alternatives=2)
        names = order(empty_scene, sphere)
        assert len(names) > 2 and names[0] == "First"
        assert names[1] == bpy.context.active_object.name
        settings = [bpy.data.objects[name].nicmm_settings for name in names[1:]]
        assert [each.avoid_others for each in settings] == [True] + [False] * (len(names) - 2)
        assert all(is_current(empty_scene, name) for name in names)

    @pytest.mark.slow
    def test_design_curve_avoids(self, empty_scene, sphere):
        draw(sphere, around(0.0), "First")
        scenes.activate(sphere)
        points = ", ".join(" ".join(map(str, place)) for place in on(sphere, TILTED))
        bpy.ops.nicmm.design_curve(points=points, avoid_others=True, clearance=CLEARANCE)
        assert_apart(empty_scene, sphere, ["First", bpy.context.active_object.name])
        assert is_current(empty_scene, bpy.context.active_object.name)


@pytest.mark.slow
def test_a_draft_above_is_not_avoided(empty_scene, sphere):
    scenes.activate(sphere)
    call("add_point", position=on(sphere, around(0.0))[0])
    assert len(controls(bpy.context.active_object)) == 1
    draw(sphere, around(0.2), "Second", avoid_others=True, clearance=CLEARANCE)
    assert is_current(empty_scene, "Second")
