# SPDX-License-Identifier: GPL-3.0-or-later
"""Records the animation of the tour: clicks, a drag, and other courses."""

import subprocess
import time
from pathlib import Path

from screen import PLACES, Blender, begin_choice, check, choose_tool, count_points, pixel_of, step

VIEW = "860x590+190+88"
"""The part of the screen that is recorded."""

WIDTH = 720
"""Of the animation, in pixels."""

POINTER = ((0, 0), (0, 25), (6, 19), (11, 29), (15, 27), (10, 18), (18, 18))
"""Outline of the pointer, which pictures of the screen do not contain."""


class Recording:
    """Pictures of the screen with the pointer, and how long each is shown.

    Attributes
    ----------
    frames : list of (Path, int)
        Files, and durations in hundredths of a second.
    """

    def __init__(self, blender: Blender) -> None:
        self.blender = blender
        self.folder = blender.folder / "frames"
        self.folder.mkdir()
        self.frames: list[tuple[Path, int]] = []
        self.pixel = (300.0, 560.0)

    def frame(self, duration: int = 8) -> None:
        """Take a picture after Blender has drawn its window."""
        self.blender.do("helper.area().tag_redraw()")
        time.sleep(0.25)
        path = self.folder / f"{len(self.frames):03d}.png"
        x, y = self.pixel
        outline = " ".join(f"{x + dx:.0f},{y + dy:.0f}" for dx, dy in POINTER)
        taken = ["import", "-window", "root", str(path)]
        drawn = ["convert", str(path), "-fill", "white", "-stroke", "black"]
        drawn += ["-draw", f"polygon {outline}", "-crop", VIEW, "+repage", "-resize", f"{WIDTH}x"]
        for command in (taken, [*drawn, str(path)]):
            subprocess.run(command, env=self.blender.environment, check=True)
        self.frames.append((path, duration))

    def move(self, pixel, steps: int = 5) -> None:
        """Move the mouse in a straight line."""
        x, y = self.pixel
        for part in range(1, steps + 1):
            share = part / steps
            self.pixel = (x + (pixel[0] - x) * share, y + (pixel[1] - y) * share)
            self.blender.move(self.pixel)
            self.frame()

    def write(self, path: Path) -> None:
        """Write all frames as an animation that is repeated."""
        command = ["convert", "-loop", "0"]
        for frame, duration in self.frames:
            command += ["-delay", str(duration), str(frame)]
        subprocess.run([*command, "-quality", "60", str(path)], check=True)


def animation(blender: Blender) -> None:
    """Five clicks, a drag, a look at other courses, and the end."""
    step("Record the animation of the tour")
    blender.do("helper.suzanne()")
    blender.do("helper.look()")
    blender.do("helper.area().spaces.active.show_region_ui = False")
    choose_tool(blender)
    recording = Recording(blender)
    recording.frame(60)
    for number, place in enumerate(blender.do(f"value = helper.in_front({PLACES})"), start=1):
        (pixel,) = blender.do(f"value = helper.pixels({[place]})")
        recording.move(pixel)
        blender.click(pixel)
        count_points(blender, number)
        time.sleep(0.8)
        recording.frame(40)

    start = pixel_of(blender, 3)
    recording.move(start)
    blender.mouse("mousedown", 1)
    for _ in range(10):
        recording.move((recording.pixel[0], recording.pixel[1] - 9.0), steps=1)
    blender.mouse("mouseup", 1)
    time.sleep(1.5)
    recording.frame(60)

    recording.move(blender.do("value = helper.pixels([-1.3, 0, 0.9])")[0])
    begin_choice(blender)
    recording.frame(80)
    for _ in range(3):
        blender.mouse("click", 5)
        time.sleep(0.5)
        recording.frame(80)
    blender.key("Escape")
    blender.wait("not helper.is_modal()", "the end of the choice")
    recording.frame(60)
    blender.key("Return")
    blender.wait("helper.curve() is None", "the end of the curve")
    recording.frame(150)
    path = blender.shots / "tour.webp"
    recording.write(path)
    check(path.stat().st_size < 2_000_000, "the animation is smaller than 2 MB")
    print(f"   {path.name}, {len(recording.frames)} frames, {path.stat().st_size // 1000} kB")
