# SPDX-License-Identifier: GPL-3.0-or-later
"""A Blender on a virtual screen: its mouse and keys, its state, pictures, and what drives share.

`inside.py` runs in that Blender. Needs Xvfb, xdotool and ImageMagick, and of this project only the
zip.
"""

import json
import os
import subprocess
import time
from pathlib import Path

INSIDE = Path(__file__).resolve().with_name("inside.py")

SYMMETRIC = 2e-3
"""Greatest asymmetry of the points of a curve object, which are those of an even spline."""

PLACES = ((-0.42, 0.62), (0.42, 0.62), (0.45, -0.08), (0.0, -0.75), (-0.4, -0.08))
"""Sideways and upwards on the front of Suzanne's head, in this order: a loop around the face."""

PATIENCE = 60.0
"""Seconds that a step may take; software OpenGL is slow."""

HOLD = 1.5
"""Seconds that a key is held before and after a click."""

CROP = "1422x800+0+0"
"""The part of the screen in pictures, 16:9."""


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
                status = self.process.poll()
                raise SystemExit(f"no answer to: {source} (exit status {status})\n{self.log()}")
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
        self.shot("failed")
        raise SystemExit(f"timed out while waiting for: {what}\n{self.log()}")

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
        self.do("for area in bpy.context.window.screen.areas:\n    area.tag_redraw()")
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


def check(condition: bool, what: str) -> None:
    if not condition:
        raise SystemExit(f"FAILED: {what}")


def count_points(blender: Blender, count: int, more: str = "True") -> None:
    blender.wait(f"helper.count() == {count} and {more}", f"{count} points")


def state(blender: Blender) -> str:
    return blender.do("value = helper.state()")


def pixel_of(blender: Blender, number: int, name: str = "Suzanne"):
    """Where a control point on an object is on the screen."""
    (pixel,) = blender.do(f"value = helper.pixels(helper.places()[{number}], {name!r})")
    return pixel


def drag(blender: Blender, start, steps: int, step, name: str = "") -> None:
    """Press at a pixel and move the mouse; take a picture before the release if it has a name."""
    blender.move(start)
    blender.mouse("mousedown", 1)
    time.sleep(0.3)
    for part in range(1, steps + 1):
        blender.mouse(
            "mousemove", round(start[0] + step[0] * part), round(start[1] + step[1] * part)
        )
        time.sleep(0.1)
    if name:
        time.sleep(1.0)
        blender.shot(name)


def shift_drag(blender: Blender, start, steps: int, each, name: str) -> None:
    """Hold Shift and drag; both stay pressed."""
    blender.move(start)
    blender.mouse("keydown", "shift")
    time.sleep(HOLD)
    drag(blender, start, steps, each, name)


def choose_tool(blender: Blender, name: str = "nicmm.surface_curve") -> None:
    blender.do(f"with helper.in_view():\n    bpy.ops.wm.tool_set_by_id(name={name!r})")


def click_places(blender: Blender, places, name: str = "Suzanne") -> list:
    """Click positions of an object one by one; return the state before and after each click."""
    states = [state(blender)]
    for number, place in enumerate(places, start=1):
        (pixel,) = blender.do(f"value = helper.pixels({list(place)}, {name!r})")
        blender.click(pixel)
        count_points(blender, number)
        time.sleep(0.6)  # no double click
        states.append(state(blender))
    return states


def undo_and_redo(blender: Blender, states: list, why: str, beside=None) -> None:
    """Undo one step at a time back to the first state, and redo, with the keys.

    The mouse is moved beside the mesh first, by default to a pixel beside Suzanne.
    """
    blender.move(beside or blender.do("value = helper.pixels([-1.3, 0, 0.9])")[0])
    for expected in states[-2::-1]:
        blender.key("ctrl+z")
        blender.wait(f"helper.state() == {expected!r}", f"undo {why}")
    for expected in states[1:]:
        blender.key("ctrl+shift+z")
        blender.wait(f"helper.state() == {expected!r}", f"redo {why}")


def toggle_corner(blender: Blender, number: int, wanted: list, name: str = "Suzanne") -> None:
    """Press the key over a point, and wait for the corners that the curve then has."""
    blender.move(pixel_of(blender, number, name))
    time.sleep(0.5)
    blender.key("j")
    blender.wait(f"helper.corners() == {wanted}", f"corners {wanted}")


def begin_choice(blender: Blender) -> None:
    blender.key("shift+Return")
    blender.wait("helper.courses() is not None", "the courses")


def check_symmetric(blender: Blender) -> None:
    away = blender.do("value = helper.asymmetry()")
    check(away < SYMMETRIC, f"the curve is its own mirror image ({away:.1e})")


def part_of_way(start, end, steps: int) -> tuple[float, float]:
    """One of equal steps from a pixel to another."""
    return (end[0] - start[0]) / steps, (end[1] - start[1]) / steps


def install(blender: Blender, archive: Path) -> None:
    """Install the zip as *Install from Disk* does: choose it in the file browser, and confirm."""
    step("Install from Disk")
    check(blender.do("value = bpy.app.background") is False, "a window")
    version = blender.do("value = bpy.app.version_string")
    blender.do(
        "bpy.context.preferences.view.filebrowser_display_type = 'SCREEN'\n"
        "with helper.in_view():\n"
        '    bpy.ops.extensions.package_install_files("INVOKE_DEFAULT")'
    )
    browser = "[a for a in bpy.context.window.screen.areas if a.type == 'FILE_BROWSER']"
    blender.wait(f"{browser} and {browser}[0].spaces.active.params is not None", "the file browser")
    blender.do(
        f"params = {browser}[0].spaces.active.params\n"
        f"params.directory, params.filename = {bytes(archive.parent)!r}, {archive.name!r}"
    )
    blender.move((700, 400))
    time.sleep(1.0)
    blender.shot("0-install")
    blender.key("Return")
    blender.wait('"bl_ext.user_default.nicmm_curves" in bpy.context.preferences.addons', "install")
    blender.wait("any(a.type == 'VIEW_3D' for a in bpy.context.window.screen.areas)", "the window")
    blender.do("watch_tool()")
    print(f"   Blender {version}")
