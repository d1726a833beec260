# SPDX-License-Identifier: GPL-3.0-or-later
"""Work on a scan, parts of `drive.py`: margin, measures, parallel curves, strokes, and snapping.

The scan is a prepared tooth of 100,000 triangles, made by `bodies.py`.
"""

import math
import time

from designers import begin, change, release
from screen import Blender, check, choose_tool, count_points, state, step

MARGIN_ANGLE = -1.2
"""Angle of the click beside the margin, which is at a radius of about 0.6."""

STROKE = ((-0.75, -0.2), (-0.4, -0.55), (0.0, -0.45), (0.4, -0.6), (0.75, -0.25))
"""Places of a stroke on the root, seen from above, at which the mouse changes its direction."""

DISTANCE = 0.06


def scans(blender: Blender) -> None:
    """The margin of a tooth by one click, and what is made from it."""
    blender.do("helper.area().spaces.active.show_region_ui = False")
    triangles = blender.do("value = bodies.tooth()")
    print(f"   {triangles} triangles")
    blender.do("helper.look(0.25, -1.0, 1.1, 2.6)")
    margin(blender)
    parallel(blender)
    strokes(blender)


def margin(blender: Blender) -> None:
    """One click beside the margin."""
    step("The margin of a tooth by one click")
    begin(blender, tool_action="FEATURE")
    pixel = beside_margin(blender)
    blender.move(pixel)
    blender.shot("30-before-the-click")
    begun = time.monotonic()
    blender.click(pixel)
    blender.wait("helper.curve() is not None and helper.count() > 2", "the margin")
    print(f"   {time.monotonic() - begun:.1f} s, {blender.do('value = helper.count()')} points")
    check(blender.do("value = helper.curve().data.splines[0].use_cyclic_u"), "it is closed")
    away = blender.do("value = bodies.off_margin(helper.line())")
    edge = blender.do("value = bodies.edge_length()")
    print(f"   {away / edge:.2f} edges from the true margin")
    check(away < 0.5 * edge, "it is within half an edge of the true margin")
    blender.do("helper.curve().name = 'Margin'")
    blender.shot("31-margin")
    change(blender, tool_action="POINTS")

    step("Its measures and its comb in the sidebar")
    blender.do("helper.area().spaces.active.show_region_ui = True")
    blender.do("helper.show_sidebar()")
    blender.do("bpy.context.window_manager.nicmm_show_comb = True")
    time.sleep(3.0)
    blender.shot("32-measures")
    blender.do("bpy.context.window_manager.nicmm_show_comb = False")
    blender.do("helper.area().spaces.active.show_region_ui = False")


def beside_margin(blender: Blender):
    """The pixel of a place beside the margin."""
    place = (0.63 * math.cos(MARGIN_ANGLE), 0.63 * math.sin(MARGIN_ANGLE))
    (target,) = blender.do(f"value = helper.above({[place]}, 'Tooth')")
    (pixel,) = blender.do(f"value = helper.pixels({target}, 'Tooth')")
    return pixel


def parallel(blender: Blender) -> None:
    """Parallel curves, which follow a dragged point."""
    step("Parallel curves on both sides")
    blender.do(
        "with helper.in_view():\n"
        "    bpy.ops.nicmm.convert_curve('EXEC_DEFAULT', True, output='PARALLEL', "
        f"parallel_distance={DISTANCE}, parallel_count=2, both_sides=True)"
    )
    count = "len(bpy.data.objects['Margin Parallel'].data.splines)"
    check(blender.do(f"value = {count}") >= 4, "four parallel curves")
    blender.shot("33-parallel")
    blender.do("bpy.data.objects['Margin Parallel'].nicmm_parallel.count = 1")
    check(blender.do(f"value = {count}") >= 2, "one on each side after the count has changed")
    blender.do('bpy.ops.ed.undo_push(message="Count")')

    step("They follow the margin when a point is dragged")
    blender.do("helper.activate_object('Margin')")
    choose_tool(blender)
    before = state(blender)
    points = "[list(p.co[:3]) for s in bpy.data.objects['Margin Parallel'].data.splines "
    points += "for p in s.points]"
    shown = blender.do(f"value = {points}")
    number = blender.do("value = helper.nearest_to_eye()")
    (pixel,) = blender.do(f"value = helper.pixels(helper.places()[{number}], 'Tooth')")
    blender.move(pixel)
    blender.mouse("mousedown", 1)
    for each in range(1, 9):
        blender.move((pixel[0], pixel[1] + 3.0 * each))
    release(blender, before)
    check(blender.do(f"value = {points}") != shown, "the parallel curves have followed")
    blender.shot("34-follows")
    blender.key("ctrl+z")
    blender.wait(f"helper.state() == {before!r}", "undo of the drag")
    check(blender.do(f"value = {points}") == shown, "undo takes the parallel curves back")


def strokes(blender: Blender) -> None:
    """A freehand stroke, and one that redraws a stretch."""
    step("A freehand stroke below the margin")
    blender.do("helper.activate_object('Tooth')")
    begin(blender, tool_action="FREEHAND")
    places = blender.do(f"value = helper.above({list(STROKE)}, 'Tooth')")
    pixels = blender.do(f"value = helper.pixels({places}, 'Tooth')")
    draw_stroke(blender, pixels, "35-stroke")
    blender.wait("helper.curve() is not None and helper.count() > 1", "the curve of the stroke")
    blender.wait("not helper.is_modal()", "the end of the work")
    count = blender.do("value = helper.count()")
    print(f"   {count} control points")
    check(count < 15, "few control points")
    blender.do("helper.curve().name = 'Stroke'\nbpy.ops.ed.undo_push(message='Rename')")
    blender.shot("36-freehand")

    step("Redraw a stretch of it")
    before = state(blender)
    line = blender.do("value = helper.line()")
    start, end = line[len(line) // 3], line[2 * len(line) // 3]
    first, last = blender.do(f"value = helper.pixels({[start, end]}, 'Tooth')")
    bow = [
        (
            first[0] + share * (last[0] - first[0]),
            first[1] + share * (last[1] - first[1]) + 60.0 * math.sin(math.pi * share),
        )
        for share in (0.0, 0.25, 0.5, 0.75, 1.0)
    ]
    draw_stroke(blender, bow, "37-stretch")
    blender.wait(f"helper.state() != {before!r}", "the redrawn stretch")
    blender.wait("not helper.is_modal()", "the end of the work")
    check(blender.do("value = helper.curve().name") == "Stroke", "the same curve")
    blender.shot("38-redrawn")
    blender.key("ctrl+z")
    blender.wait(f"helper.state() == {before!r}", "undo of the stretch")
    change(blender, tool_action="POINTS")


def draw_stroke(blender: Blender, pixels, name: str) -> None:
    """Drag through pixels, with a picture before the button is released."""
    blender.move(pixels[0])
    blender.mouse("mousedown", 1)
    time.sleep(0.3)
    for start, end in zip(pixels[:-1], pixels[1:], strict=True):
        for number in range(1, 9):
            share = number / 8.0
            blender.mouse(
                "mousemove",
                round(start[0] + share * (end[0] - start[0])),
                round(start[1] + share * (end[1] - start[1])),
            )
            time.sleep(0.04)
    blender.shot(name)
    blender.mouse("mouseup", 1)


def snapping(blender: Blender) -> None:
    """Points that snap to a vertex, the middle of an edge and the centre of a face."""
    blender.do("helper.area().spaces.active.show_region_ui = False")
    step("Points snap to elements of a cube")
    blender.do("bodies.box()\nhelper.look(0.5, -1.0, 0.6, 6.0)")
    begin(blender, tool_action="POINTS")
    tools = "bpy.context.tool_settings"
    blender.do(f"{tools}.use_snap = True")
    cases = (
        ("VERTEX", (0.95, -1.0, 0.96), (1.0, -1.0, 1.0), "39-vertex"),
        ("EDGE_MIDPOINT", (0.97, -1.0, 0.03), (1.0, -1.0, 0.0), "40-midpoint"),
        ("FACE", (0.04, -1.0, -0.03), (0.0, -1.0, 0.0), "41-centre"),
    )
    for number, (element, near, exact, name) in enumerate(cases):
        blender.do(f"{tools}.snap_elements = {{{element!r}}}")
        (pixel,) = blender.do(f"value = helper.pixels({list(near)}, 'Box')")
        blender.move((pixel[0] + 2, pixel[1]))
        blender.move(pixel)
        time.sleep(0.5)
        blender.shot(name)
        blender.click(pixel)
        count_points(blender, number + 1)
        place = blender.do(f"value = helper.places()[{number}]")
        print(f"   {place}")
        check(math.dist(place, exact) < 1e-6, f"the point is exactly at the {element.lower()}")
    blender.do(f"{tools}.use_snap = False")


def crown(blender: Blender) -> None:
    """The crown of the tooth as a separate object."""
    blender.do("helper.area().spaces.active.show_region_ui = False")
    step("The part inside of the margin")
    triangles = blender.do("value = bodies.tooth()")
    print(f"   {triangles} triangles")
    blender.do("helper.look(0.25, -1.0, 1.1, 2.6)")
    begin(blender, tool_action="FEATURE")
    blender.click(beside_margin(blender))
    blender.wait("helper.curve() is not None and helper.count() > 2", "the margin")
    change(blender, tool_action="POINTS")
    begun = time.monotonic()
    blender.do(
        "with helper.in_view():\n"
        "    bpy.ops.nicmm.convert_curve('EXEC_DEFAULT', True, output='PARTS', parts_as='OBJECTS')"
    )
    print(f"   {time.monotonic() - begun:.1f} s")
    names = blender.do("value = sorted(each.name for each in bpy.data.objects)")
    check(len(names) == 2, f"two parts ({names})")
    blender.do("bpy.data.objects[-1].location.z += 0.4")
    blender.shot("42-part")
