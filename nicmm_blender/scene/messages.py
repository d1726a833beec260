# SPDX-License-Identifier: GPL-3.0-or-later
"""Errors for the user, with the core's messages reworded for Blender."""


class InputError(Exception):
    """Blender's data cannot be used; the message says what to change."""


def user_message(error: Exception, obstacle_group: str = "", vertices=None) -> str:
    """Reword a message of the core: points are counted from one, and the obstacle map is named.

    `vertices` are the vertex indices of the control points, or None if they are not at vertices.
    """
    text = str(error)
    for point in getattr(error, "points", ()):
        if point.argument == "control_points":
            at = "" if vertices is None else f" (vertex {vertices[point.index]})"
            text = text.replace(str(point), f"point {point.index + 1}{at}")
    text = text.replace("control_points has 1 point,", "there is 1 point,")
    text = text.replace("control_points has", "there are").replace("control_points", "the points")
    if "too few; a closed curve" in text:
        text += ". Turn Closed off for an open curve, which needs 2"
    if type(error).__name__ == "UnreachableError" and obstacle_group:
        text += f' (obstacles: the vertex group "{obstacle_group}")'
    return text[:1].upper() + text[1:]
