# SPDX-License-Identifier: GPL-3.0-or-later
"""The Blender side: reads Blender data, calls the core, writes Blender data.

Each folder imports only from those before it: `scene`, `outputs`, `operators`, `tool`, `interface`.

Nothing here loads the core, or a library that it needs, before a curve is requested. So the
extension is enabled quickly even if a library is missing; the operator then reports which one.
"""

from . import command_line, preferences, settings
from .interface import curve_list, map_rows, menus, panels
from .operators import (
    convert_curve,
    design_curve,
    live_update,
    long_solves,
    maps,
    turns,
    update_curves,
)
from .scene import designers
from .tool import edit_operator, toolbar

MODULES = (
    preferences,
    settings,
    turns,
    design_curve,
    convert_curve,
    update_curves,
    maps,
    live_update,
    edit_operator,
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
    long_solves.stop_all()
    for module in reversed(MODULES):
        module.unregister()
    designers.forget()
