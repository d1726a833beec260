# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws messages that are longer than a panel is wide."""

import textwrap

import bpy

LETTER = 7.0
"""Mean width of a letter, in pixels at a resolution scale of 1."""

MARGIN = 60.0
"""Width of the icon and of both margins, in the same pixels."""

FEWEST = 20
"""Least number of letters in a line."""


def draw_message(layout: bpy.types.UILayout, message: str) -> None:
    """Draw an error message on as many lines as the region needs."""
    column = layout.column(align=True)
    column.scale_y = 0.8
    for number, line in enumerate(textwrap.wrap(message, _letters_in_line())):
        column.label(text=line, icon="BLANK1" if number else "ERROR")


def _letters_in_line() -> int:
    """Number of letters that fit into a line of the region that is being drawn."""
    region, scale = bpy.context.region, bpy.context.preferences.system.ui_scale
    width = 0.0 if region is None else region.width / scale
    return max(int((width - MARGIN) / LETTER), FEWEST)
