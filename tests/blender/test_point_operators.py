"""Operators on single points: execution, undo in every mode, drafts, settings and errors."""

import bpy
import numpy as np
import pytest

from tests.blender import scenes
from tests.blender.scenes import module
from tests.blender.test_abuse import DAMAGES

pytestmark = pytest.mark.usefixtures("remembered_designs")

ROUNDING = 2e-6


def call(name, **arguments):
    """Run an operator as a click does, with an undo step."""
    assert getattr(bpy.ops.nicmm, name)("EXEC_DEFAULT", True, **arguments) == {"FINISHED"}


def refusal(name, **arguments):
    with pytest.raises(RuntimeError) as caught:
        getattr(bpy.ops.nicmm, name)("EXEC_DEFAULT", True, **arguments)
    return str(caught.value)


def the_curve():
    (found,) = [each for each in bpy.data.objects if "nicmm_curve" in each]
    return found


def content():
    """All data of the designed curves in the file, by the names of their objects."""
    found = {}
    for each in bpy.data.objects:
        if "nicmm_curve" in each:
            record = each["nicmm_curve"].to_dict()
            record["mesh"] = record["mesh"].name
            splines = []
            if each.type == "CURVE":
                splines = [
                    (spline.use_cyclic_u, scenes.get(spline.points, "co", 4).tobytes())
                    for spline in each.data.splines
                ]
            elif len(each.data.points):
                splines = [scenes.get(each.data.points, "position", 3).tobytes()]
            found[each.name] = repr(sorted(record.items())), splines
    return found


def undo_and_redo(states):
    """Each undo leads to the content before it, and each redo to that after it."""
    for expected in states[-2::-1]:
        bpy.ops.ed.undo()
        assert content() == expected
    for expected in states[1:]:
        bpy.ops.ed.redo()
        assert content() == expected


def controls(curve):
    return np.array(curve["nicmm_curve"]["control_positions"]).reshape(-1, 3)


@pytest.fixture
def sphere(empty_scene):
    made = scenes.sphere(4)
    bpy.ops.ed.undo_push(message="Sphere")
    return made


@pytest.fixture
def places(sphere):
    return [list(sphere.closest_point_on_mesh(place)[1]) for place in scenes.five_places()]


@pytest.fixture
def curve(places):
    """A closed curve through five points, active."""
    for place in places:
        call("add_point", position=place)
    return bpy.context.active_object


@pytest.mark.slow
@pytest.mark.parametrize("output", ["CURVE", "STICKY"])
@pytest.mark.parametrize("mode", ["OBJECT", "SCULPT", "WEIGHT_PAINT"])
def test_each_point_is_one_undo_step(sphere, places, mode, output):
    name = sphere.name
    bpy.context.scene.nicmm_curves.output = output
    bpy.ops.object.mode_set(mode=mode)
    bpy.ops.ed.undo_push(message="Mode")
    states = [content()]
    for number, place in enumerate(places, start=1):
        call("add_point", position=place)
        assert bpy.context.active_object.mode == mode
        states.append(content())
        assert len(controls(the_curve())) == number
    assert len({repr(state) for state in states}) == len(states)
    for expected in states[-2::-1]:
        bpy.ops.ed.undo()
        assert content() == expected
        assert bpy.data.objects[name].mode == mode
    for expected in states[1:]:
        bpy.ops.ed.redo()
        assert content() == expected


@pytest.mark.slow
def test_a_curve_grows_with_its_points(empty_scene, sphere, places):
    counts = []
    for place in places[:4]:
        call("add_point", position=place)
        made = the_curve()
        counts.append([(spline.use_cyclic_u) for spline in made.data.splines])
        assert bpy.context.active_object == made
        assert made["nicmm_curve"]["asked"]["closed"]
    assert counts == [[], [False], [True], [True]]
    np.testing.assert_allclose(controls(made), places[:4], atol=ROUNDING)


@pytest.mark.slow
def test_insert_move_and_remove(curve, places, sphere):
    between = list(sphere.closest_point_on_mesh(np.mean(places[:2], axis=0))[1])
    call("insert_point", index=1, position=between)
    np.testing.assert_allclose(controls(curve)[1], between, atol=ROUNDING)
    np.testing.assert_allclose(controls(curve)[[0, 2, 3, 4, 5]], places, atol=ROUNDING)
    moved = list(sphere.closest_point_on_mesh(np.add(between, [0, 0, 0.05]))[1])
    call("move_point", index=1, position=moved)
    np.testing.assert_allclose(controls(curve)[1], moved, atol=ROUNDING)
    call("remove_point", index=1)
    np.testing.assert_allclose(controls(curve), places, atol=ROUNDING)
    for count in (4, 3, 2, 1, 0):
        call("remove_point", index=0)
        assert len(controls(curve)) == count
        assert [spline.use_cyclic_u for spline in curve.data.splines] == (
            [] if count < 2 else [count > 2]
        )
    call("add_point", position=places[0])
    assert the_curve() == curve and len(controls(curve)) == 1


def test_names_choose_the_curve(curve, places, sphere):
    bpy.ops.nicmm.end_curve()
    assert bpy.context.active_object == sphere
    call("add_point", position=places[0])
    other = bpy.context.active_object
    assert other != curve and len(controls(other)) == 1
    call("remove_point", curve=curve.name, index=4)
    assert bpy.context.active_object == curve and len(controls(curve)) == 4
    call("activate_curve", curve=other.name)
    assert bpy.context.active_object == other


def test_in_other_modes_the_selected_curve_is_active(empty_scene, sphere, places):
    active = module(empty_scene, "outputs.edited_curve").active
    bpy.ops.object.mode_set(mode="SCULPT")
    assert active(bpy.context) is None
    call("add_point", position=places[0])
    first = the_curve()
    assert active(bpy.context) == first and bpy.context.active_object == sphere
    call("add_point", position=places[1])
    call("end_curve")
    assert active(bpy.context) is None
    call("add_point", position=places[2])
    assert active(bpy.context) not in (None, first)
    call("activate_curve", curve=first.name)
    assert active(bpy.context) == first


def test_errors_change_nothing(curve, places, sphere):
    before = content()
    bpy.ops.mesh.primitive_ico_sphere_add(location=(4, 0, 0), subdivisions=2)
    scenes.activate(curve)
    assert "off the surface" in refusal("add_point", position=(0, 0, 3))
    assert "are the same point" in refusal("add_point", position=places[2])
    assert "no control point 5" in refusal("remove_point", index=5)
    assert "no control point 9" in refusal("insert_point", index=9, position=places[0])
    assert 'no designed curve "Gone"' in refusal("move_point", curve="Gone", position=places[0])
    assert content() == before
    bpy.ops.object.mode_set(mode="OBJECT")
    scenes.activate(sphere)
    bpy.ops.object.mode_set(mode="EDIT")
    assert "Switch to Object Mode, Sculpt Mode or Weight Paint" in refusal(
        "add_point", position=places[0]
    )


@pytest.mark.slow
def test_points_on_another_part_are_refused(empty_scene, sphere, places):
    bpy.ops.mesh.primitive_ico_sphere_add(location=(4, 0, 0), subdivisions=2)
    bpy.ops.object.select_all(action="SELECT")
    bpy.context.view_layer.objects.active = sphere
    bpy.ops.object.join()
    for place in places[:3]:
        call("add_point", position=place)
    before = content()
    assert "different components" in refusal("add_point", position=(4, 0, 1))
    assert content() == before


@pytest.mark.slow
def test_drafts_are_explained(sphere, places):
    """A curve with one point: operators that need more points say so, and it can be continued."""
    call("add_point", position=places[0])
    draft = the_curve()
    words = "has 1 control point and no curve yet"
    assert words in refusal("end_curve")
    assert words in refusal("convert_curve", output="STICKY")
    assert words in refusal("update_curves")
    bpy.context.scene.nicmm_live_update = True
    draft.nicmm_settings.smoothness = 2.0
    assert draft["nicmm_curve"]["asked"]["smoothness"] == 2.0
    call("add_point", position=places[1])
    call("update_curves")
    assert draft["nicmm_curve"]["asked"]["closed"]
    assert not draft.data.splines[0].use_cyclic_u
    call("add_point", position=places[2])
    assert draft.data.splines[0].use_cyclic_u


@pytest.mark.slow
@pytest.mark.parametrize("output", ["CURVE", "STICKY"])
def test_settings_take_effect_at_once(sphere, places, output):
    bpy.context.scene.nicmm_curves.output = output
    for place in places:
        call("add_point", position=place)
    curve = the_curve()
    values = curve.nicmm_settings
    assert values.closed and values.smoothness == 1.0 and values.spline == "EVEN"
    diagonal = np.linalg.norm(np.ptp(scenes.positions(sphere), axis=0))
    assert values.radius == pytest.approx(0.004 * diagonal, rel=1e-4)
    previous = content()
    for name, value in (
        ("smoothness", 4.0),
        ("closed", False),
        ("spline", "EXACT"),
        ("offset", 0.1),
        ("use_modifiers", False),
    ):
        setattr(values, name, value)
        assert getattr(values, name) == pytest.approx(value) if value != "EXACT" else True
        now = content()
        assert now != previous, name
        previous = now
    values.radius = 0.25
    assert values.radius == pytest.approx(0.25)
    np.testing.assert_allclose(controls(curve), places, atol=ROUNDING)


@pytest.mark.slow
def test_the_radius_of_a_draft_is_kept(sphere, places):
    bpy.context.scene.nicmm_curves.output = "STICKY"
    bpy.context.scene.nicmm_curves.radius = 0.125
    for place in places[:3]:
        call("add_point", position=place)
    curve = the_curve()
    assert curve.nicmm_settings.radius == pytest.approx(0.125)
    call("remove_point", index=0)
    call("remove_point", index=0)
    assert not len(curve.data.points)
    curve.nicmm_settings.radius = 0.0625
    call("add_point", position=places[1])
    assert curve.nicmm_settings.radius == pytest.approx(0.0625)


@pytest.mark.slow
def test_an_impossible_setting_is_explained(empty_scene, curve, sphere):
    wall = sphere.vertex_groups.new(name="Wall")
    heights = scenes.positions(sphere)[:, 2]
    wall.add(np.flatnonzero(np.abs(heights) < 0.4).tolist(), 1.0, "REPLACE")
    before = content()
    curve.nicmm_settings.obstacle_group = "Wall"
    assert content() == before and curve.nicmm_settings.obstacle_group == ""
    problem_of = module(empty_scene, "operators.curve_settings").problem_of
    assert 'obstacles: the vertex group "Wall"' in problem_of(curve)
    curve.nicmm_settings.smoothness = 2.0
    assert problem_of(curve) == ""
    curve.nicmm_settings.obstacle_group = "Wall"
    assert problem_of(curve)
    call("move_point", index=0, position=sphere.closest_point_on_mesh((1.0, 0.3, 0.2))[1])
    curve = the_curve()
    assert problem_of(curve)  # nothing has changed that could make it possible
    sphere.data.vertices[0].co.x += 0.01
    assert bpy.ops.nicmm.update_curves() == {"FINISHED"}
    assert problem_of(the_curve()) == ""


def test_settings_of_what_is_no_curve(sphere):
    sphere.nicmm_settings.closed = False
    assert sphere.nicmm_settings.closed and sphere.nicmm_settings.radius == 0.0


def test_live_has_nothing_to_do_after_a_point(empty_scene, curve, places):
    """The operators write curves that are up to date."""
    live = module(empty_scene, "operators.live_update")
    bpy.context.scene.nicmm_live_update = True
    call("move_point", index=0, position=np.add(places[0], 0.0))
    curve.nicmm_settings.smoothness = 3.0
    before = content()
    live._updates.note(set(), everything=True)
    live._updates.last_change = 0.0
    assert live.tick() is None and not live._updates.requests
    assert content() == before


ANOTHER_MESH = 2
"""Index of the damage that makes the triangles those of another mesh but keeps the points."""


@pytest.mark.parametrize("number", [n for n in range(len(DAMAGES)) if n != ANOTHER_MESH])
def test_a_damaged_record_gets_a_message(empty_scene, curve, places, number):
    """Every operator explains the damage and changes nothing; reading settings raises no error."""
    DAMAGES[number](curve["nicmm_curve"])
    before = repr(curve["nicmm_curve"].to_dict())
    splines = [scenes.get(spline.points, "co", 4).tobytes() for spline in curve.data.splines]
    words = (
        "is damaged",
        "newer version",
        "is not in this scene",
        "Make a mesh",
        "no longer exist",
    )
    calls = (
        ("add_point", {"position": places[0]}),
        ("move_point", {"index": 1, "position": places[0]}),
        ("remove_point", {"index": 1}),
        ("convert_curve", {"output": "STICKY"}),
    )
    for name, arguments in calls:
        text = (
            refusal(name, curve=curve.name, **arguments)
            if "index" in arguments
            else refusal(name, **arguments)
        )
        assert any(each in text for each in words), (name, text)
        assert "Traceback" not in text
    for name in ("closed", "smoothness", "spline", "offset", "radius"):
        getattr(curve.nicmm_settings, name)
    curve.nicmm_settings.smoothness = 2.0
    assert module(empty_scene, "operators.curve_settings").problem_of(curve)
    assert repr(curve["nicmm_curve"].to_dict()) == before
    assert splines == [
        scenes.get(spline.points, "co", 4).tobytes() for spline in curve.data.splines
    ]


def test_a_record_of_another_mesh(curve, places):
    DAMAGES[ANOTHER_MESH](curve["nicmm_curve"])
    assert "no longer exist" in refusal("convert_curve", output="STICKY")
    call("update_curves")
    np.testing.assert_allclose(controls(curve), places, atol=ROUNDING)


@pytest.mark.parametrize("value", [5, "x", [1.0, 2.0]])
def test_another_property_of_that_name_is_no_record(curve, value, sphere):
    curve["nicmm_curve"] = value
    assert "Make a" in refusal("remove_point")
    assert curve.nicmm_settings.closed
    assert "No curve was designed" in refusal("update_curves")


# Dragging a point, tested through the methods of the operator.


def live_of(extension, curve, number):
    """A `LiveCurve`, a function that returns its points with one moved, and the opened curve."""
    edited_curve = module(extension, "outputs.edited_curve")
    opened = edited_curve.open_curve(bpy.context, curve)

    def moved(position):
        place = edited_curve.surface_points_at(opened, np.array([position]), "position")
        return edited_curve.with_point(opened.points, number, place, replaced=True)

    (request,) = edited_curve.request(opened, opened.points)
    return module(extension, "tool.live_curve").LiveCurve(request), moved, opened


def test_every_move_of_a_drag_is_bounded(empty_scene, curve, sphere, places):
    """A move takes a few iterations of the relaxation and never a design from scratch."""
    live, moved, opened = live_of(empty_scene, curve, 1)
    for height in np.linspace(-0.2, 0.5, 15):
        place = sphere.closest_point_on_mesh([*places[1][:2], height])[1]
        before = live.request.start
        live.move(moved(place))
        assert not live.waiting
        assert live.request.start is not before and live.request.start.iterations <= 3
    while live.steps_left:
        live.step()
    assert not live.waiting and not live.problem
    passed = opened.surface.points(live.curve.faces, live.curve.barycentric)
    np.testing.assert_allclose(passed[live.curve.control_index][1], place, atol=ROUNDING)


def test_the_leg_of_a_new_point_is_searched_for_before_it_is_dragged(
    empty_scene, curve, sphere, monkeypatch
):
    """The first move after a point was added has no limit; the next ones are bounded."""
    limits = []
    core_designer = empty_scene.core.Designer
    design = core_designer.design

    def noted(*arguments, max_iterations=None, **options):
        limits.append(max_iterations)
        return design(*arguments, max_iterations=max_iterations, **options)

    monkeypatch.setattr(core_designer, "design", noted)
    edited_curve = module(empty_scene, "outputs.edited_curve")
    opened = edited_curve.open_curve(bpy.context, curve)
    positions = opened.positions()
    middle = positions[0] + positions[-1] + [0.0, 0.0, 0.3]

    def with_new(height):
        place = sphere.closest_point_on_mesh(middle + [0.0, 0.0, height])[1]
        point = edited_curve.surface_points_at(opened, np.array([place]), "position")
        return edited_curve.with_point(opened.points, len(opened.points), point)

    (request,) = edited_curve.request(opened, with_new(0.0))
    live = module(empty_scene, "tool.live_curve").LiveCurve(request, has_new_point=True)
    live.move(with_new(0.02))
    assert not live.waiting and not live.steps_left and not live.has_new_point
    assert len(live.curve.control_index) == len(opened.points) + 1
    live.move(with_new(0.1))
    assert not live.waiting and limits[0] is None and 1 <= limits[1] <= 3


def test_after_a_jump_the_curve_is_designed_from_scratch(empty_scene, curve):
    live, moved, _ = live_of(empty_scene, curve, 1)
    before = live.curve
    live.move(moved((0.0, 0.0, 1.0)))
    assert live.waiting and live.curve is before


def test_a_problem_keeps_the_last_curve(empty_scene, curve, places):
    live, moved, _ = live_of(empty_scene, curve, 1)
    before = live.curve
    live.move(moved(places[0]))
    assert "are the same point" in live.problem and live.curve is before
    live.move(moved(places[1]))
    assert not live.problem


@pytest.mark.slow
@pytest.mark.parametrize("output", ["CURVE", "STICKY"])
def test_a_preview_leaves_no_trace(empty_scene, sphere, places, output):
    bpy.context.scene.nicmm_curves.output = output
    for place in places:
        call("add_point", position=place)
    curve = the_curve()
    live, moved, opened = live_of(empty_scene, curve, 1)
    preview = module(empty_scene, "tool.point_drag")._Preview(opened)
    before, data = content(), curve.data
    count = len(bpy.data.curves) + len(bpy.data.hair_curves)
    live.move(moved(sphere.closest_point_on_mesh([*places[1][:2], 0.0])[1]))
    for _ in range(3):
        preview.show(live.curves)
    assert content() != before and curve.data != data
    preview.restore()
    assert content() == before and curve.data == data
    assert len(bpy.data.curves) + len(bpy.data.hair_curves) == count
    preview.restore()
    assert content() == before


def test_any_position_can_be_entered_after_a_click(empty_scene, curve, sphere):
    """The redo panel runs the operator again; scripts must give positions on the surface."""
    assert "off the surface" in refusal("move_point", index=0, position=(2.0, 0.5, 0.5))
    call("move_point", index=0, position=(2.0, 0.5, 0.5), from_mouse=True)
    expected = sphere.closest_point_on_mesh((2.0, 0.5, 0.5))[1]
    np.testing.assert_allclose(controls(the_curve())[0], expected, atol=ROUNDING)


def test_a_curve_deleted_meanwhile_is_not_made_again(empty_scene, curve):
    edited_curve = module(empty_scene, "outputs.edited_curve")
    opened = edited_curve.open_curve(bpy.context, curve)
    (request,) = edited_curve.request(opened, opened.points)
    (answer,) = module(empty_scene, "operators.long_solves").answer_all([request], always)
    bpy.data.objects.remove(curve)
    with pytest.raises(module(empty_scene, "scene.messages").InputError, match="was deleted"):
        edited_curve.write(bpy.context, opened, opened.points, answer.curves, None)
    assert not scenes.curves()


def test_a_mesh_deleted_meanwhile_gets_a_message(empty_scene, curve):
    edited_curve = module(empty_scene, "outputs.edited_curve")
    opened = edited_curve.open_curve(bpy.context, curve)
    bpy.data.objects.remove(opened.mesh_object)
    error = module(empty_scene, "scene.messages").InputError
    with pytest.raises(error, match="mesh was deleted"):
        edited_curve.request(opened, opened.points)
    with pytest.raises(error, match="mesh was deleted"):
        edited_curve.rewrite(opened, opened.points, [opened.curve])
    assert len(curve.data.splines) == 1


def always(_fraction, _polyline):
    return True


def test_operators_keep_nothing_when_they_have_finished(empty_scene, curve):
    """Blender keeps finished operators, and their meshes would stay in memory."""
    long_solves = module(empty_scene, "operators.long_solves")

    class Operator(long_solves.LongSolves):
        def requests(self, _context):
            self.kept = curve
            return []

        def finish(self, _context, _requests, _answers):
            return {"FINISHED"}

    operator = Operator()
    assert operator.execute(bpy.context) == {"FINISHED"}
    assert not vars(operator)


def test_hidden_curves_cannot_be_clicked(empty_scene, curve, sphere):
    picking = module(empty_scene, "tool.picking")
    assert bpy.ops.nicmm.end_curve() == {"FINISHED"}
    assert [line.name for line in picking.other_lines(bpy.context)] == [curve.name]
    curve.hide_set(True)
    assert picking.other_lines(bpy.context) == []
    curve.hide_set(False)
    assert [line.name for line in picking.other_lines(bpy.context)] == [curve.name]
