"""Control points on other curves: they are no crossings, and follow these curves."""

import bpy
import numpy as np
import pytest

from tests.blender import scenes
from tests.blender.scenes import module
from tests.blender.test_avoid_others import (
    CLEARANCE,
    around,
    curve_of,
    draw,
    is_current,
    mesh_of,
    on,
    order,
    points_of,
    raise_first,
    ring,
    sphere,
)
from tests.blender.test_curve_list import run_timer
from tests.blender.test_point_operators import call, controls, refusal
from tests.blender.test_view import matrices
from tests.oracles.curve_pairs import contacts

pytestmark = [pytest.mark.usefixtures("remembered_designs")]

__all__ = ["sphere"]  # a fixture

ON_CURVE = 1e-9
"""Greatest distance of a junction from its curve, in diagonals of the mesh."""

FRACTION = 0.4
"""Where on a leg of the first curve a junction is."""


def place_on(extension, name, leg=1, share=FRACTION):
    """A position on a leg of a curve, in single precision as operators have it."""
    places = module_of_places(extension)
    curve = curve_of(extension, name)
    mesh = surface_mesh(extension, name)
    point = places.point_at(mesh, curve, places.CurvePlace(leg, share))
    return [float(each) for each in point.positions(mesh)[0].astype(np.float32)]


def module_of_places(extension):
    from importlib import import_module

    return import_module(f"{extension.core.__name__}.geometry.curve_places")


def surface_mesh(extension, name):
    record = module(extension, "scene.curve_record")
    mesh_object = record.mesh_of(bpy.data.objects[name])
    surface = module(extension, "scene.surface").read(mesh_object, True)
    return extension.core.Mesh(surface.core_positions, surface.faces)


def junctions(name):
    """Point, name of the other curve, leg and share of each recorded junction."""
    return [
        (each["point"], each["curve"].name, each["leg"], each["share"])
        for each in bpy.data.objects[name]["nicmm_curve"].get("junctions", ())
    ]


def assert_on(extension, name, number, other="First"):
    """Assert that a control point lies exactly on another curve; return its position."""
    places, mesh = module_of_places(extension), surface_mesh(extension, name)
    curve = curve_of(extension, name)
    position = curve.points[curve.control_index[number]]
    away = places.distances(curve_of(extension, other), position[None])[0]
    assert away <= ON_CURVE * mesh.diagonal
    np.testing.assert_allclose(controls(bpy.data.objects[name])[number], position, atol=1e-12)
    return position


def assert_meets_only_there(extension, mesh_object, position, name="Second", other="First"):
    curves = [curve_of(extension, each) for each in (name, other)]
    assert not contacts(mesh_of(mesh_object), *curves, junctions=position[None])


@pytest.fixture
def first(empty_scene, sphere):
    draw(sphere, around(0.0), "First")
    return sphere


@pytest.fixture(params=[0.0, CLEARANCE])
def tee(empty_scene, first, request):
    """An open curve from the first one, at 126 degrees, towards the pole."""
    end = on(first, ring([150.0], [0.7]))[0]
    places = [place_on(empty_scene, "First"), end]
    draw(first, places, "Second", closed=False, avoid_others=True, clearance=request.param)
    return first


@pytest.fixture
def cross(empty_scene, first):
    """An open curve that passes through a point of the first one to the other side.

    The point is not right beside a vertex, where a third curve from there cannot always follow.
    """
    ends = on(first, ring([110.0, 150.0], [0.5, -0.5]))
    places = [ends[0], place_on(empty_scene, "First", share=0.27), ends[1]]
    draw(first, places, "Second", closed=False, avoid_others=True, clearance=CLEARANCE)
    return first


def test_a_point_on_a_curve_is_recorded(empty_scene, tee):
    ((point, name, leg, share),) = junctions("Second")
    assert (point, name, leg) == (0, "First", 1)
    assert share == pytest.approx(FRACTION, abs=1e-5)
    position = assert_on(empty_scene, "Second", 0)
    assert_meets_only_there(empty_scene, tee, position)


@pytest.mark.slow
def test_the_end_of_a_tee_follows_its_place(empty_scene, tee):
    before = assert_on(empty_scene, "Second", 0)
    ((_, _, leg, share),) = junctions("Second")
    raise_first(tee, 0.15)
    after = assert_on(empty_scene, "Second", 0)
    assert 0.03 < np.linalg.norm(after - before) < 0.2
    ((_, _, leg_after, share_after),) = junctions("Second")
    assert leg_after == leg and share_after == pytest.approx(share, abs=1e-9)
    assert_meets_only_there(empty_scene, tee, after)
    assert is_current(empty_scene, "Second")
    bpy.ops.ed.undo()
    np.testing.assert_array_equal(assert_on(empty_scene, "Second", 0), before)
    bpy.ops.ed.redo()
    np.testing.assert_array_equal(assert_on(empty_scene, "Second", 0), after)


@pytest.mark.slow
def test_a_crossing_follows_too(empty_scene, cross):
    before = assert_on(empty_scene, "Second", 1)
    heights = points_of(empty_scene, "Second")[:, 2]
    assert heights.max() > 0.4 and heights.min() < -0.4
    raise_first(cross, 0.15)
    after = assert_on(empty_scene, "Second", 1)
    assert np.linalg.norm(after - before) > 0.03
    assert_meets_only_there(empty_scene, cross, after)


def test_without_that_point_the_curves_separate_the_ends(empty_scene, cross):
    message = refusal("remove_point", curve="Second", index=1)
    assert "the curves above it in the list, with their clearance, separate" in message.lower()


@pytest.mark.slow
def test_a_junction_on_a_control_point_stays_there(empty_scene, first):
    place = controls(bpy.data.objects["First"])[2].astype(np.float32).tolist()
    end = on(first, ring([150.0], [0.7]))[0]
    draw(first, [place, end], "Second", closed=False, avoid_others=True)
    assert junctions("Second") == [(0, "First", 2, 0.0)]
    raise_first(first, 0.1)
    second, first = (controls(bpy.data.objects[name]) for name in ("Second", "First"))
    np.testing.assert_allclose(second[0], first[2], atol=1e-12)


@pytest.mark.slow
def test_other_numbers_of_points_keep_the_place(empty_scene, tee):
    before = assert_on(empty_scene, "Second", 0)
    between = place_on(empty_scene, "First", 0, 0.5)
    call("insert_point", curve="First", index=1, position=between)
    after = assert_on(empty_scene, "Second", 0)
    assert np.linalg.norm(after - before) < 0.02
    ((_, _, leg, _),) = junctions("Second")
    assert leg == 2
    call("remove_point", curve="First", index=1)
    assert np.linalg.norm(assert_on(empty_scene, "Second", 0) - before) < 0.02


@pytest.mark.slow
def test_a_point_moved_away_is_no_junction_any_more(empty_scene, tee):
    call("move_point", curve="Second", index=0, position=on(tee, ring([126.0], [0.3]))[0])
    assert junctions("Second") == []
    before = controls(bpy.data.objects["Second"])
    raise_first(tee, 0.06)
    np.testing.assert_array_equal(controls(bpy.data.objects["Second"]), before)
    call("move_point", curve="Second", index=0, position=place_on(empty_scene, "First"))
    assert len(junctions("Second")) == 1


@pytest.mark.slow
@pytest.mark.parametrize("height", [0.6, 0.5])
def test_points_are_added_and_inserted_on_curves(empty_scene, first, height):
    panel = bpy.context.scene.nicmm_curves
    panel.closed, panel.avoid_others, panel.clearance = False, True, CLEARANCE
    scenes.activate(first)
    call("add_point", position=on(first, ring([110.0], [height]))[0])
    second = bpy.context.active_object
    second.name = "Second"
    call("add_point", position=on(first, ring([150.0], [height]))[0])
    call("add_point", position=place_on(empty_scene, "First", 2))
    assert [each[:2] for each in junctions("Second")] == [(2, "First")]
    assert_on(empty_scene, "Second", 2)
    call("insert_point", index=1, position=place_on(empty_scene, "First", 1))
    assert [each[0] for each in junctions("Second")] == [1, 3]
    call("toggle_corner", index=1)
    assert [each[0] for each in junctions("Second")] == [1, 3]


@pytest.mark.slow
def test_design_curve_makes_junctions(empty_scene, first):
    scenes.activate(first)
    places = [place_on(empty_scene, "First"), on(first, ring([150.0], [0.7]))[0]]
    points = ", ".join(" ".join(map(str, place)) for place in places)
    bpy.ops.nicmm.design_curve(points=points, closed=False, avoid_others=True)
    bpy.context.active_object.name = "Second"
    assert_on(empty_scene, "Second", 0)
    raise_first(first, 0.1)
    assert_on(empty_scene, "Second", 0)


def test_without_the_setting_points_on_curves_are_ordinary(empty_scene, first):
    end = on(first, ring([150.0], [0.7]))[0]
    draw(first, [place_on(empty_scene, "First"), end], "Second", closed=False)
    assert junctions("Second") == []
    before = controls(bpy.data.objects["Second"])
    raise_first(first, 0.1)
    np.testing.assert_array_equal(controls(bpy.data.objects["Second"]), before)


def test_the_setting_finds_points_on_curves(empty_scene, first):
    end = on(first, ring([150.0], [0.7]))[0]
    draw(first, [place_on(empty_scene, "First"), end], "Second", closed=False)
    bpy.data.objects["Second"].nicmm_settings.avoid_others = True
    assert len(junctions("Second")) == 1
    assert_on(empty_scene, "Second", 0)


@pytest.mark.slow
def test_a_point_on_two_curves_follows(empty_scene, cross):
    """The third one begins at the crossing of the other two."""
    place = controls(bpy.data.objects["Second"])[1].astype(np.float32).tolist()
    end = on(cross, ring([90.0], [0.3]))[0]
    draw(cross, [place, end], "Third", closed=False, avoid_others=True)
    assert [each[:2] for each in junctions("Third")] == [(0, "First"), (0, "Second")]
    raise_first(cross, 0.1)
    assert is_current(empty_scene, "Third")
    assert_on(empty_scene, "Third", 0, "First")
    assert_on(empty_scene, "Third", 0, "Second")


@pytest.mark.slow
def test_a_chain_of_junctions_follows(empty_scene, tee):
    end = on(tee, ring([100.0], [0.5]))[0]
    place = place_on(empty_scene, "Second", 0, 0.5)
    draw(tee, [place, end], "Third", closed=False, avoid_others=True)
    raise_first(tee, 0.1)
    assert_on(empty_scene, "Second", 0)
    assert_on(empty_scene, "Third", 0, "Second")


class TestOtherCurve:
    """What happens to the other curve."""

    def test_renamed(self, empty_scene, tee):
        bpy.data.objects["First"].name = "Renamed"
        call("move_point", curve="Renamed", index=2, position=on(tee, around(0.1))[2])
        assert_on(empty_scene, "Second", 0, "Renamed")

    @pytest.mark.slow
    def test_duplicated(self, empty_scene, tee):
        scenes.activate(bpy.data.objects["First"])
        bpy.ops.object.duplicate()
        for number in range(4):  # the copy would be on the other curve
            place = on(tee, around(-0.4))[number]
            call("move_point", curve="First.001", index=number, position=place)
        raise_first(tee, 0.1)
        assert [each[:2] for each in junctions("Second")] == [(0, "First")]
        assert_on(empty_scene, "Second", 0)

    @pytest.mark.parametrize("keep_original", [False, True])
    def test_converted(self, empty_scene, tee, keep_original):
        scenes.activate(bpy.data.objects["First"])
        bpy.ops.nicmm.convert_curve(output="STICKY", keep_original=keep_original)
        assert bpy.data.objects["First"].type == ("CURVE" if keep_original else "CURVES")
        assert order(empty_scene, tee)[:2] == ["First", "Second"]
        raise_first(tee, 0.1)
        assert [each[:2] for each in junctions("Second")] == [(0, "First")]
        assert_on(empty_scene, "Second", 0)

    def test_deleted(self, empty_scene, tee):
        """Blender keeps the object until the record no longer refers to it."""
        before = controls(bpy.data.objects["Second"])
        scenes.activate(bpy.data.objects["First"])
        bpy.ops.object.delete()
        assert order(empty_scene, tee) == ["Second"]
        scenes.activate(tee)
        assert bpy.ops.nicmm.update_curves() == {"FINISHED"}
        np.testing.assert_allclose(controls(bpy.data.objects["Second"]), before, atol=1e-12)
        assert junctions("Second") == []
        assert is_current(empty_scene, "Second")

    def test_moved_below(self, empty_scene, tee):
        """The point becomes an ordinary one, and a junction again when it moves back."""
        call("move_curve", curve="First", direction="DOWN")
        assert order(empty_scene, tee) == ["Second", "First"]
        assert junctions("Second") == []
        raise_first(tee, 0.0)
        call("move_curve", curve="First", direction="UP")
        assert len(junctions("Second")) == 1

    @pytest.mark.slow
    def test_without_a_curve(self, empty_scene, tee):
        for _ in range(3):
            call("remove_point", curve="First", index=0)
        assert junctions("Second") == []
        assert is_current(empty_scene, "Second")

    def test_appended_to_another_file(self, empty_scene, tee, tmp_path):
        path = str(tmp_path / "library.blend")
        bpy.ops.wm.save_as_mainfile(filepath=path)
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        with bpy.data.libraries.load(path) as (given, wanted):
            wanted.objects = given.objects
        for each in wanted.objects:
            bpy.context.scene.collection.objects.link(each)
        mesh_object = module(empty_scene, "scene.curve_record").mesh_of(bpy.data.objects["First"])
        bpy.context.view_layer.update()
        scenes.activate(mesh_object)
        raise_first(mesh_object, 0.1)
        assert_on(empty_scene, "Second", 0)


@pytest.mark.slow
def test_live_takes_junctions_along(empty_scene, tee):
    bpy.context.scene.nicmm_live_update = True
    live = module(empty_scene, "operators.live_update")
    run_timer(live)
    places = scenes.positions(tee)
    places[:, 2] += 0.2 * places[:, 0] ** 2
    tee.data.vertices.foreach_set("co", places.astype(np.float32).ravel())
    tee.data.update()
    run_timer(live)
    assert is_current(empty_scene, "Second")
    assert_on(empty_scene, "Second", 0)


@pytest.mark.slow
def test_junctions_on_a_generated_surface(empty_scene, first):
    """With another level of subdivision no triangle stays, and the junctions are found again."""
    first.modifiers.new("Subdivision", "SUBSURF").levels = 1
    scenes.activate(first)
    bpy.ops.nicmm.update_curves()
    vertices = surface_mesh(empty_scene, "First").vertices
    end = list(vertices[np.linalg.norm(vertices - ring([150.0], [0.7]), axis=1).argmin()])
    draw(first, [place_on(empty_scene, "First"), end], "Second", closed=False, avoid_others=True)
    assert len(junctions("Second")) == 1
    first.modifiers[0].levels = 2
    scenes.activate(first)
    bpy.ops.nicmm.update_curves()
    assert len(junctions("Second")) == 1
    assert_on(empty_scene, "Second", 0)


DAMAGED = {
    "text": "junctions is not a list",
    "number": "junctions is not a list",
    "point": "at a place that does not exist",
    "share": "at a place that does not exist",
    "leg": "at a place that does not exist",
    "missing": "no valid indices",
}


@pytest.mark.parametrize("damage", DAMAGED)
def test_damaged_records(empty_scene, tee, damage):
    record = bpy.data.objects["Second"]["nicmm_curve"]
    (junction,) = record["junctions"]
    if damage == "text":
        record["junctions"] = "First"
    elif damage == "number":
        record["junctions"] = 3
    elif damage == "missing":
        del junction["leg"]
    else:
        junction[damage] = {"point": 7, "share": 2.0, "leg": 9}[damage]
    assert DAMAGED[damage] in refusal("remove_point", curve="Second", index=0)


def test_a_junction_without_its_curve_is_an_ordinary_point(empty_scene, tee):
    (junction,) = bpy.data.objects["Second"]["nicmm_curve"]["junctions"]
    junction["curve"] = "First"
    before = controls(bpy.data.objects["Second"])
    call("move_point", curve="Second", index=1, position=on(tee, ring([140.0], [0.7]))[0])
    np.testing.assert_array_equal(controls(bpy.data.objects["Second"])[0], before[0])
    assert len(junctions("Second")) == 1  # it still lies on the curve


class TestUnderTheMouse:
    """The mouse near a curve that the active one avoids; the view is from the front, y < 0."""

    @pytest.fixture
    def picking(self, empty_scene, first, monkeypatch):
        picking = module(empty_scene, "tool.picking")
        view = module(empty_scene, "tool.view").View
        cache = module(empty_scene, "scene.surface_cache")

        def seen_from_the_front(_context, _mesh_object, surface):
            size = np.array([800.0, 600.0])
            return view(matrices(-5.0, True), size, surface, cache.core_mesh(surface), True)

        monkeypatch.setattr(picking, "view_on", seen_from_the_front)
        places = ring([255.0, 285.0], [0.3, 0.3])
        draw(first, places, "Second", closed=False, avoid_others=True, clearance=0.05)
        return picking

    def pixel_of(self, picking, position):
        surface = picking.opened_now(bpy.context).surface
        return picking.view_on(bpy.context, None, surface).project(np.atleast_2d(position))[0]

    def near(self, picking, position):
        """A pixel within reach of a position."""
        reach = picking.CURVE_REACH * bpy.context.preferences.system.ui_scale
        return self.pixel_of(picking, position) + [0.4 * reach, 0.5 * reach]

    def test_a_click_snaps_to_it(self, empty_scene, picking):
        position = np.array(place_on(empty_scene, "First", 3, 0.1))
        hit = picking.under_mouse(bpy.context, self.near(picking, position))
        assert (hit.kind, hit.name, hit.index) == (picking.Kind.JUNCTION, "Second", 2)
        assert np.linalg.norm(hit.position - position) < 0.02
        call("add_point", position=hit.position)
        assert [each[:2] for each in junctions("Second")] == [(2, "First")]
        assert_on(empty_scene, "Second", 2)

    def test_it_prefers_control_points(self, empty_scene, picking):
        place = controls(bpy.data.objects["First"])[3]
        hit = picking.under_mouse(bpy.context, self.near(picking, place))
        assert hit.kind is picking.Kind.JUNCTION
        np.testing.assert_allclose(hit.position, place, atol=1e-12)

    def test_farther_away_it_is_the_surface(self, empty_scene, picking):
        pixel = self.pixel_of(picking, place_on(empty_scene, "First", 3, 0.1))
        hit = picking.under_mouse(bpy.context, pixel - [0.0, 40.0])
        assert hit.kind is picking.Kind.SURFACE

    def test_otherwise_a_click_activates_it(self, empty_scene, picking, first):
        pixel = self.pixel_of(picking, place_on(empty_scene, "First", 3, 0.1))
        bpy.data.objects["Second"].nicmm_settings.avoid_others = False
        hit = picking.under_mouse(bpy.context, pixel)
        assert (hit.kind, hit.name) == (picking.Kind.CURVE, "First")
        bpy.context.scene.nicmm_curves.avoid_others = True
        scenes.activate(first)
        hit = picking.under_mouse(bpy.context, pixel)
        assert (hit.kind, hit.name) == (picking.Kind.CURVE, "First")

    def test_a_hidden_curve_attracts_nothing(self, empty_scene, picking):
        pixel = self.pixel_of(picking, place_on(empty_scene, "First", 3, 0.1))
        bpy.data.objects["First"].hide_set(True)
        hit = picking.under_mouse(bpy.context, pixel)
        assert hit.kind is picking.Kind.SURFACE

    def test_junctions_of_the_active_curve_are_marked(self, empty_scene, picking):
        assert not picking.opened_now(bpy.context).junctions.any()
        call("move_point", index=1, position=place_on(empty_scene, "First", 3, 0.1))
        assert picking.opened_now(bpy.context).junctions.tolist() == [False, True]
