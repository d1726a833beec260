# SPDX-License-Identifier: GPL-3.0-or-later
"""The Blender side: reads Blender data, calls the core, writes Blender data.

Nothing here loads the core, or a library that it needs, before a curve is asked for: enabling the
extension stays quick and works where a library is missing, and the operator then says which one.
"""

from . import (
    command_line,
    convert_curve,
    curve_list,
    design_curve,
    designers,
    edit_operator,
    live_update,
    long_solves,
    map_rows,
    maps,
    menus,
    panels,
    preferences,
    settings,
    toolbar,
    turns,
    update_curves,
)

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
