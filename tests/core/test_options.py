"""Tests that the core, the command line and all signatures follow the table of options."""

import inspect
import subprocess
import sys

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import commands, options
from nicmm_core.arguments import checked_options
from nicmm_core.options import Choice, Kind, Option
from nicmm_core.request import Request

DEFAULTS = {option.name: option.default for option in options.OPTIONS}
BESIDE = {"progress"}
"""Arguments of `design_curve` that are not options of the curve."""

ADDED = (
    Option("torsion", Kind.NUMBER, 2.0, "Torsion", "How far it twists", limits=(0.0, 5.0)),
    Option(
        "ends",
        Kind.CHOICE,
        "free",
        "Ends",
        "What the ends do",
        choices=(Choice("free", "Free", ""), Choice("at-rim", "At the Rim", "")),
    ),
    Option("margin", Kind.LENGTH, 0.0, "Margin", "Distance from stairs", needs=("stairs",)),
    Option("stairs", Kind.WEIGHTS, None, "Stairs", "Where it is steep"),
    Option("wavy", Kind.SWITCH, False, "Wavy", "Make waves"),
    Option("turns", Kind.COUNT, 1, "Turns", "How often it winds", limits=(0, 9)),
)


def keywords(function):
    return {
        name: parameter.default
        for name, parameter in inspect.signature(function).parameters.items()
        if parameter.kind is inspect.Parameter.KEYWORD_ONLY
    }


def test_signatures_have_the_options_of_the_table():
    found = keywords(nicmm.design_curve)
    assert {name: found[name] for name in found if name not in BESIDE} == DEFAULTS
    more = keywords(nicmm.Designer.design)
    assert {name: more[name] for name in found} == found
    assert more.keys() - found.keys() == {"start", "max_iterations"}
    fields = {"points", *DEFAULTS}
    assert set(inspect.signature(Request).parameters) == fields


def test_every_option_is_described_in_the_docstring():
    words = inspect.getdoc(nicmm.design_curve)
    for name in keywords(nicmm.design_curve):
        assert name in words


@pytest.fixture
def added(monkeypatch):
    monkeypatch.setattr(options, "OPTIONS", (*options.OPTIONS, *ADDED))


@pytest.mark.usefixtures("added")
class TestAnOptionThatIsAdded:
    """A new option is checked in the core and accepted on the command line."""

    def checked(self, mesh, **given):
        named = {option.name: option.default for option in options.OPTIONS}
        return checked_options(mesh, {**named, **given})

    def test_core(self, small_ball):
        weights = np.zeros(len(small_ball.vertices))
        found = self.checked(small_ball, torsion=3, ends="at-rim", stairs=weights, margin=0.1)
        assert (found["torsion"], found["ends"], found["margin"]) == (3.0, "at-rim", 0.1)
        for name, bad in [
            ("torsion", 6.0),
            ("torsion", np.nan),
            ("torsion", "much"),
            ("ends", "bound"),
            ("ends", 3),
            ("wavy", "yes"),
            ("stairs", weights + 2.0),
            ("margin", -1.0),
            ("turns", 2.5),
            ("turns", True),
            ("turns", 10),
            ("margin", 0.1),  # without the option that it needs
        ]:
            with pytest.raises(nicmm.ArgumentError, match=name):
                self.checked(small_ball, **{name: bad})

    def test_command_line(self, capsys):
        with pytest.raises(SystemExit):
            commands.main(["design", "--help"])
        shown = capsys.readouterr().out
        for option in ADDED:
            assert f"--{option.name}" in shown
        given = commands.parser().parse_args(
            ["design", "m.obj", "--points", "1", "-o", "c.obj", "--ends", "at-rim", "--wavy"]
        )
        assert (given.ends, given.wavy, given.torsion) == ("at-rim", True, 2.0)


def test_the_table_loads_without_the_core():
    """Blender reads the table when the extension is enabled."""
    code = "import nicmm_core.options, sys; print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.split()
    assert not {"igl", "scipy", "numpy", "torch"} & set(loaded)


def test_every_name_of_the_package_can_be_found():
    for name in nicmm.__all__:
        assert getattr(nicmm, name) is not None
    assert set(nicmm.__all__) <= set(dir(nicmm))
    with pytest.raises(AttributeError, match="nothing_of_this_name"):
        _ = nicmm.nothing_of_this_name
