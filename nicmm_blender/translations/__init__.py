# SPDX-License-Identifier: GPL-3.0-or-later
"""Translated labels and tooltips, by Blender's own translation functions.

German and Japanese are examples; no native speaker has read them. Texts that a table lacks appear
in English: descriptions of properties that only scripts use, and messages. A word that Blender
itself translates keeps Blender's translation. To add a language, add a table and its locale to
`LOCALES`.
"""

from __future__ import annotations

import bpy

from . import german, japanese

LOCALES = {"de_DE": german.TABLE, "ja_JP": japanese.TABLE}
"""The tables, by Blender's names of locales."""

CONTEXTS = ("*", "Operator")
"""Contexts in which Blender looks labels up: the default, and that of operators."""


def register() -> None:
    bpy.app.translations.register(
        __name__,
        {
            locale: {
                (context, text): words for text, words in table.items() for context in CONTEXTS
            }
            for locale, table in LOCALES.items()
        },
    )


def unregister() -> None:
    bpy.app.translations.unregister(__name__)
