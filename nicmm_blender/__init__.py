# SPDX-License-Identifier: GPL-3.0-or-later
"""The Blender side: reads Blender data, calls the core, writes Blender data.

Nothing here loads the core, or a library that it needs, before a curve is asked for: enabling the
extension stays quick and works where a library is missing, and the operator then says which one.
"""

from . import designers, interface, operators, settings


def register() -> None:
    settings.register()
    operators.register()
    interface.register()


def unregister() -> None:
    interface.unregister()
    operators.unregister()
    settings.unregister()
    designers.forget()
