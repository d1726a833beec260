"""Translations of labels and tooltips: complete, well formed, and registered with Blender."""

import re
from pathlib import Path

import bpy
import pytest

from tests.blender.own_strings import own_strings
from tests.blender.scenes import module

ONLY_IN_SCRIPTS = ("for scripts", "Name of the designed curve", "Name of a designed curve")
"""Parts of tooltips that no user sees in the window."""

INTERNAL = {"is_parallel", "n_splines", "problem"}
"""Names of properties that are never shown."""


@pytest.fixture(params=["de_DE", "ja_JP"])
def table(request, extension):
    return module(extension, "translations").LOCALES[request.param]


def test_every_label_and_tooltip_is_translated(extension, table):
    missing = [
        text
        for text in own_strings(extension.name)
        if text not in table
        and text not in INTERNAL
        and not any(part in text for part in ONLY_IN_SCRIPTS)
    ]
    assert missing == []


def test_translations_are_labels_too(table):
    for text, words in table.items():
        assert words and words == words.strip()
        assert not words.endswith((".", "。")), text  # Blender adds it
        assert set(re.findall(r"\d+", text)) <= set(re.findall(r"\d+", words)), text


def test_nothing_is_translated_that_does_not_exist(extension, table):
    folder = Path(extension.folder) / "nicmm_blender" / "interface"
    sources = "".join(path.read_text(encoding="utf-8") for path in folder.glob("*.py"))
    known = set(own_strings(extension.name))
    assert [text for text in table if text not in known and f'"{text}"' not in sources] == []


@pytest.mark.parametrize(
    ("locale", "context", "label"),
    [
        ("de_DE", "Operator", "Kurve auf der Oberfläche entwerfen"),
        ("ja_JP", "Operator", "サーフェス上にカーブを設計"),
        ("en_US", "Operator", "Design Curve on Surface"),
    ],
)
def test_blender_shows_them(extension, locale, context, label):
    view = bpy.context.preferences.view
    languages = [each.identifier for each in type(view).bl_rna.properties["language"].enum_items]
    if locale not in languages:
        pytest.skip("this build of Blender has no translations; a Blender application has them")
    before = view.language
    try:
        view.language = locale
        shown = bpy.app.translations.pgettext("Design Curve on Surface", context)
        assert shown == label
    finally:
        view.language = before
