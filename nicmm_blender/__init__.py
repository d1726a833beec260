# SPDX-License-Identifier: GPL-3.0-or-later
"""The Blender extension: reads Blender's data, calls the core, and writes Blender's data.

The folders form layers, and each imports only from those before it: `scene`, `outputs`,
`operators`, `tool`, `interface`. `translations` has labels and tooltips in other languages.

Nothing here loads the core, or a library that the core needs, before a curve is requested. The
extension can therefore be enabled quickly, even if a library is missing; the operator then reports
which one.
"""

from . import command_line, preferences, settings, translations
from .interface import curve_list, map_rows, menus, panels
from .operators import (
    convert_curve,
    course_search,
    curve_settings,
    design_curve,
    live_update,
    maps,
    measures,
    move_curve,
    next_course,
    sliced_operator,
    strokes_to_curves,
    time_slices,
    update_curves,
)
from .outputs import parallel_curves
from .scene import surface_cache
from .tool import (
    comb,
    course_choice,
    course_overlay,
    draw_operator,
    edit_operator,
    hover,
    overlay,
    picking,
    point_operators,
    stroke_operators,
    toolbar,
)

MODULES = (
    translations,
    preferences,
    settings,
    surface_cache,
    parallel_curves,
    time_slices,
    design_curve,
    convert_curve,
    strokes_to_curves,
    update_curves,
    move_curve,
    course_search,
    next_course,
    maps,
    live_update,
    measures,
    curve_settings,
    edit_operator,
    point_operators,
    stroke_operators,
    draw_operator,
    course_choice,
    picking,
    overlay,
    course_overlay,
    comb,
    hover,
    toolbar,
    curve_list,
    map_rows,
    panels,
    menus,
    command_line,
)


def register() -> None:
    for module in MODULES:
        module.register()


def unregister() -> None:
    sliced_operator.stop_all()
    for module in reversed(MODULES):
        module.unregister()
