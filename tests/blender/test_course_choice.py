"""Choose Course: the courses are shown, the user changes the choice, confirms or cancels."""

from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from tests.blender.scenes import module
from tests.blender.test_next_course import APART, away, curve, diagonal, line, torus
from tests.blender.test_point_operators import call, content, controls, refusal
from tests.blender.test_view import matrices

pytestmark = [pytest.mark.usefixtures("remembered_designs"), pytest.mark.slow]

__all__ = ["curve", "torus"]  # fixtures

SIZE = np.array([800.0, 600.0])


class Context:
    """The context of Blender with a viewport and a window, which background mode lacks."""

    def __init__(self):
        self.texts, self.handlers = [], []
        self.window_manager = SimpleNamespace(modal_handler_add=self.handlers.append)
        self.workspace = SimpleNamespace(status_text_set=self.texts.append)
        self.region = SimpleNamespace(width=SIZE[0], height=SIZE[1])

    def __getattr__(self, name):
        return getattr(bpy.context, name)


@pytest.fixture
def choice(empty_scene, monkeypatch):
    """A choice among the courses of the active curve: its operator, context and `send`."""
    course_choice = module(empty_scene, "tool.course_choice")
    picking = module(empty_scene, "tool.picking")
    view = module(empty_scene, "tool.view").View
    cache = module(empty_scene, "scene.surface_cache")
    reports = []

    def seen_from_the_front(_context, _mesh_object, surface):
        return view(matrices(-5.0, True), SIZE, surface, cache.core_mesh(surface), True)

    monkeypatch.setattr(picking, "view_on", seen_from_the_front)
    # Without time slices, for which a window would be needed on a slow machine.
    monkeypatch.setattr(module(empty_scene, "preferences"), "patience", lambda: 3600.0)

    class Operator(course_choice.CourseChoice):
        bl_label, curve, leg, under_mouse = "Choose Course", "", -1, False

        def report(self, kind, message):
            reports.append(message)

    operator, context = Operator(), Context()

    def send(kind, value="PRESS", pixel=(-1, -1), **keys):
        held = {"shift": False, "ctrl": False, "alt": False, **keys}
        place = {"mouse_region_x": pixel[0], "mouse_region_y": pixel[1]}
        return operator.modal(context, SimpleNamespace(type=kind, value=value, **held, **place))

    def begin(leg=-1):
        operator.leg = leg
        return operator.answer(context, operator.requests(context))

    def press(pixel, under_mouse=True):
        operator.under_mouse = under_mouse
        place = {"mouse_region_x": pixel[0], "mouse_region_y": pixel[1]}
        return operator._invoke(context, SimpleNamespace(**place))

    overlay = module(empty_scene, "tool.course_overlay")
    yield SimpleNamespace(
        operator=operator,
        context=context,
        send=send,
        begin=begin,
        press=press,
        reports=reports,
        overlay=overlay,
    )
    assert overlay._state.shown is None


def test_the_current_course_is_chosen_at_first(choice, curve):
    before = content()
    assert choice.begin() == {"RUNNING_MODAL"}
    shown = choice.overlay._state.shown
    assert len(shown.courses) >= 3 and shown.chosen == 0
    assert choice.context.handlers == [choice.operator]
    energies = [course.energy for course in shown.courses]
    assert energies[0] == 1.0 and energies == sorted(energies) and energies[-1] > 1.05
    assert f"1 of {len(energies)}, 1.00×" in choice.context.texts[-1]
    assert choice.send("RET") == {"CANCELLED"}
    assert content() == before
    assert choice.context.texts[-1] is None and not vars(choice.operator)


def test_keys_and_wheel_change_the_choice(choice, curve):
    choice.begin()
    count = len(choice.overlay._state.shown.courses)
    for kind, keys, expected in (
        ("WHEELDOWNMOUSE", {}, 1),
        ("RIGHT_ARROW", {}, 2),
        ("LEFT_ARROW", {}, 1),
        ("RET", {"shift": True}, 2),
        ("UP_ARROW", {}, 1),
        ("WHEELUPMOUSE", {}, 0),
        ("WHEELUPMOUSE", {}, count - 1),
        ("DOWN_ARROW", {}, 0),
    ):
        assert choice.send(kind, **keys) == {"RUNNING_MODAL"}
        assert choice.overlay._state.shown.chosen == expected
        energy = choice.overlay._state.shown.courses[expected].energy
        assert f"{expected + 1} of {count}, {energy:.2f}×" in choice.context.texts[-1]
    assert choice.send("WHEELUPMOUSE", ctrl=True) == {"PASS_THROUGH"}
    assert choice.send("MIDDLEMOUSE") == {"PASS_THROUGH"}
    assert choice.send("A") == {"RUNNING_MODAL"}
    assert choice.overlay._state.shown.chosen == 0
    choice.send("ESC")


@pytest.mark.parametrize("cancel", ["ESC", "RIGHTMOUSE"])
def test_cancelling_changes_nothing(choice, curve, cancel):
    before = content()
    choice.begin()
    choice.send("DOWN_ARROW")
    assert choice.send(cancel) == {"CANCELLED"}
    assert content() == before
    bpy.ops.ed.undo()  # undoes the last point, since the choice is no undo step
    assert content() != before


def test_the_chosen_course_is_written_in_one_undo_step(choice, curve, torus):
    before, fairest = content(), line(curve)
    choice.begin()
    expected = choice.overlay._state.shown.lines[1]
    choice.send("DOWN_ARROW")
    assert choice.send("RET") == {"FINISHED"}
    after, chosen = content(), line(curve)
    assert away(chosen, expected) < 0.5 * APART * diagonal(torus)
    assert away(chosen, fairest) > APART * diagonal(torus)
    bpy.ops.ed.undo()
    assert content() == before
    bpy.ops.ed.redo()
    assert content() == after


def test_a_click_chooses_a_course_and_then_confirms(choice, curve, torus, empty_scene):
    choice.begin()
    lines = choice.overlay._state.shown.lines
    surface = choice.operator._opened.surface
    view = module(empty_scene, "tool.picking").view_on(None, None, surface)
    places = view.label_places(lines)  # beside one line only
    assert np.isfinite(places).all()
    assert choice.send("LEFTMOUSE", pixel=places[2]) == {"RUNNING_MODAL"}
    assert choice.overlay._state.shown.chosen == 2
    assert choice.send("LEFTMOUSE", pixel=(-50, 10)) == {"RUNNING_MODAL"}  # beside the viewport
    assert choice.send("LEFTMOUSE", value="RELEASE", pixel=places[1]) == {"RUNNING_MODAL"}
    assert choice.send("LEFTMOUSE", value="DOUBLE_CLICK", pixel=places[2]) == {"FINISHED"}
    assert away(line(bpy.context.active_object), lines[2]) < 0.5 * APART * diagonal(torus)


def test_a_click_beside_all_courses_confirms(choice, curve, torus):
    choice.begin()
    choice.send("DOWN_ARROW")
    expected = choice.overlay._state.shown.lines[1]
    assert choice.send("LEFTMOUSE", pixel=(2, 2)) == {"FINISHED"}
    assert away(line(bpy.context.active_object), expected) < 0.5 * APART * diagonal(torus)


def test_without_another_course_there_is_no_choice(choice):
    bpy.ops.mesh.primitive_plane_add()
    bpy.context.scene.nicmm_curves.closed = False
    call("add_point", position=(-0.5, 0.1, 0.0))
    call("add_point", position=(0.5, 0.2, 0.0))
    before = content()
    assert choice.begin() == {"CANCELLED"}
    assert "No other course" in choice.reports[-1]
    assert content() == before and not vars(choice.operator)


def test_blender_can_end_the_choice(choice, curve):
    choice.begin()
    choice.operator.cancel(choice.context)
    assert choice.context.texts[-1] is None


def test_scripts_are_referred_to_next_course(curve):
    with pytest.raises(RuntimeError, match="Scripts call next_course"):
        bpy.ops.nicmm.choose_course("EXEC_DEFAULT")


# Another course of one leg.


@pytest.fixture
def loop(torus):
    """A closed curve through four points around the torus, in turn on its top and its bottom."""
    for number, angle in enumerate((0.1, 1.5, 2.8, 4.4)):
        place = (1.1 * np.cos(angle), 1.1 * np.sin(angle), 0.3 * (-1) ** (number + 1))
        call("add_point", position=torus.closest_point_on_mesh(place)[1])
    return bpy.context.active_object


def legs(curve):
    """The parts of the curve between its control points, in the local space of the mesh."""
    points = line(curve)
    ends = [int(np.linalg.norm(points - place, axis=1).argmin()) for place in controls(curve)]
    count = len(points)
    return [
        points[np.arange(first, last + count * (last <= first) + 1) % count]
        for first, last in zip(ends, [*ends[1:], ends[0]], strict=True)
    ]


def changes(before, after):
    return [away(*pair) for pair in zip(before, after, strict=True)]


def test_one_leg_takes_another_course(loop):
    loop, leg = leg_with_courses()
    before, state = legs(loop), content()
    call("next_course", leg=leg)
    moved = changes(before, legs(loop))
    assert moved[leg] == max(moved) > APART * diagonal(bpy.data.objects["Torus"])
    after = content()
    bpy.ops.ed.undo()
    assert content() == state
    bpy.ops.ed.redo()
    assert content() == after


def leg_with_courses():
    """The active curve, and a leg of it that can take more than one course."""
    for leg in range(4):
        if bpy.ops.nicmm.next_course("EXEC_DEFAULT", True, leg=leg) == {"FINISHED"}:
            bpy.ops.ed.undo()  # replaces Blender's Python objects
            return bpy.context.active_object, leg
    raise AssertionError("no leg has another course")


def test_via_points_of_other_legs_are_kept(loop):
    loop, leg = leg_with_courses()
    for number in range(4):
        points = legs(loop)[number]
        call("add_via_point", leg=number, position=tuple(points[len(points) // 2]))
    assert list(loop["nicmm_curve"]["via_legs"]) == [0, 1, 2, 3]
    call("next_course", leg=leg)
    kept = [number for number in range(4) if number != leg]
    assert list(loop["nicmm_curve"]["via_legs"]) == kept


def test_the_courses_of_a_leg_are_shown(choice, loop):
    loop, leg = leg_with_courses()
    before, state = legs(loop), content()
    assert choice.begin(leg) == {"RUNNING_MODAL"}
    shown = choice.overlay._state.shown
    energies = [course.energy for course in shown.courses]
    assert energies[0] == 1.0 and energies == sorted(energies) and len(energies) > 1
    choice.send("DOWN_ARROW")
    assert content() == state
    assert choice.send("RET") == {"FINISHED"}
    moved = changes(before, legs(loop))
    assert moved[leg] == max(moved) > APART * diagonal(bpy.data.objects["Torus"])


def test_the_leg_is_the_one_under_the_mouse(choice, loop, empty_scene, monkeypatch):
    picking = module(empty_scene, "tool.picking")
    error = module(empty_scene, "scene.messages").InputError
    loop, leg = leg_with_courses()
    hit = picking.Hit(picking.Kind.LINE, loop.name, leg + 1, (0.0, 0.0, 0.0), 0)
    monkeypatch.setattr(picking, "under_mouse", lambda _context, _pixel: hit)
    assert choice.press((1, 2)) == {"RUNNING_MODAL"}
    assert choice.operator.leg == leg
    choice.send("ESC")
    for other in (None, picking.Hit(picking.Kind.POINT, loop.name, 0, (0.0, 0.0, 0.0), 0)):
        monkeypatch.setattr(picking, "under_mouse", lambda _context, _pixel, hit=other: hit)
        with pytest.raises(error, match="over a leg of the active curve"):
            choice.press((1, 2))


def test_a_leg_that_does_not_exist(loop):
    before = content()
    assert "no leg 4" in refusal("next_course", leg=4)
    assert content() == before


def test_on_a_changed_surface_the_curve_is_updated_first(loop, torus):
    torus.modifiers.new("Subdivision", "SUBSURF").levels = 1
    assert "Run Update Curves first" in refusal("next_course", leg=0)
    call("update_curves")
    leg_with_courses()
