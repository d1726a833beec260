#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Drives the editing tool in a Blender window by mouse and keys; takes a picture of each step.

    python3 build.py package
    python3 tests/window/drive.py dist/ZIP --shots FOLDER [--blender COMMAND] [--size 1280x800]

Needs Blender, Xvfb, xdotool and ImageMagick's `import` and `convert`. Of this project it needs only
the zip, so it runs with any Python 3. Each step checks the state of Blender; a failed step ends the
drive with an error. It is not part of the test suite, which has no window.
"""

import argparse
import json
import math
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

INSIDE = Path(__file__).resolve().with_name("inside.py")

# Sideways and upwards on the front of Suzanne's head, in this order: a loop round the face.
PLACES = ((-0.42, 0.62), (0.42, 0.62), (0.45, -0.08), (0.0, -0.75), (-0.45, -0.08))
DRAGGED, JUMPING = 3, 1
PATIENCE = 240.0
"""Seconds that a step may take; software OpenGL is slow."""

HOLD = 1.5
"""Seconds that a key is held about a click."""

CROP = "1048x800+0+0"
"""The part of the screen in pictures: the 3D viewport."""

FRAME = 50.0
"""Milliseconds that the tool may take for an event while a point is dragged."""

OUTPUTS = (
    ("curve", 'output="CURVE"'),
    ("edges", 'output="EDGES"'),
    ("region", 'output="REGION", region_cut=True'),
    ("parts", 'output="PARTS", parts_as="OBJECTS"'),
)


class Blender:
    """A Blender on a virtual screen."""

    def __init__(self, command: str, size: str, folder: Path, shots: Path) -> None:
        self.folder, self.shots, self.sent = folder, shots, 0
        self.display = f":{90 + os.getpid() % 400}"
        self.environment = {
            **os.environ,
            "DISPLAY": self.display,
            "LIBGL_ALWAYS_SOFTWARE": "1",
            "BLENDER_USER_RESOURCES": str(folder / "user"),
        }
        self.screen = subprocess.Popen(
            ["Xvfb", self.display, "-screen", "0", f"{size}x24", "+extension", "GLX"],
            stderr=subprocess.DEVNULL,
        )
        time.sleep(2.0)
        arguments = ["--window-geometry", "0", "0", *size.split("x"), "--python", str(INSIDE)]
        self.process = subprocess.Popen(
            [*command.split(), *arguments, "--", str(folder)],
            env=self.environment,
            stdout=(folder / "blender.log").open("w"),
            stderr=subprocess.STDOUT,
        )

    def close(self) -> None:
        for process in (self.process, self.screen):
            process.terminate()
            process.wait(30)

    def do(self, source: str):
        """Run Python in Blender and return its variable `value`."""
        self.sent += 1
        name = f"{self.sent:04d}"
        partial = self.folder / f"{name}.partial"
        partial.write_text(source)
        partial.rename(self.folder / f"{name}.command")
        reply = self.folder / f"{name}.reply"
        ends = time.monotonic() + PATIENCE
        while not reply.exists():
            if self.process.poll() is not None or time.monotonic() > ends:
                raise SystemExit(f"no answer to: {source}\n{self.log()}")
            time.sleep(0.05)
        found = json.loads(reply.read_text())
        if "error" in found:
            raise SystemExit(f"{source}\n{found['error']}")
        return found["value"]

    def log(self) -> str:
        return (self.folder / "blender.log").read_text()[-3000:]

    def wait(self, expression: str, what: str):
        """Wait until an expression is true in Blender, and return it."""
        ends = time.monotonic() + PATIENCE
        while time.monotonic() < ends:
            value = self.do(f"value = {expression}")
            if value:
                return value
            time.sleep(0.2)
        raise SystemExit(f"waited in vain: {what}\n{self.log()}")

    def mouse(self, *arguments) -> None:
        subprocess.run(["xdotool", *map(str, arguments)], env=self.environment, check=True)

    def move(self, pixel) -> None:
        self.mouse("mousemove", round(pixel[0]), round(pixel[1]))
        time.sleep(0.15)

    def click(self, pixel, *keys: str) -> None:
        self.move(pixel)
        for key in keys:
            self.mouse("keydown", key)
        time.sleep(HOLD * bool(keys))
        self.mouse("mousedown", 1)
        time.sleep(0.1)
        self.mouse("mouseup", 1)
        # Blender reads the modifier keys when it handles the event, not when the event occurs.
        time.sleep(HOLD * bool(keys))
        for key in keys:
            self.mouse("keyup", key)

    def key(self, *names: str) -> None:
        self.mouse("key", *names)

    def shot(self, name: str) -> None:
        """Take a picture of the screen after Blender has drawn it."""
        self.do("helper.area().tag_redraw()")
        time.sleep(1.5)
        self.do("pass")
        path = self.shots / f"{name}.png"
        subprocess.run(["import", "-window", "root", str(path)], env=self.environment, check=True)
        options = [
            "-crop",
            CROP,
            "+repage",
            "-strip",
            "-colors",
            "200",
            "-define",
            "png:compression-level=9",
        ]
        subprocess.run(["convert", str(path), *options, str(path)], check=True)
        print(f"   {path.name}, {path.stat().st_size // 1000} kB", flush=True)


def step(text: str) -> None:
    print(f"-- {text}", flush=True)


IDLE = "(lambda s: s is not None and s.idle and not s.problem)(helper.session())"


def check(condition: bool, what: str) -> None:
    if not condition:
        raise SystemExit(f"FAILED: {what}")


def count_points(blender: Blender, count: int, more: str = "True") -> None:
    blender.wait(
        f"{IDLE} and len(helper.session().points) == {count} and {more}",
        f"{count} points and a converged curve",
    )


def grab(blender: Blender, number: int):
    """Press the mouse on a control point and return where."""
    positions = f"helper.session().positions()[{number}]"
    (start,) = blender.do(f"value = helper.pixels({positions})")
    blender.move(start)
    blender.mouse("mousedown", 1)
    blender.wait(f"helper.running[0]._grabbed == {number}", "the point is grabbed")
    return start


def install(blender: Blender, archive: Path) -> None:
    step("Install the zip")
    check(blender.do("value = bpy.app.background") is False, "a window")
    version = blender.do("value = bpy.app.version_string")
    blender.do(
        "bpy.ops.extensions.package_install_files("
        f'filepath={str(archive)!r}, repo="user_default", enable_on_install=True)'
    )
    blender.wait('"bl_ext.user_default.nicmm_curves" in bpy.context.preferences.addons', "install")
    blender.do("watch_tool()")
    print(f"   Blender {version}")


def drive(blender: Blender, archive: Path) -> None:
    install(blender, archive)
    step("Suzanne, and the tool in the toolbar")
    print(f"   {blender.do('value = helper.suzanne()')} triangles")
    blender.do("helper.look()")
    blender.do("helper.area().spaces.active.show_region_ui = False")
    blender.do('with helper.in_view():\n    bpy.ops.wm.tool_set_by_id(name="nicmm.surface_curve")')
    blender.shot("1-tool")

    step("Five points by clicking")
    for number, pixel in enumerate(
        blender.do(f"value = helper.pixels(helper.in_front({PLACES}))"), start=1
    ):
        blender.click(pixel)
        if number == 1:
            blender.wait("helper.session() is not None", "the tool runs")
        count_points(blender, number)
    check(blender.do("value = helper.session().curve.closed"), "a closed curve")
    blender.shot("2-five-points")

    step("Drag one")
    blender.do("helper.frames.clear()")
    start = grab(blender, DRAGGED)
    for part in range(1, 41):
        blender.mouse("mousemove", round(start[0] + 0.5 * part), round(start[1] - 1.5 * part))
        time.sleep(0.1)
    blender.mouse("mouseup", 1)
    count_points(blender, 5)
    frames = blender.do("value = helper.frames")
    moves = sorted(
        spent
        for kind, grabbed, from_scratch, spent in frames
        if grabbed and kind == "MOUSEMOVE" and not from_scratch
    )
    most = max(spent for _, grabbed, _, spent in frames if grabbed)
    from_scratch = sum(grabbed and waiting for _, grabbed, waiting, _ in frames)
    print(
        f"   {len(moves)} moves: median {moves[len(moves) // 2]:.0f} ms of CPU, most "
        f"{moves[-1]:.0f} ms, {sum(spent > FRAME for spent in moves)} above {FRAME:.0f} ms; any "
        f"event {most:.0f} ms; {from_scratch} events with a design from scratch due"
    )

    step("Drag another over the brow to the crown, where the curve is designed from scratch")
    dragged = f"helper.session().positions()[{JUMPING}]"
    before = blender.do(f"value = {dragged}.tolist()")
    start = grab(blender, JUMPING)
    for part in range(1, 11):
        blender.mouse("mousemove", round(start[0] + 6.0 * part), round(start[1] - 8.0 * part))
        time.sleep(0.1)
    blender.wait(
        f"{IDLE} and {dragged}.tolist() != {before}", "a curve while the mouse stays still"
    )
    blender.shot("3-drag")
    blender.mouse("mouseup", 1)
    count_points(blender, 5)
    after = blender.do(f"value = {dragged}.tolist()")

    step("Ctrl-Z and back, insert on the curve, remove with Ctrl-click")
    blender.key("ctrl+z")
    blender.wait(f"{IDLE} and {dragged}.tolist() == {before}", "undo inside the tool")
    blender.key("ctrl+shift+z")
    blender.wait(f"{IDLE} and {dragged}.tolist() == {after}", "redo inside the tool")
    line = "helper.session().polyline()"
    middle = "int(helper.session().curve.control_index[:2].mean())"
    (on_curve,) = blender.do(f"value = helper.pixels({line}[{middle}])")
    blender.click(on_curve)
    count_points(blender, 6)
    blender.shot("4-inserted")
    (added,) = blender.do("value = helper.pixels(helper.session().positions()[1])")
    blender.click(added, "ctrl")
    count_points(blender, 5)

    step("A point on an eye, which is another part of the mesh: the status bar gives the reason")
    (eye,) = blender.do("value = helper.pixels(helper.in_front([(0.35, 0.24)]))")
    good = blender.do("value = helper.session().polyline().tolist()")
    blender.click(eye)
    blender.wait("helper.session().problem", "a problem")
    check(
        blender.do("value = helper.session().polyline().tolist()") == good, "the last curve stays"
    )
    blender.shot("5-problem")
    blender.key("ctrl+z")
    count_points(blender, 5)

    step("Closed and open, smoothness")
    blender.key("c")
    count_points(blender, 5, "not helper.session().curve.closed")
    blender.shot("6-open")
    blender.key("c")
    count_points(blender, 5, "helper.session().curve.closed")
    blender.key("Down", "Down", "Down")
    count_points(blender, 5, "helper.session().asked.smoothness < 0.6")
    blender.key("Up", "Up", "Up")
    count_points(blender, 5, "abs(helper.session().asked.smoothness - 1) < 1e-6")

    step("From the side: hidden parts are dimmed")
    blender.do("helper.look(1.0, -0.55, 0.25)")
    blender.shot("7-hidden-parts")
    blender.do("helper.look()")

    step("Enter keeps the curve")
    seen = blender.do("value = helper.session().polyline()[:-1].tolist()")
    blender.move(blender.do("value = helper.pixels([0, -0.8, 0])")[0])
    blender.key("Return")
    name = blender.wait(
        "[o.name for o in bpy.data.objects if o.type == 'CURVE'] and not helper.running", "commit"
    )
    written = "[list(p.co[:3]) for p in bpy.data.objects['Suzanne Curve'].data.splines[0].points]"
    kept = blender.do(f"value = {written}")
    segments = list(zip(seen, [*seen[1:], seen[0]], strict=True))
    apart = max(min(to_segment(point, *ends) for ends in segments) for point in kept)
    check(apart < 1e-6, f"what is kept is what was seen ({apart})")
    blender.shot("8-kept")

    step("Save, open again, and edit again")
    path = str(blender.folder / "head.blend")
    blender.do(f"bpy.ops.wm.save_as_mainfile(filepath={path!r})")
    blender.do(f"bpy.ops.wm.open_mainfile(filepath={path!r})")
    blender.wait("'Suzanne Curve' in bpy.data.objects", "the file")
    blender.do("helper.look()")
    blender.do('with helper.in_view():\n    bpy.ops.wm.tool_set_by_id(name="nicmm.surface_curve")')
    quarter = f"np.array({written})[{len(kept) // 8}]"
    (on_curve,) = blender.do(f"value = helper.pixels({quarter})")
    blender.click(on_curve)
    count_points(blender, 6)
    again = blender.do("value = helper.session().polyline().tolist()")
    # It has one point more, and its nodes are spaced again.
    apart = max(min(math.dist(one, other) for other in kept) for one in again)
    check(apart < 0.02, f"the curve of the file ({apart})")
    start = grab(blender, 1)
    for part in range(1, 21):
        blender.mouse("mousemove", round(start[0]), round(start[1] - 2.0 * part))
        time.sleep(0.1)
    blender.mouse("mouseup", 1)
    count_points(blender, 6)
    blender.shot("9-edited-again")
    blender.key("Escape")
    blender.wait("not helper.running", "cancel")
    check(blender.do(f"value = {written}") == kept, "Esc leaves the curve unchanged")

    step("Sticky curves by the menu")
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


def to_segment(point, start, end) -> float:
    """The distance of a point from a segment."""
    step = [b - a for a, b in zip(start, end, strict=True)]
    to = [p - a for p, a in zip(point, start, strict=True)]
    squared = sum(s * s for s in step)
    share = sum(t * s for t, s in zip(to, step, strict=True)) / squared if squared else 0.0
    share = min(max(share, 0.0), 1.0)
    return math.dist(point, [a + share * s for a, s in zip(start, step, strict=True)])


def open_again(blender: Blender, path: str) -> None:
    blender.do(f"bpy.ops.wm.open_mainfile(filepath={path!r})")
    blender.wait("'Suzanne Curve' in bpy.data.objects", "the file")
    blender.do("helper.look()")


def convert_to_sticky_curves(blender: Blender) -> None:
    """Object > Convert > Convert Designed Curve > Sticky Curves, by the keys."""
    blender.move(blender.do("value = helper.pixels([0, -0.8, 0])")[0])
    blender.do('with helper.in_view():\n    bpy.ops.wm.call_menu(name="VIEW3D_MT_object_convert")')
    # The entries of the extension are the last two; choose the second entry of the submenu.
    for key in ("Up", "Up", "Right", "Down", "Return"):
        time.sleep(1.0)
        blender.key(key)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("archive", type=Path, help="zip of the extension for this Blender")
    parser.add_argument("--shots", type=Path, required=True, help="folder for the pictures")
    parser.add_argument("--blender", default="blender", help="how to call Blender")
    parser.add_argument("--size", default="1280x800", help="of the screen")
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
            drive(blender, arguments.archive.resolve())
        finally:
            print(blender.log())
            blender.close()
    step("All steps done")


if __name__ == "__main__":
    main()
