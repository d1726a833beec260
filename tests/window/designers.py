# SPDX-License-Identifier: GPL-3.0-or-later
"""Three jobs of designers, a part of `drive.py`; the bodies are those of `bodies.py`.

A seam on a mirrored dress form, panel lines on a car with a bevel, and straps on a posed figure.
"""

import math
import time

from screen import (
    Blender,
    begin_choice,
    check,
    check_symmetric,
    choose_tool,
    click_places,
    count_points,
    drag,
    part_of_way,
    state,
    step,
    toggle_corner,
    undo_and_redo,
)

BESIDE = (150, 650)
"""A pixel of the viewport where no body is."""

ON_SURFACE = 1e-4
"""Greatest distance of a curve from the shown surface, in diagonals."""

ON_CURVE = 2e-3
"""Greatest distance between points of curve objects that meet, which are those of even splines."""

SEAM = ((0.10, -0.1, 0.74), (-0.27, -0.2, 0.36), (0.15, -0.2, -0.12))
"""On the front of the dress form, the second one on the other side."""

DOOR = (
    (0.5, -0.34, -0.18),
    (0.5, -0.34, 0.10),
    (0.38, -0.02, 0.38),
    (0.38, 0.26, 0.38),
    (0.5, 0.26, -0.18),
)
CORNERS = (0, 2, 3, 4)
SILL = ((0.5, -0.46, -0.34), (0.5, 0.46, -0.34))
MOULDING = ((0.48, -1.05, -0.10), (0.49, -0.7, -0.04))
LOWER = (0.5, -0.30, -0.25)
"""Places on the side of the car; the last one is where a corner of the door is dragged."""

CLEARANCE, UPWARDS = 0.12, 0.65
"""Distance of the sill from the door, and how far up its front edge the moulding ends."""

STRAP = ((0.11, 0.0, 0.52), (0.0, 0.0, 0.30), (-0.12, 0.0, 0.06))
GARTER = ((0.17, -0.05, -0.27), (0.12, -0.08, -0.29), (0.07, -0.05, -0.27))
"""Inside the figure: from a shoulder to the hip, and across a thigh."""

BEHIND = 0.02
"""Depth that a curve reaches only behind the body or the thigh."""

NEW_POSE = {"Chest": (0.1, -0.3, 0.1), "Knee.L": (-0.95, 0.0, 0.12)}
"""Angles of bones."""


def designers(blender: Blender) -> None:
    """A mirrored body, a car with a bevel, and a posed figure."""
    blender.do("helper.area().spaces.active.show_region_ui = False")
    blender.do("bodies.dress_form()\nhelper.look(0.35, -1.0, 0.12, 2.9)")
    dress(blender)
    blender.do("bodies.car()\nhelper.look(1.0, -0.5, 0.3, 3.3)")
    panels(blender)
    blender.do("bodies.figure()\nhelper.look(0.3, -1.0, 0.1, 2.7)")
    straps(blender)


def dress(blender: Blender) -> None:
    """A seam joined to its mirror image; a mirror image of a point is dragged."""
    step("A dress form with a Mirror modifier: a symmetric seam by three clicks")
    begin(blender, mirror_axis="MODIFIER", mirror_as="JOINED")
    states = click_seen(blender, SEAM, "Dress Form")
    check(blender.do("value = min(x for x, _, _ in helper.places())") > 0.0, "points of one side")
    check_symmetric(blender)
    check_on_surface(blender, "Dress Form")
    undo_and_redo(blender, states, "of the seam", BESIDE)
    blender.shot("25-seam")

    step("Drag the mirror image of a point")
    before, old = state(blender), blender.do("value = helper.places()[1]")
    (image,) = blender.do("value = helper.pixels(helper.image_places()[1], 'Dress Form')")
    drag(blender, image, 10, (1.5, -4.0), "11-seam")
    release(blender, before)
    new = blender.do("value = helper.places()[1]")
    check(new[0] > 0.0 and math.dist(old, new) > 0.05, "the point of one side moves")
    check_symmetric(blender)
    check_on_surface(blender, "Dress Form")
    undo_and_redo(blender, [before, state(blender)], "of the drag", BESIDE)
    change(blender, mirror_axis="NONE")


def panels(blender: Blender) -> None:
    """A door with corners; two lines that avoid it, one of which ends on it; both follow it."""
    step("A car with a Bevel modifier: a door with four corners")
    begin(blender)
    states = click_seen(blender, DOOR, "Car")[-1:]
    for number in range(len(CORNERS)):
        toggle_corner(blender, CORNERS[number], list(CORNERS[: number + 1]), "Car")
        states.append(state(blender))
    undo_and_redo(blender, states, "of corners", BESIDE)
    check_on_surface(blender, "Car")
    blender.shot("26-door")
    end(blender, "Door")

    step("A sill below it, which keeps a distance")
    begin(blender, closed=False, avoid_others=True, clearance=CLEARANCE)
    click_seen(blender, SILL, "Car")
    end(blender, "Sill")
    check_clear(blender, "Sill")

    step("A moulding that ends on the door")
    click_seen(blender, MOULDING, "Car")
    (pixel,) = blender.do(
        f"value = helper.pixels(helper.middle_of_other('Door', 0, {UPWARDS}), 'Car')"
    )
    blender.move((pixel[0] + 3, pixel[1]))
    time.sleep(1.0)
    blender.shot("12-junction")
    blender.click((pixel[0] + 3, pixel[1]))
    count_points(blender, 3)
    check(blender.do("value = helper.junctions()") == [[2, "Door"]], "a junction")
    check_on_surface(blender, "Car")
    end(blender, "Moulding")
    blender.shot("26-panels")
    drag_door(blender)
    change(blender, closed=True, avoid_others=False)


def drag_door(blender: Blender) -> None:
    """Drag a corner of the door, which the other curves follow."""
    step("Drag a corner of the door: sill and moulding follow, in one undo step")
    (on_door,) = blender.do("value = helper.pixels(helper.middle_of_other('Door', 3), 'Car')")
    blender.click(on_door)
    blender.wait("helper.curve() and helper.curve().name == 'Door'", "a click activates the door")
    time.sleep(0.6)  # no double click
    before = state(blender)
    points = "[helper.points_of(name) for name in ('Sill', 'Moulding')]"
    old = blender.do(f"value = {points}")
    (start,) = blender.do("value = helper.pixels(helper.places()[0], 'Car')")
    (stop,) = blender.do(f"value = helper.pixels({list(LOWER)}, 'Car')")
    drag(blender, start, 20, part_of_way(start, stop, 20), "26-door-dragged")
    release(blender, before)
    blender.wait(
        f"all(a != b for a, b in zip({points}, {old!r}))", "the other curves follow the door"
    )
    check(blender.do("value = helper.corners()") == list(CORNERS), "the corners stay")
    junctions = blender.do("value = helper.junctions(bpy.data.objects['Moulding'])")
    check(junctions == [[2, "Door"]], "the junction stays")
    gap = blender.do("value = helper.gap('Moulding', 'Door')")
    check(gap < ON_CURVE, f"the moulding ends on the door ({gap:.1e})")
    check_clear(blender, "Sill")
    for name in ("Door", "Sill", "Moulding"):
        check_on_surface(blender, "Car", name)
    undo_and_redo(blender, [before, state(blender)], "of all curves", BESIDE)
    blender.shot("12-follows")


def straps(blender: Blender) -> None:
    """A strap round a posed body, and a garter by another course; both follow the pose."""
    step("A posed figure: a strap from a shoulder to the hip, and round the back")
    begin(blender)
    states = click_seen(blender, STRAP, "Figure")
    undo_and_redo(blender, states, "of the strap", BESIDE)
    check_on_surface(blender, "Figure")
    check(blender.do("value = max(y for _, y, _ in helper.line())") > BEHIND, "round the back")
    blender.shot("13-strap")
    end(blender, "Strap")

    step("A garter: if the curve is a loop on the thigh, choose a course that leads round it")
    click_seen(blender, GARTER, "Figure")
    before = state(blender)
    begin_choice(blender)
    count, first = blender.do("value = helper.courses()")
    around = "max(y for _, y, _ in helper.chosen_course())"
    number = first
    while blender.do(f"value = {around}") < BEHIND:
        number += 1
        check(number < first + count, "a course round the thigh")
        blender.key("Down")
        blender.wait(f"helper.courses() == [{count}, {number % count}]", "the next course")
    blender.shot("13-courses")
    blender.key("Return")
    blender.wait("not helper.is_modal()", "the end of the choice")
    if number != first:
        blender.wait(f"helper.state() != {before!r}", "the chosen course")
        undo_and_redo(blender, [before, state(blender)], "of the choice", BESIDE)
    check(blender.do("value = max(y for _, y, _ in helper.line())") > BEHIND, "round the thigh")
    check_on_surface(blender, "Figure")
    end(blender, "Garter")

    step("With Live both follow the pose")
    names = ("Strap", "Garter")
    old = blender.do(f"value = [helper.points_of(name) for name in {names}]")
    blender.do(f"bpy.context.scene.nicmm_live_update = True\nbodies.pose({NEW_POSE})")
    for name, points in zip(names, old, strict=True):
        blender.wait(f"helper.points_of({name!r}) != {points!r}", f"{name} follows")
    blender.wait("not helper.live_works()", "the end of Live")
    for name in names:
        check_on_surface(blender, "Figure", name)
    blender.shot("13-pose")
    blender.do("bpy.context.scene.nicmm_live_update = False")


def begin(blender: Blender, **settings) -> None:
    """Choose the tool, with settings of the next curve."""
    choose_tool(blender)
    change(blender, **settings)
    blender.do('bpy.ops.ed.undo_push(message="Start")')


def change(blender: Blender, **settings) -> None:
    """Change settings of the next curve."""
    for name, value in settings.items():
        blender.do(f"bpy.context.scene.nicmm_curves.{name} = {value!r}")


def click_seen(blender: Blender, places, name: str) -> list:
    """Click where the shown surface hides places; return the state before and after each click."""
    return click_places(blender, blender.do(f"value = helper.seen({places}, {name!r})"), name)


def end(blender: Blender, name: str) -> None:
    """Name the active curve and end it with Enter."""
    blender.do(f"helper.curve().name = {name!r}\nbpy.ops.ed.undo_push(message='Rename')")
    blender.move(BESIDE)
    blender.key("Return")
    blender.wait("helper.curve() is None", "the end")


def release(blender: Blender, before: str) -> None:
    """End a drag and wait for the curve."""
    blender.mouse("mouseup", 1)
    blender.wait("not helper.is_modal()", "the end of the drag")
    blender.wait(f"helper.state() != {before!r}", "the dragged curve")


def check_on_surface(blender: Blender, body: str, curve: str | None = None) -> None:
    """Check that the points of a curve, by default the active one, are on the shown surface."""
    curve = curve or blender.do("value = helper.curve().name")
    away = blender.do(f"value = helper.away({body!r}, {curve!r})")
    check(away < ON_SURFACE, f"{curve} is on the shown surface ({away:.1e} diagonals)")


def check_clear(blender: Blender, name: str) -> None:
    """Check that a curve keeps its distance from the door."""
    gap = blender.do(f"value = helper.gap({name!r}, 'Door')")
    print(f"   {name} is {gap:.3f} away from the door")
    check(gap > 0.99 * CLEARANCE, f"{name} keeps the clearance ({gap:.4f})")
