#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Drives the tool in a Blender window with mouse and keys, and takes a picture of each step.

    python3 build.py package
    python3 tests/window/drive.py dist/ZIP --shots FOLDER [--blender COMMAND] [--size 1422x800]

Needs Blender, Xvfb, xdotool and ImageMagick's `import` and `convert`. Of this project it needs only
the zip, so it runs with any Python 3. Each step checks the state of Blender; a failed step ends the
drive with an error. It is not part of the test suite, which has no window.
"""

import argparse
import math
import shutil
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from animation import animation  # noqa: E402
from designers import designers  # noqa: E402
from scans import crown, scans, snapping  # noqa: E402
from screen import (  # noqa: E402
    HOLD,
    PLACES,
    Blender,
    begin_choice,
    check,
    check_symmetric,
    choose_tool,
    click_places,
    count_points,
    drag,
    install,
    part_of_way,
    pixel_of,
    shift_drag,
    state,
    step,
    toggle_corner,
    undo_and_redo,
)

DRAGGED, JUMPING = 3, 1

SHIELD = ((-0.45, 0.1), (0.0, -0.05), (0.45, 0.1), (0.32, 0.45), (0.0, 0.72), (-0.32, 0.45))
"""Sideways and backwards on the crown of Suzanne's head; with three corners, a shield."""

ACROSS, BEHIND = ((-0.45, -0.05), (0.0, 0.0), (0.45, -0.05)), ((-0.42, 0.45), (0.0, 0.5))
"""Sideways and backwards on the crown: a curve across it, and the beginning of one behind it."""


HALF = ((0.3, 0.62), (0.45, -0.14), (-0.22, -0.62))
"""Sideways and upwards on the front of Suzanne's head, the last one on the other side."""


SMOOTHNESS = (230, 68)
"""Pixel of the field in the header."""


FRAME = 30.0
"""Milliseconds of CPU that a move of a drag may take by the median."""

OUTPUTS = (
    ("curve", 'output="CURVE"'),
    ("edges", 'output="EDGES"'),
    ("region", 'output="REGION", region_cut=True'),
    ("parts", 'output="PARTS", parts_as="OBJECTS"'),
)


def change_smoothness(blender: Blender) -> None:
    """Drag the field in the header."""
    drag(blender, SMOOTHNESS, 12, (6.0, 0.0))
    blender.mouse("mouseup", 1)
    smoothness = "helper.curve().nicmm_settings.smoothness"
    blender.wait(f"abs({smoothness} - 1.0) > 0.01", "the header changes the smoothness")


def draw(blender: Blender) -> None:
    """Five clicks, drags, inserting, removing, and another course."""
    step("Suzanne, and the tool in the toolbar")
    print(f"   {blender.do('value = helper.suzanne()')} triangles")
    blender.do("helper.look()")
    blender.do("helper.area().spaces.active.show_region_ui = False")
    choose_tool(blender)
    blender.do('bpy.ops.ed.undo_push(message="Start")')
    (place,) = blender.do(f"value = helper.pixels(helper.in_front({PLACES[:1]}))")
    blender.move(place)
    blender.shot("1-tool")

    step("Five points by clicking; each is one undo step")
    states = click_places(blender, blender.do(f"value = helper.in_front({PLACES})"))
    check(blender.do("value = helper.curve().data.splines[0].use_cyclic_u"), "a closed curve")
    undo_and_redo(blender, states, "clicks")
    blender.shot("2-five-points")
    drag_points(blender, states[-1])
    change_points(blender)


def drag_points(blender: Blender, drawn: str) -> None:
    """Drag points of a curve in a given state; Esc, undo and redo."""
    step("Drag one")
    blender.do("helper.frames.clear()")
    drag(blender, pixel_of(blender, DRAGGED), 40, (0.5, -1.5))
    blender.mouse("mouseup", 1)
    blender.wait(f"helper.state() != {drawn!r}", "the dragged curve")
    report_moves(blender)
    before = state(blender)
    step("Esc and right click during a drag change nothing")
    for cancel in ("key Escape", "click 3"):
        drag(blender, pixel_of(blender, DRAGGED), 10, (4.0, -4.0))
        blender.mouse(*cancel.split())
        time.sleep(0.5)
        blender.mouse("mouseup", 1)
        time.sleep(0.5)
        check(state(blender) == before, f"{cancel} changes nothing")
        check(blender.do("value = len(bpy.data.curves)") == 1, "no data are left behind")
    blender.key("Escape")
    time.sleep(0.5)
    check(state(blender) == before, "Esc at another time loses nothing")

    step("Drag another over the brow to the crown, where the curve is designed from scratch")
    drag(blender, pixel_of(blender, JUMPING), 10, (6.0, -8.0), "3-drag")
    blender.mouse("mouseup", 1)
    blender.wait(f"helper.state() != {before!r}", "the dragged curve")
    after = state(blender)
    blender.move(blender.do("value = helper.pixels([-1.3, 0, 0.9])")[0])
    blender.key("ctrl+z")
    blender.wait(f"helper.state() == {before!r}", "undo of the drag")
    blender.key("ctrl+shift+z")
    blender.wait(f"helper.state() == {after!r}", "redo of the drag")


def change_points(blender: Blender) -> None:
    """Insert a point and remove it; another course; a point that cannot be reached."""
    step("Insert on the curve, remove with Ctrl-click")
    middle = "[helper.line()[int(len(helper.line()) * 0.07)]]"
    (on_curve,) = blender.do(f"value = helper.pixels({middle})")
    blender.move(on_curve)
    blender.shot("4-on-the-line")
    blender.click(on_curve)
    count_points(blender, 6)
    time.sleep(0.6)
    blender.shot("4-inserted")
    inserted = blender.do("value = helper.pixels(helper.places())")
    nearest = min(range(6), key=lambda each: math.dist(inserted[each], on_curve))
    away = math.dist(inserted[nearest], on_curve)
    check(away < 4.0, f"the point is where the click was, {away:.1f} pixels away")
    blender.click(inserted[nearest], "ctrl")
    count_points(blender, 5)

    step("Next Course, and undo")
    before = state(blender)
    blender.move(blender.do("value = helper.pixels([-1.3, 0, 0.9])")[0])
    blender.do('with helper.in_view():\n    bpy.ops.nicmm.next_course("INVOKE_DEFAULT", True)')
    blender.wait(f"helper.state() != {before!r}", "another course")
    count_points(blender, 5)
    blender.shot("4-next-course")
    blender.key("ctrl+z")
    blender.wait(f"helper.state() == {before!r}", "undo of Next Course")

    step("A point on an eye, which is another part of the mesh: nothing changes")
    before = state(blender)
    (eye,) = blender.do("value = helper.pixels(helper.in_front([(0.35, 0.24)]))")
    blender.click(eye)
    time.sleep(2.0)
    check(state(blender) == before, "nothing changes")
    blender.shot("5-problem")
    close_message(blender)


def close_message(blender: Blender) -> None:
    """Close the message of an operator, which the next click would only close as well."""
    blender.key("Escape")
    time.sleep(0.5)


def report_moves(blender: Blender) -> None:
    """Print what the moves of a drag cost."""
    frames = blender.do("value = helper.frames")
    moves = sorted(spent for kind, waiting, spent in frames if kind == "MOUSEMOVE" and not waiting)
    if not moves:
        raise SystemExit("FAILED: no move was seen")
    median = moves[len(moves) // 2]
    print(
        f"   {len(moves)} moves: median {median:.0f} ms of CPU, most {moves[-1]:.0f} ms, "
        f"{sum(spent > FRAME for spent in moves)} above {FRAME:.0f} ms"
    )
    check(median <= FRAME, f"a move costs at most {FRAME:.0f} ms by the median")


def live_between(blender: Blender) -> None:
    """Between clicks everything else in Blender works, and all of it is in one undo history."""
    step("Between clicks: the navigation gizmo, the header, save, Tab, playback, undo and redo")
    count = blender.do("value = helper.count()")
    region = blender.do(
        "r = helper.region()\nvalue = [r.x + r.width, bpy.context.window.height - (r.y + r.height)]"
    )
    rotation = "list(helper.area().spaces.active.region_3d.view_rotation)"
    turned = blender.do(f"value = {rotation}")
    gizmo = (region[0] - 55, region[1] + 115)
    now = turned
    for _ in range(3):  # the gizmo is highlighted first, which takes a redraw
        for pixel in ((gizmo[0] - 1, gizmo[1]), gizmo):
            blender.move(pixel)
            time.sleep(HOLD)
        drag(blender, gizmo, 10, (8.0, 3.0))
        blender.mouse("mouseup", 1)
        time.sleep(1.0)
        now = blender.do(f"value = {rotation}")
        if now != turned:
            break
    check(now != turned, "the navigation gizmo turns the view")
    blender.do("helper.look()")
    before = state(blender)
    change_smoothness(blender)
    blender.shot("6-header")
    undo_and_redo(blender, [before, state(blender)], "of a setting")
    path = str(blender.folder / "head.blend")
    blender.do(f"bpy.ops.wm.save_as_mainfile(filepath={path!r})")
    saved = Path(path).stat().st_mtime_ns
    time.sleep(1.1)
    blender.key("ctrl+s")
    ends = time.monotonic() + 20.0
    while Path(path).stat().st_mtime_ns == saved and time.monotonic() < ends:
        time.sleep(0.2)
    check(Path(path).stat().st_mtime_ns > saved, "Ctrl-S saves")
    blender.do("helper.switch('Suzanne', 'OBJECT')")
    for mode in ("EDIT_MESH", "OBJECT"):
        blender.key("Tab")
        blender.wait(f"bpy.context.mode == {mode!r}", f"Tab to {mode}")
    blender.do("helper.activate()")
    frame = blender.do("value = bpy.context.scene.frame_current")
    blender.key("space")
    blender.wait(f"bpy.context.scene.frame_current >= {frame + 10}", "ten frames are played")
    blender.key("space")
    blender.wait("not bpy.context.screen.is_animation_playing", "playback stops")
    check(blender.do("value = helper.tool()") == "nicmm.surface_curve", "the tool is still chosen")
    count_points(blender, count)
    before = state(blender)
    blender.click(blender.do("value = helper.pixels(helper.in_front([(0.0, 0.75)]))")[0])
    count_points(blender, count + 1)
    time.sleep(0.6)
    blender.key("ctrl+z")
    blender.wait(f"helper.state() == {before!r}", "undo after these steps")


def corners(blender: Blender) -> None:
    """A key over a point makes it a corner; elsewhere nothing happens."""
    step("J over a point makes it a corner, and again makes the curve smooth there")
    blender.do("helper.suzanne()")
    blender.do("helper.look(0.15, 0.75, 1.0)")
    choose_tool(blender)
    blender.do('bpy.ops.ed.undo_push(message="Start")')
    states = click_places(blender, blender.do(f"value = helper.from_above({SHIELD})"))[-1:]
    blender.shot("18-no-corners")
    for number, wanted in ((4, [4]), (2, [2, 4]), (0, [0, 2, 4])):
        toggle_corner(blender, number, wanted)
        states.append(state(blender))
    beside = blender.do("value = helper.pixels([-1.2, 0, 1.2])")[0]
    blender.move(beside)
    blender.shot("18-corners")
    undo_and_redo(blender, states, "of corners")
    toggle_corner(blender, 2, [0, 4])

    step("J beside a point and beside the mesh changes nothing")
    before = state(blender)
    for pixel in (blender.do("value = helper.pixels(helper.from_above([(0, 0.3)]))")[0], beside):
        blender.move(pixel)
        time.sleep(0.5)
        blender.key("j")
        time.sleep(1.0)
        check(state(blender) == before, "nothing changes")

    step("A corner stays one while it is dragged")
    drag(blender, pixel_of(blender, 4), 20, (1.5, 1.0), "18-corner-dragged")
    blender.mouse("mouseup", 1)
    blender.wait(f"helper.state() != {before!r}", "the dragged curve")
    blender.wait("helper.corners() == [0, 4]", "the same corners")

    step("Normal Bending in the header and in the sidebar")
    before = state(blender)
    blender.do("helper.show_sidebar()")
    blender.do("helper.curve().nicmm_settings.normal_bending = 1.0")
    blender.wait(f"helper.state() != {before!r}", "another curve")
    blender.shot("19-normal-bending")
    blender.do("helper.area().spaces.active.show_region_ui = False")


def picking(blender: Blender) -> None:
    """Clicks act on what is visible: hidden parts, X-ray, other curves, other objects."""
    step("From the side: hidden parts are dimmed")
    blender.do("helper.look(1.0, -0.55, 0.25)")
    blender.shot("7-hidden-parts")
    blender.do("helper.look()")

    step(
        "Enter ends the curve; a click on the mesh begins another, a click on a curve activates it"
    )
    blender.move(blender.do("value = helper.pixels([-1.3, 0, 0.9])")[0])
    first = blender.do("value = helper.curve().name")
    blender.key("Return")
    blender.wait("helper.curve() is None", "the end")
    blender.shot("8-kept")
    blender.click(blender.do("value = helper.pixels(helper.in_front([(-0.1, 0.45)]))")[0])
    count_points(blender, 1)
    time.sleep(0.6)
    blender.click(blender.do("value = helper.pixels(helper.in_front([(0.12, -0.25)]))")[0])
    count_points(blender, 2)
    second = blender.do("value = helper.curve().name")
    check(second != first, "another curve")
    time.sleep(0.6)
    (on_first,) = blender.do(
        # The foremost point beside the middle is visible, and far from the second curve.
        f"line = bpy.data.objects[{first!r}].data.splines[0].points\n"
        "beside = [point.co for point in line if abs(point.co[0]) > 0.4]\n"
        "value = helper.pixels([list(min(beside, key=lambda place: place[1])[:3])])"
    )
    blender.move(on_first)
    time.sleep(0.5)
    blender.shot("11-other-curve")
    blender.click(on_first)
    blender.wait(f"helper.curve().name == {first!r}", "the curve under the mouse is active")

    step("X-ray: a point on the other side can be clicked")
    blender.do("helper.look(0.0, 1.0, 0.1)")
    time.sleep(0.5)
    count = blender.do("value = helper.count()")
    blender.do("helper.area().spaces.active.shading.show_xray = True")
    blender.shot("12-xray")
    blender.click(pixel_of(blender, 3), "ctrl")
    count_points(blender, count - 1)
    blender.key("ctrl+z")
    count_points(blender, count)
    blender.do("helper.area().spaces.active.shading.show_xray = False")
    before = state(blender)
    blender.click(pixel_of(blender, 3), "ctrl")
    time.sleep(2.0)
    check(blender.do("value = helper.count()") >= count, "without X-ray it cannot be clicked")
    if state(blender) != before:  # the click has added a point on the surface in front
        blender.key("ctrl+z")
        blender.wait(f"helper.state() == {before!r}", "undo of the click")
    blender.do("helper.look()")

    step("A click beside the mesh selects")
    blender.do("helper.cube()")
    time.sleep(0.5)
    blender.do("helper.activate()")
    blender.click(blender.do("value = helper.pixels([1.9, 0, 0.9])")[0])
    blender.wait("bpy.context.active_object.name == 'Cube'", "the cube is selected")
    blender.do("bpy.data.objects.remove(bpy.data.objects['Cube'])\nhelper.activate()")


def ridge(blender: Blender) -> None:
    """A tube whose centre line is hidden by a ridge, and views of other kinds."""
    step("A tube just over a ridge can be clicked where it is visible")
    blender.do("helper.ridge()")
    choose_tool(blender)
    blender.do("helper.look(0.0, -1.0, 0.25, 6.0)")
    blender.shot("13-ridge")
    name = blender.do("value = helper.curve().name")
    top = blender.do("value = helper.top_of_tube()")
    blender.do("helper.switch('Ridge', 'OBJECT')")
    time.sleep(0.5)
    (pixel,) = blender.do(f"value = helper.pixels({top}, 'Ridge')")
    blender.move(pixel)
    time.sleep(0.5)
    blender.shot("13-ridge-hover")
    blender.click(pixel)
    blender.wait(f"helper.curve() and helper.curve().name == {name!r}", "the tube is activated")

    step("Orthographic view, camera, local view, quad view")
    for change, back in (
        ("helper.area().spaces.active.region_3d.view_perspective = 'ORTHO'", "helper.look()"),
        ("helper.camera()", "helper.look()"),
        ("helper.local_view()", "helper.local_view()"),
        ("helper.quad_view()", "helper.quad_view()"),
    ):
        blender.do("helper.suzanne()")
        blender.do("helper.look()")
        blender.do(change)
        time.sleep(1.0)
        blender.do("helper.activate_mesh()")
        places = blender.do(f"value = helper.in_front({PLACES[:3]})")
        click_places(blender, places)
        found = blender.do("value = helper.pixels(helper.places())")
        wanted = blender.do(f"value = helper.pixels({places})")
        check(
            all(math.dist(*pair) < 1.5 for pair in zip(found, wanted, strict=True)),
            f"points are where the clicks were ({change})",
        )
        blender.shot("14-" + "".join(c for c in change if c.isalpha())[-10:].lower())
        blender.do(back)


def other_bodies(blender: Blender) -> None:
    """A subdivided, a mirrored and a posed body."""
    for name, places in (
        ("subdivided", PLACES),
        ("mirrored", ((-0.4, 0.5), (0.4, 0.5), (0.4, -0.1), (-0.4, -0.1))),
        ("posed", ((-0.3, 0.65), (0.3, 0.65), (0.12, -0.6), (-0.12, -0.6))),
    ):
        step(f"A {name} body: clicks, undo and redo")
        blender.do(f"helper.body({name!r})")
        blender.do("helper.look()")
        choose_tool(blender)
        blender.do('bpy.ops.ed.undo_push(message="Start")')
        states = click_places(blender, blender.do(f"value = helper.shown_in_front({places})"))
        away = blender.do("value = helper.away()")
        check(away < 1e-4, f"the curve is on the shown surface ({away} diagonals)")
        undo_and_redo(blender, states, f"on the {name} body")
        drag(blender, pixel_of(blender, 2), 10, (1.0, -2.0))
        blender.mouse("mouseup", 1)
        blender.wait(f"helper.state() != {states[-1]!r}", "the dragged curve")
        blender.shot(f"15-{name}")


def other_modes(blender: Blender) -> None:
    """In Sculpt Mode and Weight Paint n clicks are n undo steps."""
    for mode, tool in (
        ("SCULPT", "nicmm.surface_curve_sculpt"),
        ("WEIGHT_PAINT", "nicmm.surface_curve_weights"),
    ):
        step(f"{mode}: five clicks are five undo steps")
        blender.do("helper.suzanne()")
        blender.do("helper.look()")
        blender.do(f"helper.switch('Suzanne', {mode!r})")
        choose_tool(blender, tool)
        blender.do('bpy.ops.ed.undo_push(message="Start")')
        places = blender.do(f"value = helper.in_front({PLACES})")
        mesh = blender.do("value = helper.shape('Suzanne')")
        states = click_places(blender, places)
        blender.shot(f"16-{mode.lower()}")
        undo_and_redo(blender, states, f"in {mode}")
        check(blender.do("value = helper.shape('Suzanne')") == mesh, "the mesh is unchanged")
        change_smoothness(blender)
        time.sleep(1.0)
        blender.shot(f"17-{mode.lower()}-header")
        undo_and_redo(blender, [states[-1], state(blender)], f"of a setting in {mode}")
        drag(blender, pixel_of(blender, 2), 10, (1.0, -2.0))
        blender.mouse("mouseup", 1)
        blender.wait(f"helper.state() != {states[-1]!r}", "the dragged curve")
        time.sleep(0.6)
        dragged = state(blender)
        toggle_corner(blender, 2, [2])
        undo_and_redo(blender, [dragged, state(blender)], f"of a corner in {mode}")
        blender.do("helper.switch('Suzanne', 'OBJECT')")


def keys(blender: Blender) -> None:
    """The keymap editor, the Industry Compatible keymap, and Emulate 3 Button Mouse."""
    step("The tool's keys are in the keymap editor, with one letter")
    found = blender.do(
        "maps = bpy.context.window_manager.keyconfigs.user.keymaps\n"
        "value = [[each.name, [[item.idname, item.type, item.value] for item in each.keymap_items]]"
        " for each in maps if each.name.endswith('Surface Curve')]"
    )
    check(len(found) == 3, "a keymap for each mode")
    for name, items in found:
        check(len(items) == 11, f"eleven items in {name}")
        letters = [kind for _, kind, _ in items if len(kind) == 1]
        check(letters == ["J"], f"one letter in {name}")
    for config in ("Industry_Compatible", "Blender"):
        step(f"The keymap {config}")
        blender.do(f"helper.keymap({config!r})")
        blender.do("helper.suzanne()")
        blender.do("helper.look()")
        choose_tool(blender)
        blender.do('bpy.ops.ed.undo_push(message="Start")')
        states = click_places(blender, blender.do(f"value = helper.in_front({PLACES})"))
        undo_and_redo(blender, states, f"with {config}")
        drag(blender, pixel_of(blender, 2), 10, (1.0, -2.0))
        blender.mouse("mouseup", 1)
        blender.wait(f"helper.state() != {states[-1]!r}", "the dragged curve")
        blender.click(pixel_of(blender, 3), "ctrl")
        count_points(blender, 4)
        blender.move(blender.do("value = helper.pixels([-1.3, 0, 0.9])")[0])
        blender.key("Return")
        blender.wait("helper.curve() is None", "Enter")
    step("Emulate 3 Button Mouse: Alt-drag turns the view")
    blender.do("bpy.context.preferences.inputs.use_mouse_emulate_3_button = True")
    before = state(blender)
    rotation = "list(helper.area().spaces.active.region_3d.view_rotation)"
    turned = blender.do(f"value = {rotation}")
    (middle,) = blender.do("value = helper.pixels(helper.in_front([(0.0, 0.5)]))")
    blender.move(middle)
    blender.mouse("keydown", "alt")
    time.sleep(HOLD)
    drag(blender, middle, 10, (8.0, 3.0))
    time.sleep(HOLD)
    blender.mouse("mouseup", 1)
    blender.mouse("keyup", "alt")
    time.sleep(1.0)
    check(blender.do(f"value = {rotation}") != turned, "the view is turned")
    check(state(blender) == before, "no point is added")
    blender.do("bpy.context.preferences.inputs.use_mouse_emulate_3_button = False")


def courses(blender: Blender) -> None:
    """Choose Course: the preview, with keys, wheel and mouse; cancel and undo."""
    step("Five points, and Choose Course with Shift Enter")
    blender.do("helper.suzanne()")
    blender.do("helper.look()")
    choose_tool(blender)
    blender.do('bpy.ops.ed.undo_push(message="Start")')
    click_places(blender, blender.do(f"value = helper.in_front({PLACES})"))
    before = state(blender)
    beside = blender.do("value = helper.pixels([-1.3, 0, 0.9])")[0]
    blender.move(beside)
    begin_choice(blender)
    blender.shot("18-courses")
    count, first = blender.do("value = helper.courses()")
    check(count > 1, "several courses")

    def wait_for(number: int, why: str) -> None:
        blender.wait(f"helper.courses() == [{count}, {number % count}]", why)

    step("Wheel, arrow keys and Shift Enter change the choice; Esc cancels")
    blender.mouse("click", 5)
    wait_for(first + 1, "the wheel")
    blender.key("Down")
    wait_for(first + 2, "an arrow key")
    blender.key("shift+Return")
    wait_for(first + 3, "Shift Enter")
    for step_back in (2, 1):
        blender.key("Up")
        wait_for(first + step_back, "an arrow key back")
    blender.shot("4-choose-course")
    check(state(blender) == before, "nothing changes during the choice")
    blender.key("Escape")
    blender.wait("not helper.is_modal()", "the end of the choice")
    check(state(blender) == before, "Esc changes nothing")

    step("A click chooses a course; Enter confirms; one undo step")
    begin_choice(blender)
    other, pixel = blender.do("value = helper.another_course()")
    blender.click(pixel)
    wait_for(other, "the course under the mouse")
    blender.key("Return")
    blender.wait(f"helper.state() != {before!r}", "the chosen course")
    blender.wait("not helper.is_modal()", "the end of the choice")
    count_points(blender, len(PLACES))
    blender.shot("18-chosen-course")
    undo_and_redo(blender, [before, state(blender)], "of the choice")

    step("Ctrl Shift Enter shows the courses of the leg under the mouse")
    before = state(blender)
    points = blender.do("value = helper.places()")
    for leg in range(len(PLACES)):  # some have no other course
        blender.move(blender.do(f"value = helper.pixels(helper.middle_of_leg({leg}))")[0])
        time.sleep(0.5)
        blender.key("ctrl+shift+Return")
        time.sleep(0.5)
        blender.wait("not helper.is_in_time_slices()", "the search")
        time.sleep(0.5)
        if blender.do("value = helper.courses()"):
            break
    check(blender.do("value = helper.courses()") is not None, "another course of a leg")
    blender.mouse("click", 5)
    blender.shot("18-leg")
    blender.key("Return")
    blender.wait(f"helper.state() != {before!r}", "another course of the leg")
    blender.wait("not helper.is_modal()", "the end of the choice")
    check(blender.do("value = helper.places()") == points, "the points stay")
    blender.shot("18-leg-chosen")
    undo_and_redo(blender, [before, state(blender)], "of the course of a leg")
    blender.move(beside)
    blender.key("ctrl+shift+Return")
    time.sleep(1.0)
    check(not blender.do("value = helper.is_modal()"), "beside the curve there is no choice")
    close_message(blender)


def via_points(blender: Blender) -> None:
    """Via points: Shift-drag from the curve, drag one again, Ctrl-click; Esc and undo."""
    step("Two points on an open curve; Shift-drag from the curve adds a via point")
    blender.do("helper.suzanne()")
    blender.do("helper.look()")
    choose_tool(blender)
    blender.do("bpy.context.scene.nicmm_curves.closed = False")
    blender.do('bpy.ops.ed.undo_push(message="Start")')
    ends = blender.do("value = helper.in_front([(-0.42, 0.62), (0.42, 0.62)])")
    states = click_places(blender, ends)
    plain = states[-1]
    count = "len(helper.curve()['nicmm_curve'].get('via_legs', []))"
    (on_curve,) = blender.do("value = helper.pixels([helper.line()[len(helper.line()) // 2]])")
    muzzle, mouth = blender.do("value = helper.pixels(helper.in_front([(0, -0.45), (0, -0.75)]))")
    shift_drag(blender, on_curve, 10, part_of_way(on_curve, muzzle, 10), "19-via-dragged")
    blender.mouse("mouseup", 1)
    blender.mouse("keyup", "shift")
    blender.wait(f"{count} == 1", "the via point")
    blender.wait("not helper.is_modal()", "the curve near the via point")
    count_points(blender, 2)
    added = state(blender)
    blender.move(blender.do("value = helper.pixels([-1.3, 0, 0.9])")[0])
    blender.shot("19-via-point")
    step("Esc during a drag of the via point changes nothing; then drag it")
    (ring,) = blender.do("value = helper.pixels(helper.via_places())")
    drag(blender, ring, 10, (3.0, -6.0))
    blender.key("Escape")
    time.sleep(0.5)
    blender.mouse("mouseup", 1)
    time.sleep(0.5)
    check(state(blender) == added, "Esc changes nothing")
    drag(blender, ring, 10, part_of_way(ring, mouth, 10))
    blender.mouse("mouseup", 1)
    blender.wait(f"helper.state() != {added!r}", "the moved via point")
    blender.wait("not helper.is_modal()", "the curve near the via point")
    moved = state(blender)
    blender.move(blender.do("value = helper.pixels([-1.3, 0, 0.9])")[0])
    blender.shot("4-via-point")
    step("Ctrl-click removes it; undo and redo")
    (ring,) = blender.do("value = helper.pixels(helper.via_places())")
    blender.click(ring, "ctrl")
    blender.wait(f"{count} == 0", "the via point is removed")
    blender.wait("not helper.is_modal()", "the curve without it")
    undo_and_redo(blender, [plain, added, moved, state(blender)], "of via points")
    step("Shift-click beside the curve adds nothing")
    before = state(blender)
    (middle,) = blender.do("value = helper.pixels(helper.in_front([(0.0, -0.2)]))")
    blender.click(middle, "shift")
    time.sleep(1.0)
    check(state(blender) == before, "no point is added")
    blender.do("bpy.context.scene.nicmm_curves.closed = True")


def symmetry(blender: Blender) -> None:
    """A curve joined to its mirror image on a mirrored body, its images, the plane, and a pair."""
    step("A mirrored body: three clicks, one of them on the other side; the Mirror modifier")
    blender.do("helper.body('mirrored')")
    blender.do("helper.look()")
    choose_tool(blender)
    blender.do("helper.show_sidebar()")
    blender.do("bpy.context.scene.nicmm_curves.mirror_axis = 'MODIFIER'")
    blender.do('bpy.ops.ed.undo_push(message="Start")')
    places = blender.do(f"value = helper.shown_in_front({HALF})")
    blender.shot("24-mirror-modifier")
    states = click_places(blender, places)
    blender.move(blender.do("value = helper.pixels([-1.3, 0, 0.9])")[0])
    blender.shot("24-joined")
    check(blender.do("value = min(x for x, _, _ in helper.places())") > 0.0, "points of one side")
    check_symmetric(blender)
    undo_and_redo(blender, states, "of a symmetric curve")

    step("Where the curve crosses the plane, the mark and the point snap to it")
    blender.do("helper.look(0.15, -0.7, -1.0)")  # the chin from below
    on_plane = "min(helper.line(), key=lambda place: (place[2] > 0.0, abs(place[0])))"
    (chin,) = blender.do(f"value = helper.pixels([{on_plane}])")
    beside = chin[0] + 4, chin[1]
    blender.move(beside)
    time.sleep(1.0)
    blender.shot("24-snapped")
    blender.click(beside)
    count_points(blender, 4)
    check(abs(blender.do("value = helper.places()[3][0]")) < 1e-5, "a point on the plane")
    blender.do("helper.look()")
    check_symmetric(blender)
    time.sleep(0.6)

    step("Drag a mirror image: its point follows; J and Ctrl-click act on the point")
    before, old = state(blender), blender.do("value = helper.places()[1]")
    (image,) = blender.do("value = helper.pixels(helper.image_places()[1])")
    drag(blender, image, 10, (1.0, 2.0), "24-image-dragged")
    blender.mouse("mouseup", 1)
    blender.wait(f"helper.state() != {before!r}", "the dragged curve")
    new = blender.do("value = helper.places()[1]")
    check(new[0] > 0.0 and math.dist(old, new) > 0.02, "the point of one side moves")
    check_symmetric(blender)
    dragged = state(blender)
    (image,) = blender.do("value = helper.pixels(helper.image_places()[2])")
    blender.move(image)
    time.sleep(0.5)
    blender.key("j")
    blender.wait("helper.corners() == [2]", "a corner")
    blender.move(blender.do("value = helper.pixels([-1.3, 0, 0.9])")[0])
    blender.shot("24-corner-of-image")
    cornered = state(blender)
    (image,) = blender.do("value = helper.pixels(helper.image_places()[0])")
    blender.click(image, "ctrl")
    count_points(blender, 3)
    undo_and_redo(blender, [before, dragged, cornered, state(blender)], "of images")
    for _ in range(2):
        blender.key("ctrl+z")
    blender.wait(f"helper.state() == {dragged!r}", "undo")

    step("A click on the other half inserts the mirror image; drag it away from there")
    (on_image,) = blender.do("value = helper.pixels(helper.mirrored_middle_of_leg(1))")
    drag(blender, on_image, 10, (1.0, -2.0))
    blender.mouse("mouseup", 1)
    count_points(blender, 5)
    check(blender.do("value = min(x for x, _, _ in helper.places())") > -1e-5, "on one side")
    check_symmetric(blender)
    time.sleep(0.6)
    blender.key("ctrl+z")
    blender.wait(f"helper.state() == {dragged!r}", "undo")

    step("Pair: two splines; drag a point, and an image")
    blender.do("helper.curve().nicmm_settings.mirror_as = 'PAIR'")
    blender.wait("len(helper.curve().data.splines) == 2", "a pair")
    blender.shot("24-pair")
    for name, number in (("places", 0), ("image_places", 1)):
        before = state(blender)
        (pixel,) = blender.do(f"value = helper.pixels(helper.{name}()[{number}])")
        drag(blender, pixel, 10, (1.0, -2.0), f"24-pair-{name}")
        blender.mouse("mouseup", 1)
        blender.wait(f"helper.state() != {before!r}", "the dragged pair")
        blender.wait("not helper.is_modal()", "the end")
        check(blender.do("value = len(helper.curve().data.splines)") == 2, "still a pair")
        check_symmetric(blender)
        time.sleep(0.6)
    blender.do("bpy.context.scene.nicmm_curves.mirror_axis = 'NONE'")
    blender.do("helper.area().spaces.active.show_region_ui = False")


def several(blender: Blender) -> None:
    """A curve that avoids another one, ends on it, and follows it."""
    step("A curve across the crown")
    blender.do("helper.suzanne()")
    blender.do("helper.look(0.05, -0.15, 1.0, 3.0)")
    choose_tool(blender)
    blender.do("bpy.context.scene.nicmm_curves.closed = False")
    click_places(blender, blender.do(f"value = helper.from_above({ACROSS})"))
    blender.do("helper.curve().name = 'First'")
    beside = (150, 650)
    blender.move(beside)
    blender.key("Return")
    blender.wait("helper.curve() is None", "the end")
    step("A second one behind it; a click on the first one makes a junction")
    blender.do(
        "panel = bpy.context.scene.nicmm_curves\n"
        "panel.avoid_others, panel.clearance = True, 0.1\n"
        'bpy.ops.ed.undo_push(message="Settings")'
    )
    click_places(blender, blender.do(f"value = helper.from_above({BEHIND})"))
    blender.do("helper.curve().name = 'Second'")
    (pixel,) = blender.do("value = helper.pixels(helper.middle_of_other('First', 1))")
    blender.move((pixel[0] + 3, pixel[1] + 3))  # near the curve, not exactly on it
    blender.shot("18-junction-before")
    blender.click((pixel[0] + 3, pixel[1] + 3))
    count_points(blender, 3)
    check(blender.do("value = helper.junctions()") == [[2, "First"]], "a junction")
    blender.move(beside)
    blender.shot("19-junction")
    drag_first(blender, beside)
    blender.do("bpy.context.scene.nicmm_curves.avoid_others = False")
    blender.do("bpy.context.scene.nicmm_curves.closed = True")


def drag_first(blender: Blender, beside) -> None:
    """Drag the first curve, which the second follows; then a point of the second onto the first."""
    step("A drag of the first curve takes the second along, in one undo step")
    blender.do("helper.switch('First', 'OBJECT')")
    blender.do('bpy.ops.ed.undo_push(message="Activate")')
    before = state(blender)
    second = blender.do("value = helper.points_of('Second')")
    drag(blender, pixel_of(blender, 1), 20, (0.0, -2.5), "20-first-dragged")
    check(blender.do("value = helper.points_of('Second')") == second, "it waits for the release")
    blender.mouse("mouseup", 1)
    blender.wait("not helper.is_modal()", "the end of the drag")
    blender.wait(f"helper.points_of('Second') != {second!r}", "the second curve follows")
    after = state(blender)
    blender.move(beside)
    blender.shot("21-second-follows")
    blender.key("ctrl+z")
    blender.wait(f"helper.state() == {before!r}", "undo of both")
    blender.key("ctrl+shift+z")
    blender.wait(f"helper.state() == {after!r}", "redo of both")

    step("A point of the second curve snaps to the first one while it is dragged")
    blender.do("helper.switch('Second', 'OBJECT')")
    blender.do('bpy.ops.ed.undo_push(message="Activate")')
    (start,) = blender.do("value = helper.pixels(helper.places()[0])")
    (end,) = blender.do("value = helper.pixels(helper.middle_of_other('First', 0))")
    drag(blender, start, 20, part_of_way(start, end, 20), "22-snapped")
    blender.mouse("mouseup", 1)
    blender.wait("not helper.is_modal()", "the end of the drag")
    blender.wait("len(helper.junctions()) == 2", "another junction")
    blender.do("helper.show_sidebar()")
    blender.move(beside)
    blender.shot("23-list")
    blender.do("helper.area().spaces.active.show_region_ui = False")


def large(blender: Blender) -> None:
    """Moves on 126k faces, and the first clicks on 2M faces."""
    step("126k faces: the moves of a drag")
    print(f"   {blender.do('value = helper.suzanne(4)')} triangles")
    blender.do("helper.look()")
    choose_tool(blender)
    click_places(blender, blender.do(f"value = helper.in_front({PLACES})"))
    before = state(blender)
    blender.do("helper.frames.clear()")
    drag(blender, pixel_of(blender, DRAGGED), 40, (0.5, -1.5))
    blender.mouse("mouseup", 1)
    blender.wait(f"helper.state() != {before!r}", "the dragged curve")
    report_moves(blender)

    step("2M quads: the first clicks")
    print(f"   {blender.do('value = helper.suzanne(6)')} triangles")
    blender.do("helper.look()")
    pixels = blender.do(f"value = helper.pixels(helper.in_front({PLACES}))")
    time.sleep(10.0)  # until Blender has drawn it
    for number, pixel in enumerate(pixels[:3], start=1):
        blender.click(pixel)
        gaps, started, shown, count = [], time.monotonic(), False, -1
        while count != number:
            before = time.monotonic()
            count = blender.do("value = helper.count()")
            gaps.append(time.monotonic() - before)
            if not shown and number < 3 and time.monotonic() - started > 3.0:
                shown = True
                blender.shot(f"17-large-{number}")
        print(
            f"   click {number}: {time.monotonic() - started:.1f} s, the window blocked for at "
            f"most {max(gaps):.1f} s"
        )
        time.sleep(0.6)
    for count, why in ((-1, "while the mesh is prepared"), (1, "while the curve is designed")):
        step(f"2M quads: Esc {why}")
        blender.do("helper.suzanne(6)\nhelper.forget()")
        pixels = blender.do(f"value = helper.pixels(helper.in_front({PLACES}))")
        time.sleep(10.0)
        if count == 1:
            blender.click(pixels[1])
            count_points(blender, 1)
            time.sleep(1.0)
        blender.click(pixels[0])
        blender.wait("helper.is_in_time_slices()", "work to cancel")
        pressed = time.monotonic()
        blender.key("Escape")
        blender.wait("not helper.is_modal()", "Esc")
        print(f"   Esc takes effect within {time.monotonic() - pressed:.1f} s")
        left = blender.do("value = helper.count()")
        check(left == count, f"Esc leaves {count} points ({left})")

    step("2M quads: the first click beside the mesh prepares it and ends")
    blender.do("helper.suzanne(6)\nhelper.forget()")
    beside = (150, 650)
    time.sleep(10.0)
    blender.click(beside)
    blender.wait("helper.is_in_time_slices()", "the preparation of the mesh")
    blender.wait("not helper.is_modal()", "the end of the preparation")


def methods(blender: Blender) -> None:
    """The network of the paper without PyTorch: the curve is shown as it develops; Esc stops."""
    step("NICMM (Neural) without PyTorch")
    blender.do("helper.suzanne(levels=3)")
    blender.do("helper.look()")
    blender.do("import sys; sys.modules['torch'] = None")  # every import of it fails
    before = blender.do("value = len(bpy.data.curves)")
    points = ", ".join(
        " ".join(f"{value:.5f}" for value in place)
        for place in blender.do(f"value = helper.in_front({PLACES})")
    )
    for stopped in (True, False):
        blender.do(
            "with helper.in_view():\n"
            '    bpy.ops.nicmm.design_curve("INVOKE_DEFAULT", method="NICMM", '
            f'order="SHORTEST", points={points!r})'
        )
        blender.wait("helper.is_in_time_slices()", "work in time slices")
        if stopped:
            time.sleep(3.0)
            blender.shot("12-neural-developing")
            check(blender.do("value = helper.is_modal()"), "the network is still fitted")
            blender.key("Escape")
        blender.wait("not helper.is_in_time_slices()", "the end")
        if stopped:
            after = blender.do("value = len(bpy.data.curves)")
            check(after == before, "Esc leaves no curve")
    blender.wait(f"len(bpy.data.curves) == {before + 1}", "the curve of the network")
    check(blender.do("value = len(helper.line())") > 20, "a curve with many points")
    blender.shot("13-neural")
    blender.do("import sys; del sys.modules['torch']")  # newer versions of SciPy look it up there


def convert(blender: Blender) -> None:
    """Save, open again, edit again; every output."""
    step("Save, open again, and edit again")
    blender.do("helper.suzanne()")
    blender.do("helper.look()")
    choose_tool(blender)
    click_places(blender, blender.do(f"value = helper.in_front({PLACES})"))
    blender.move(blender.do("value = helper.pixels([-1.3, 0, 0.9])")[0])
    blender.key("Return")
    blender.wait("helper.curve() is None", "the end")
    path = str(blender.folder / "again.blend")
    blender.do(f"bpy.ops.wm.save_as_mainfile(filepath={path!r})")
    open_again(blender, path)
    blender.do("helper.activate_mesh()")
    choose_tool(blender)
    (on_curve,) = blender.do(
        "line = bpy.data.objects['Suzanne Curve'].data.splines[0].points\n"
        # The foremost point beside the middle is visible, and far from the second curve.
        "beside = [point.co for point in line if abs(point.co[0]) > 0.4]\n"
        "value = helper.pixels([list(min(beside, key=lambda place: place[1])[:3])])"
    )
    blender.click(on_curve)
    count_points(blender, 5)
    time.sleep(0.6)
    drag(blender, pixel_of(blender, 1), 20, (0.0, -2.0))
    blender.mouse("mouseup", 1)
    time.sleep(1.5)
    blender.shot("9-edited-again")

    step("Sticky curves from the menu")
    open_again(blender, path)
    convert_to_sticky_curves(blender)
    blender.wait("any(o.type == 'CURVES' for o in bpy.data.objects)", "a sticky curve")
    tube = blender.do(
        "shown = bpy.context.evaluated_depsgraph_get().object_instances\n"
        "value = any(each.parent and each.parent.type == 'CURVES' for each in shown)"
    )
    few_points = blender.do("value = bpy.app.version < (5, 0, 0)")
    check(tube == few_points, "a tube where Blender draws strands with a few points")
    blender.shot("10-sticky")

    step("Every other output")
    for name, arguments in OUTPUTS:
        open_again(blender, path)
        check(
            blender.do(
                "with helper.in_view():\n"
                f'    value = list(bpy.ops.nicmm.convert_curve("INVOKE_DEFAULT", {arguments}))'
            )
            == ["FINISHED"],
            f"convert to {name}",
        )
        if name in ("edges", "region"):
            blender.do("with helper.in_view():\n    bpy.ops.object.mode_set(mode='EDIT')")
        if name == "parts":
            blender.do(
                "for found in bpy.context.scene.objects:\n"
                "    found.location.y -= 0.6 * (found.name != 'Suzanne')"
            )
        blender.shot(f"10-{name}")


PARTS = {
    "draw": draw,
    "live": live_between,
    "picking": picking,
    "ridge": ridge,
    "corners": corners,
    "bodies": other_bodies,
    "modes": other_modes,
    "methods": methods,
    "convert": convert,
    "keys": keys,
    "courses": courses,
    "via": via_points,
    "several": several,
    "symmetry": symmetry,
    "designers": designers,
    "scans": scans,
    "crown": crown,
    "snapping": snapping,
    "animation": animation,
    "large": large,
}
"""Parts of the drive; `live` and `picking` continue with the curve of `draw`."""


def open_again(blender: Blender, path: str) -> None:
    blender.do(f"bpy.ops.wm.open_mainfile(filepath={path!r})")
    blender.wait("'Suzanne Curve' in bpy.data.objects", "the file")
    blender.do("helper.look()\nhelper.activate()")


def convert_to_sticky_curves(blender: Blender) -> None:
    """Object > Convert > Convert Designed Curve > Sticky Curves, with the keys."""
    blender.move(blender.do("value = helper.pixels([0, -0.8, 0])")[0])
    blender.do('with helper.in_view():\n    bpy.ops.wm.call_menu(name="VIEW3D_MT_object_convert")')
    # The entry of the extension is the last one; choose the second entry of the submenu.
    for key in ("Up", "Right", "Down", "Return"):
        time.sleep(1.0)
        blender.key(key)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("archive", type=Path, help="zip of the extension for this Blender")
    parser.add_argument("--shots", type=Path, required=True, help="folder for the pictures")
    parser.add_argument("--blender", default="blender", help="how to call Blender")
    parser.add_argument("--size", default="1422x800", help="of the screen")
    parser.add_argument("--parts", default=",".join(PARTS), help="parts of the drive")
    arguments = parser.parse_args()
    missing = [tool for tool in ("Xvfb", "xdotool", "import", "convert") if not shutil.which(tool)]
    if missing:
        sys.exit(f"{', '.join(missing)}: not found. Install Xvfb, xdotool and ImageMagick")
    arguments.shots.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        blender = Blender(
            arguments.blender, arguments.size, Path(folder), arguments.shots.resolve()
        )
        try:
            install(blender, arguments.archive.resolve())
            for name in arguments.parts.split(","):
                PARTS[name](blender)
        finally:
            print(blender.log())
            blender.close()
    step("All steps done")


if __name__ == "__main__":
    main()
