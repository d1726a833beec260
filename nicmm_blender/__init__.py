# SPDX-License-Identifier: GPL-3.0-or-later
"""The Blender side: reads Blender data, calls the core, writes Blender data.

Nothing here loads the core, or a library that it needs, before a curve is asked for: enabling the
extension stays quick and works where a library is missing, and the operator then says which one.
"""

from . import designers, edit_operator, interface, operators, settings, toolbar


def register() -> None:
    settings.register()
    operators.register()
    edit_operator.register()
    interface.register()
    toolbar.register()


def unregister() -> None:
    toolbar.unregister()
    interface.unregister()
    edit_operator.unregister()
    operators.unregister()
    settings.unregister()
    designers.forget()
