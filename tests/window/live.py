#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Drives a real Blender window: curves on the shown surface, and *Live* in every mode.

    python3 tests/window/live.py nicmm_curves-…-linux_x64.zip --shots FOLDER

A subdivided and posed figure gets a curve by clicks while its modifiers stay visible. Then a vertex
is moved in Edit Mode, the pose and the frame are changed, a stroke is made in Sculpt Mode, and the
curve has to follow before the mode is left. At the end the CPU time of Blender while nothing
happens is measured in each mode, with and without *Live*. Needs what `drive.py` needs.
"""

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from screen import Blender, check, install, step  # noqa: E402

PLACES = ((-0.3, 0.65), (0.3, 0.65), (0.12, -0.6), (-0.12, -0.6))
"""Sideways and upwards on the front of Suzanne's head."""

STROKE = ((-0.3, 0.7), (0.3, 0.6))

IDLE = 30.0
"""Seconds of each measurement without events."""

SETTLED = 20.0
"""Seconds in which Blender draws the last change; software OpenGL is slow."""

MOST_IDLE = 0.02
"""Cores that *Live* may use while nothing happens."""

FIGURE = """
helper.figure()
helper.look()
"""

LINE = """
curve = next(found for found in bpy.data.objects if found.type == 'CURVE')
value = [list(point.co[:3]) for point in curve.data.splines[0].points]
"""

MODES = (
    ("OBJECT", "Suzanne"),
    ("EDIT", "Suzanne"),
    ("SCULPT", "Suzanne"),
    ("WEIGHT_PAINT", "Suzanne"),
    ("POSE", "Armature"),
)


def drive(blender: Blender, idle: float) -> None:
    step("A subdivided and posed figure, with the tool")
    blender.do(FIGURE)
    blender.do('with helper.in_view():\n    bpy.ops.wm.tool_set_by_id(name="nicmm.surface_curve")')
    blender.shot("live-1-figure")
    places = blender.do(f"value = helper.shown_in_front({PLACES})")
    for number, pixel in enumerate(blender.do(f"value = helper.pixels({places})"), start=1):
        blender.click(pixel)
        blender.wait(f"helper.count() == {number}", f"point {number}")
        time.sleep(0.6)  # no double click
    visible = "all(each.show_viewport for each in bpy.data.objects['Suzanne'].modifiers)"
    check(blender.do(f"value = {visible}"), "modifiers stay visible")
    blender.shot("live-2-drawn")
    blender.key("Return")
    blender.wait("helper.curve() is None", "the end")
    away = blender.do("value = helper.away()")
    check(away < 1e-6, f"the kept curve is on the shown surface ({away} diagonals)")
    blender.shot("live-3-kept")

    step("Live: a vertex moved in Edit Mode")
    blender.do("bpy.context.scene.nicmm_live_update = True")
    blender.do("helper.switch('Suzanne', 'EDIT')")
    moves(blender, "helper.pull_in_edit_mode()", "live-4-edit-mode")
    check(blender.do("value = bpy.context.mode") == "EDIT_MESH", "before Edit Mode is left")

    step("Live: the pose and the frame")
    blender.do("helper.switch('Armature', 'POSE')")
    moves(blender, "helper.bend(0.5)", "live-5-pose")
    blender.do("helper.switch('Suzanne', 'OBJECT')")
    moves(blender, "bpy.context.scene.frame_set(15)", "live-6-frame")

    step("Live: strokes in Sculpt Mode, with and without modifiers")
    blender.do("helper.switch('Suzanne', 'SCULPT')")
    moves(blender, "", "live-7-sculpt", stroke=True)
    blender.do("for each in bpy.data.objects['Suzanne'].modifiers:\n    each.show_viewport = False")
    time.sleep(2.0)
    moves(blender, "", "live-8-sculpt-without-modifiers", stroke=True)
    blender.do("for each in bpy.data.objects['Suzanne'].modifiers:\n    each.show_viewport = True")

    step(f"Cores used while nothing happens, over {idle:g} s, without Live and with it")
    for mode, name in MODES:
        blender.do(f"helper.switch({name!r}, {mode!r})")
        used = []
        for live in (False, True):
            blender.do(f"bpy.context.scene.nicmm_live_update = {live}")
            settle(blender)
            used.append(cores(blender, idle))
        print(f"   {mode:12s} {used[0]:.3f} {used[1]:.3f}", flush=True)
        check(used[1] - used[0] <= MOST_IDLE, f"Live is idle in {mode}")


def moves(blender: Blender, source: str, shot: str, stroke: bool = False) -> None:
    """Check that a change moves the curve."""
    before = blender.do(LINE)
    if stroke:
        start, end = blender.do(
            "value = helper.pixels(helper.shown_in_front([(0.5, 0.3), (0, 0.5)]))"
        )
        blender.move(start)
        blender.mouse("mousedown", 1)
        for part in range(1, 11):
            blender.move([a + (b - a) * part / 10 for a, b in zip(start, end, strict=True)])
        blender.mouse("mouseup", 1)
    else:
        blender.do(source)
    ends = time.monotonic() + 20.0
    while blender.do(LINE) == before and time.monotonic() < ends:
        time.sleep(0.3)
    check(blender.do(LINE) != before, f"the curve follows ({shot})")
    away = blender.do("value = helper.away()")
    check(away < 1e-4, f"on the shown surface ({away} diagonals)")
    blender.shot(shot)


def settle(blender: Blender) -> None:
    """Wait until Blender has updated the curves and drawn them, or for some time."""
    time.sleep(2.0)
    blender.wait("not helper.live_works()", "the curves are up to date")
    ends = time.monotonic() + SETTLED
    while cores(blender, 2.0) > 2.0 * MOST_IDLE and time.monotonic() < ends:
        pass


def cores(blender: Blender, seconds: float) -> float:
    """Cores that Blender uses on average, by its process time."""
    before = cpu_seconds(blender.process.pid)
    started = time.monotonic()
    time.sleep(seconds)
    return (cpu_seconds(blender.process.pid) - before) / (time.monotonic() - started)


def cpu_seconds(process: int) -> float:
    """CPU time of a process and its threads."""
    fields = Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("archive", type=Path, help="zip of the extension for this Blender")
    parser.add_argument("--shots", type=Path, required=True, help="folder for the pictures")
    parser.add_argument("--blender", default="blender", help="how to call Blender")
    parser.add_argument("--size", default="1422x800", help="of the screen")
    parser.add_argument("--idle", type=float, default=IDLE, help="seconds of each measurement")
    arguments = parser.parse_args()
    arguments.shots.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        blender = Blender(
            arguments.blender, arguments.size, Path(folder), arguments.shots.resolve()
        )
        try:
            install(blender, arguments.archive.resolve())
            drive(blender, arguments.idle)
        finally:
            print(blender.log()[-1500:])
            blender.close()


if __name__ == "__main__":
    main()
