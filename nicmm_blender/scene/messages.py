# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages for the user: errors, the core's messages reworded for Blender, counted things."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import numpy as np

IMAGES = "mirror images of control_points"
"""What the core calls the mirror images of control points in its errors."""

MIRROR_WORDS = {
    "pass the points of one side, since their mirror images are added": "keep the points of one "
    "side, since their mirror images are added",
    "leave mirror out": "set Mirror to None",
    "the mirror image of design": "the mirror image of the curve",
    "design crosses": "the mirror image of the curve crosses",
    "design comes closer": "the mirror image of the curve comes closer",
    "move control points so that it stays on one side, or leave the other curve out": "move the "
    "points, turn Avoid Other Curves off, or set Mirror to None and draw both curves",
    "pass another plane": "choose another mirror",
    "about plane; design a curve through the mirror images of its control points instead": "about "
    "the mirror; set Mirror to None and draw both curves",
}
"""What the core says about mirrors, and the words for it in Blender."""


NO_MESH_OR_CURVE = "Make a mesh or a designed curve active"
"""Message for an active object of the wrong type."""


class InputError(Exception):
    """Blender's data cannot be used; the message says what to change."""


def check_finite(name: str, value: object) -> None:
    """Raise an error if a setting is NaN or infinite, which scripts can pass."""
    if isinstance(value, float) and not math.isfinite(value):
        label = sentence(name.replace("_", " "))
        raise InputError(f"{label} is {value}. Give a finite number")


def user_message(
    error: Exception,
    obstacle_group: str = "",
    vertices: np.ndarray | None = None,
    avoided: Sequence[str] = (),
) -> str:
    """Reword a message of the core: points are counted from 1, and the obstacle map is named.

    `vertices` are the vertex indices of the control points, or None if they are not at vertices,
    and `avoided` the names of the curves that are avoided.
    """
    text = str(error)
    for point in getattr(error, "points", ()):
        if point.argument == IMAGES:
            text = text.replace(str(point), f"the mirror image of point {point.index + 1}")
    for point in getattr(error, "points", ()):
        if point.argument == "control_points":
            at = "" if vertices is None else f" (vertex {vertices[point.index]})"
            text = text.replace(str(point), f"point {point.index + 1}{at}")
        elif leg := re.fullmatch(r"via_points\[(\d+)\]", point.argument):
            before = int(leg[1]) + 1
            text = text.replace(str(point), f"via point {point.index + 1} after point {before}")
    for core_words, words in MIRROR_WORDS.items():
        text = text.replace(core_words, words)
    text = text.replace("control_points has 1 point,", "there is 1 point,")
    text = text.replace("control_points has", "there are").replace("control_points", "the points")
    text = re.sub(r"in the order \[([\d, ]+)\]", _counted_from_one, text)
    if "too few; a closed curve" in text:
        text += ". Turn Closed off for an open curve, which needs 2"
    if type(error).__name__ == "UnreachableError" and obstacle_group:
        text += f' (obstacles: the vertex group "{obstacle_group}")'
    if avoided:
        text = _with_names(text, avoided)
    return sentence(text)


def _with_names(text: str, avoided: Sequence[str]) -> str:
    """A message about curves to avoid, in words of the interface."""
    text = re.sub(r"avoid\[(\d+)\]", lambda found: f'"{avoided[int(found[1])]}"', text)
    # The number is a length in the space of the mesh, unlike that of the setting.
    text = re.sub(r"the clearance \([^)]*\)", "the clearance", text)
    text = text.replace("the curves of avoid", "the curves above it in the list")
    text = text.replace("a curve of avoid", "a curve above it in the list")
    return re.sub("^avoid leaves", "the curves above it in the list leave", text)


def sentence(text: str) -> str:
    """A message with a capital letter at its start."""
    return text[:1].upper() + text[1:]


def counted(count: int, noun: str) -> str:
    """A number of things, such as "1 curve" or "3 curves"."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def _counted_from_one(order: re.Match[str]) -> str:
    numbers = [str(int(each) + 1) for each in order[1].split(",")]
    return f"in the order {', '.join(numbers)}"
