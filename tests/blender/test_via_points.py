"""Via points in Blender: they select the course, and are stored, moved, removed and kept."""

import bpy
import numpy as np
import pytest

from tests.blender import scenes
from tests.blender.scenes import module
from tests.blender.test_next_course import APART, away, diagonal, line, torus
from tests.blender.test_point_operators import call, content, controls, refusal, undo_and_redo

pytestmark = [pytest.mark.usefixtures("remembered_designs"), pytest.mark.slow]

__all__ = ["torus"]  # a fixture

ROUNDING = 2e-6
ENDS = ((1.0, 0.0, 0.25), (-0.5, 0.866, -0.25))
FAR = (-0.3, -1.0, 0.25)
"""A place on the other way round the torus."""

NEAR = 0.45
"""How far from the via point the curve may pass. Without it the curve is twice as far away."""


@pytest.fixture
def curve(torus):
    """An open curve around a third of the torus, from the top to the bottom."""
    bpy.context.scene.nicmm_curves.closed = False
    for place in ENDS:
        call("add_point", position=torus.closest_point_on_mesh(place)[1])
    return bpy.context.active_object


def on(mesh_object, place):
    return list(mesh_object.closest_point_on_mesh(place)[1])


def vias(curve):
    """Legs and positions of the recorded via points."""
    record = curve["nicmm_curve"]
    if "via_legs" not in record:
        return [], np.zeros((0, 3))
    return list(record["via_legs"]), np.array(record["via_positions"]).reshape(-1, 3)


def passes(curve, place):
    return np.linalg.norm(line(curve) - place, axis=1).min()


def test_a_via_point_selects_the_course(torus, curve):
    plain, before = line(curve), controls(curve)
    place = on(torus, FAR)
    assert passes(curve, place) > 2 * NEAR
    call("add_via_point", leg=0, position=place)
    assert passes(curve, place) < NEAR
    legs, positions = vias(curve)
    assert legs == [0]
    np.testing.assert_allclose(positions, [place], atol=ROUNDING)
    np.testing.assert_array_equal(controls(curve), before)
    call("remove_via_point", index=0)
    assert vias(curve)[0] == []
    assert away(line(curve), plain) < 0.5 * APART * diagonal(torus)


def test_a_moved_via_point_asks_for_the_course_again(torus, curve):
    plain = line(curve)
    call("add_via_point", leg=0, position=on(torus, FAR))
    call("move_via_point", index=0, position=on(torus, (0.4, 0.95, 0.25)))
    assert vias(curve)[0] == [0]
    assert away(line(curve), plain) < 0.5 * diagonal(torus)
    assert passes(curve, on(torus, FAR)) > 2 * NEAR


def test_each_is_one_undo_step(torus, curve):
    states = [content()]
    call("add_via_point", leg=0, position=on(torus, FAR))
    states.append(content())
    call("move_via_point", index=0, position=on(torus, (0.4, 0.95, 0.25)))
    states.append(content())
    call("remove_via_point", index=0)
    states.append(content())
    undo_and_redo(states)


def test_dragging_a_control_point_keeps_course_and_via_points(torus, curve):
    call("add_via_point", leg=0, position=on(torus, FAR))
    far = line(curve)
    call("move_point", index=1, position=on(torus, (-0.55, 0.85, -0.25)))
    assert vias(curve)[0] == [0]
    assert away(line(curve), far) < 5 * APART * diagonal(torus)


def test_another_setting_keeps_the_way_of_the_via_points(torus, curve):
    """Such a change designs the curve from scratch."""
    call("add_via_point", leg=0, position=on(torus, FAR))
    curve.nicmm_settings.use_modifiers = False
    assert vias(curve)[0] == [0]
    assert passes(curve, on(torus, FAR)) < NEAR


def test_updates_on_another_surface_keep_the_way_of_the_via_points(torus, curve):
    """A subdivision removes the triangles, so the curve is designed from scratch."""
    call("add_via_point", leg=0, position=on(torus, FAR))
    before = vias(curve)[1]
    torus.modifiers.new("Subdivision", "SUBSURF").levels = 1
    assert bpy.ops.nicmm.update_curves() == {"FINISHED"}
    legs, positions = vias(curve)
    assert legs == [0]
    assert np.linalg.norm(positions - before) < 0.02
    assert passes(curve, on(torus, FAR)) < NEAR


def test_via_points_follow_a_moved_mesh(torus, curve):
    call("add_via_point", leg=0, position=on(torus, FAR))
    before = vias(curve)[1]
    for vertex in torus.data.vertices:
        vertex.co.z *= 1.5
    torus.data.update()
    call("update_curves")
    np.testing.assert_allclose(vias(curve)[1], before * [1.0, 1.0, 1.5], atol=ROUNDING)


def test_via_points_on_a_generated_surface_are_stored_on_the_cage(empty_scene, torus):
    """They keep their places when the level of the subdivision changes."""
    torus.modifiers.new("Subdivision", "SUBSURF").levels = 1
    bpy.context.scene.nicmm_curves.closed = False
    cache = module(empty_scene, "scene.surface_cache")
    surface = cache.get(torus, True)
    points = [
        surface.local_positions[np.linalg.norm(surface.local_positions - p, axis=1).argmin()]
        for p in (*ENDS, FAR)
    ]
    call("add_point", position=points[0])
    call("add_point", position=points[1])
    call("add_via_point", leg=0, position=points[2])
    made = bpy.context.active_object
    torus.modifiers[0].levels = 2
    call("update_curves")
    assert np.linalg.norm(vias(made)[1] - points[2]) < 1e-3 * diagonal(torus)
    assert len(made["nicmm_curve"]["via_cage_faces"]) == 1


def test_saved_and_reopened(empty_scene, torus, curve, tmp_path):
    call("add_via_point", leg=0, position=on(torus, FAR))
    before, name = content(), curve.name
    path = str(tmp_path / "saved.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    assert content() == before
    scenes.activate(bpy.data.objects[name])
    opened = module(empty_scene, "outputs.edited_curve").open_curve(
        bpy.context, bpy.data.objects[name]
    )
    np.testing.assert_allclose(opened.via_positions(), vias(bpy.data.objects[name])[1])
    copied = bpy.data.objects[name].copy()
    assert vias(copied)[0] == [0]
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.wm.append(directory=f"{path}/Object/", filename=name)
    assert vias(bpy.data.objects[name])[0] == [0]


def test_a_converted_curve_keeps_them(torus, curve):
    call("add_via_point", leg=0, position=on(torus, FAR))
    before = vias(curve)
    assert bpy.ops.nicmm.convert_curve(output="STICKY") == {"FINISHED"}
    sticky = bpy.context.active_object
    assert sticky.type == "CURVES" and vias(sticky)[0] == before[0]
    np.testing.assert_allclose(vias(sticky)[1], before[1], atol=ROUNDING)
    call("remove_via_point", index=0)
    assert vias(sticky)[0] == []


def test_courses_are_sought_along_the_via_points(empty_scene, torus, curve):
    """Via points are part of the request, and courses found without them are not used again."""
    search = module(empty_scene, "operators.course_search")
    call("next_course")
    (before,) = search._found
    call("add_via_point", leg=0, position=on(torus, FAR))
    call("next_course", course=1)
    (after,) = search._found
    assert after != before
    assert vias(curve)[0] == [0] and passes(curve, on(torus, FAR)) < NEAR


# Legs after changes of the control points.


@pytest.fixture
def loop(torus):
    """A closed curve through four points around the torus, with via points on two legs."""
    bpy.context.scene.nicmm_curves.closed = True
    for angle in (0.0, 1.6, 3.1, 4.7):
        place = (1.1 * np.cos(angle), 1.1 * np.sin(angle), 0.3)
        call("add_point", position=on(torus, place))
    made = bpy.context.active_object
    for leg, angle in ((1, 2.4), (3, 5.0), (3, 5.9)):
        place = (1.1 * np.cos(angle), 1.1 * np.sin(angle), 0.3)
        call("add_via_point", leg=leg, position=on(torus, place))
    return made


def angles(curve):
    """Legs of the via points, and their directions around the torus."""
    legs, positions = vias(curve)
    return [
        (leg, round(float(np.arctan2(y, x) % (2 * np.pi)), 1))
        for leg, (x, y, _) in zip(legs, positions, strict=True)
    ]


def ring(torus, angle):
    return on(torus, (1.1 * np.cos(angle), 1.1 * np.sin(angle), 0.3))


def test_via_points_are_in_the_order_of_the_curve(torus, loop):
    assert angles(loop) == [(1, 2.4), (3, 5.0), (3, 5.9)]
    call("add_via_point", leg=3, position=ring(torus, 5.4))
    call("add_via_point", leg=0, position=ring(torus, 0.8))
    assert angles(loop) == [(0, 0.8), (1, 2.4), (3, 5.0), (3, 5.4), (3, 5.9)]


@pytest.mark.parametrize(
    ("index", "angle", "expected"),
    [
        (1, 0.5, [(2, 2.4), (4, 5.0), (4, 5.9)]),
        (2, 2.0, [(2, 2.4), (4, 5.0), (4, 5.9)]),
        (2, 2.8, [(1, 2.4), (4, 5.0), (4, 5.9)]),
        (4, 5.4, [(1, 2.4), (3, 5.0), (4, 5.9)]),
        (0, 5.4, [(0, 5.9), (2, 2.4), (4, 5.0)]),
    ],
)
def test_an_inserted_point_divides_the_via_points_of_its_leg(torus, loop, index, angle, expected):
    call("insert_point", index=index, position=ring(torus, angle))
    assert angles(loop) == expected


@pytest.mark.parametrize(
    ("index", "expected"),
    [
        (0, [(0, 2.4), (2, 5.0), (2, 5.9)]),
        (1, [(0, 2.4), (2, 5.0), (2, 5.9)]),
        (2, [(1, 2.4), (2, 5.0), (2, 5.9)]),
        (3, [(1, 2.4), (2, 5.0), (2, 5.9)]),
    ],
)
def test_a_removed_point_joins_the_via_points_of_its_legs(loop, index, expected):
    call("remove_point", index=index)
    assert angles(loop) == expected


def test_the_legs_around_point_0_are_joined_in_order(torus, loop):
    call("add_via_point", leg=0, position=ring(torus, 0.8))
    call("remove_point", index=0)
    assert angles(loop) == [(0, 2.4), (2, 5.0), (2, 5.9), (2, 0.8)]


def test_an_open_curve_loses_the_via_points_of_its_last_leg(loop):
    loop.nicmm_settings.closed = False
    assert angles(loop) == [(1, 2.4)]
    call("remove_point", index=0)
    assert angles(loop) == [(0, 2.4)]
    call("remove_point", index=0)
    assert angles(loop) == []


# Scripts.


def test_edit_curve_takes_via_points(torus):
    points = [{"name": "", "position": on(torus, place)} for place in ENDS]
    via = [{"name": "", "leg": 0, "position": on(torus, FAR)}]
    assert bpy.ops.nicmm.edit_curve(points=points, via_points=via, closed=False) == {"FINISHED"}
    made = bpy.context.active_object
    assert vias(made)[0] == [0] and passes(made, on(torus, FAR)) < NEAR
    assert bpy.ops.nicmm.edit_curve(smoothness=2.0) == {"FINISHED"}
    assert vias(made)[0] == [0] and passes(made, on(torus, FAR)) < NEAR
    assert bpy.ops.nicmm.edit_curve(points=points) == {"FINISHED"}
    assert vias(made)[0] == []


def test_design_curve_takes_via_points(torus):
    text = ", ".join(" ".join(map(str, on(torus, place))) for place in ENDS)
    far = " ".join(map(str, on(torus, FAR)))
    assert bpy.ops.nicmm.design_curve(
        points=text, via_points=f"0: {far}", closed=False, alternatives=1
    ) == {"FINISHED"}
    made = bpy.context.active_object
    assert vias(made)[0] == [0] and passes(made, on(torus, FAR)) < NEAR
    vertices = scenes.nearest_vertices(torus, [*ENDS, FAR])
    scenes.activate(torus)
    assert bpy.ops.nicmm.design_curve(
        points=f"{vertices[0]}, {vertices[1]}", via_points=f"0: {vertices[2]}", closed=False
    ) == {"FINISHED"}
    np.testing.assert_allclose(vias(bpy.context.active_object)[1], [on(torus, FAR)], atol=0.05)


def test_errors_change_nothing(torus, curve):
    call("add_via_point", leg=0, position=on(torus, FAR))
    before = content()
    assert "no leg 1" in refusal("add_via_point", leg=1, position=on(torus, FAR))
    assert "no via point 1" in refusal("remove_via_point", index=1)
    assert "no via point 7" in refusal("move_via_point", index=7, position=on(torus, FAR))
    assert "off the surface" in refusal("move_via_point", index=0, position=(0, 0, 3))
    same = refusal("move_via_point", index=0, position=tuple(controls(curve)[0]))
    assert "via point 1 after point 1" in same.lower() and "via_points" not in same
    assert "no leg 4" in refusal(
        "edit_curve", via_points=[{"name": "", "leg": 4, "position": on(torus, FAR)}]
    )
    scenes.activate(torus)
    for text in ("5, 6", "a: 5", "0 5"):
        assert "name no leg" in refusal("design_curve", points="1, 2, 3", via_points=text)
    scenes.activate(curve)
    assert content() == before


def test_a_damaged_record_is_refused(curve, torus):
    call("add_via_point", leg=0, position=on(torus, FAR))
    good = curve["nicmm_curve"].to_dict()
    for name, value in (
        ("via_legs", [3]),
        ("via_legs", [0, 0]),
        ("via_legs", "x"),
        ("via_corners", [1, 2]),
        ("via_barycentric", [np.nan] * 3),
        ("via_positions", []),
    ):
        curve["nicmm_curve"] = {**good, name: value}
        assert "is damaged" in refusal("remove_point", index=0)
    curve["nicmm_curve"] = good
    call("remove_via_point", index=0)


# Dragging, tested through the methods of the tool.


def test_a_dragged_via_point_is_designed_from_scratch(empty_scene, torus, curve):
    edited_curve = module(empty_scene, "outputs.edited_curve")
    opened = edited_curve.open_curve(bpy.context, curve)
    (request,) = edited_curve.request(opened, opened.points)
    live = module(empty_scene, "tool.live_curve").LiveCurve(request, keeps_course=False)
    assert live.waiting and live.curve is opened.curve
    (design,) = module(empty_scene, "operators.long_solves").answer_all([request], always)
    live.set_result(design)
    assert not live.waiting and live.curve is design.curves[0]
    live.move(opened.points)
    assert live.waiting and live.curve is design.curves[0]


def always(_fraction, _polyline):
    return True


def test_clicks_on_via_points(empty_scene):
    picking = module(empty_scene, "tool.picking")
    call_of = module(empty_scene, "tool.draw_operator")._call_of

    def name_of(kind, **flags):
        found = call_of(picking.Hit(kind, "Curve", 2, (0, 0, 0), 1), **flags)
        return found and (found[0].idname_py().removeprefix("nicmm."), found[1])

    plain, remove, via = (
        {"remove": False, "via": False},
        {"remove": True, "via": False},
        {"remove": False, "via": True},
    )
    kind = picking.Kind
    assert name_of(kind.VIA, **plain)[0] == "move_via_point"
    assert name_of(kind.VIA, **via)[0] == "move_via_point"
    assert name_of(kind.VIA, **remove) == ("remove_via_point", {"curve": "Curve", "index": 2})
    name, arguments = name_of(kind.LINE, **via)
    assert name == "add_via_point" and arguments["leg"] == 1
    assert name_of(kind.LINE, **plain)[0] == "insert_point"
    for other in (kind.POINT, kind.SURFACE, kind.CURVE):
        assert name_of(other, **via) is None


def test_the_redo_panel_can_put_a_new_via_point_on_another_leg(torus, loop):
    """The index that the first run has stored may belong to another leg."""
    call("add_via_point", leg=1, index=3, position=ring(torus, 2.8))
    assert angles(loop) == [(1, 2.4), (1, 2.8), (3, 5.0), (3, 5.9)]
