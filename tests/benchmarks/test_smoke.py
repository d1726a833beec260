"""Tests that every measurement runs at the smallest scale and writes its data and section."""

import importlib
import inspect
import pkgutil
import re
from dataclasses import replace
from itertools import chain, islice

import matplotlib.image
import pytest

from benchmarks import corpus, elastic_curve, evidence, report
from benchmarks.__main__ import MEASUREMENTS, measure_one
from benchmarks.scale import Scale
from nicmm_core import improvement
from nicmm_core.paper import fitting, variational

pytestmark = pytest.mark.slow

FEW_STEPS = 4
FEW_ITERATIONS = 12
FEW_MESHES = 6


@pytest.fixture(autouse=True)
def short_computations(monkeypatch):
    """Few attempts, meshes, iterations, and steps of reference curves; they take longest."""
    monkeypatch.setattr(improvement, "MOST_WORK", 0)
    for function in (fitting.fit, variational.solve):
        config, watch = function.__defaults__
        few_iterations = replace(config, iterations=FEW_ITERATIONS)
        monkeypatch.setattr(function, "__defaults__", (few_iterations, watch))
    monkeypatch.setattr(elastic_curve, "MOST_STEPS", FEW_STEPS)
    few = list(islice(corpus.defective_meshes(), FEW_MESHES))
    monkeypatch.setattr(corpus, "defective_meshes", lambda: iter(few))


@pytest.fixture
def quick_output(tmp_path, monkeypatch):
    for module in (evidence, report):
        monkeypatch.setattr(module, "QUICK_OUTPUT", tmp_path / "quick")
    monkeypatch.setattr(evidence, "DATA", tmp_path / "full" / "data")
    monkeypatch.setattr(report, "RESULTS", tmp_path / "full" / "RESULTS.md")
    monkeypatch.setattr(report, "FIGURES", tmp_path / "full" / "figures")
    return tmp_path / "quick"


def functions_in(module):
    """Functions and methods that a module defines."""
    for value in vars(module).values():
        if getattr(value, "__module__", None) != module.__name__:
            continue
        for member in vars(value).values() if inspect.isclass(value) else [value]:
            member = getattr(member, "fget", getattr(member, "func", member))
            member = inspect.unwrap(member) if callable(member) else member
            if inspect.isfunction(member) and member.__code__.co_filename == module.__file__:
                yield member


def fail(*_arguments, **_keywords):
    raise AssertionError("This measurement must not call the folders in WITHOUT")


@pytest.fixture
def close():
    """Make every function in some folders of the core fail; imports alone do not count."""
    codes = {}

    def close_folders(names):
        for name in names:
            package = importlib.import_module(f"nicmm_core.{name}")
            found = pkgutil.iter_modules(package.__path__, f"{package.__name__}.")
            for function in chain(*(functions_in(importlib.import_module(m.name)) for m in found)):
                if not function.__code__.co_freevars:
                    codes[function] = function.__code__
                    function.__code__ = fail.__code__
            assert codes

    yield close_folders
    for function, code in codes.items():
        function.__code__ = code


@pytest.mark.parametrize("name", MEASUREMENTS)
def test_measurement_keeps_its_data_and_writes_its_section(name, tmp_path, quick_output, close):
    close(getattr(importlib.import_module(f"benchmarks.{name}"), "WITHOUT", ()))
    measure_one(name, Scale.SMOKE)

    assert not (tmp_path / "full").exists()
    record = evidence.load(name, Scale.SMOKE)
    section = report.section_text(name, record)
    assert f"`python -m benchmarks {name} --smoke`" in section
    assert "nan" not in section.lower().split()
    shown = re.findall(r"!\[[^\]]*\]\(figures/([^)]+)\)", section)
    written = sorted(path.name for path in quick_output.glob("figures/*"))
    assert sorted(shown) == written
    for figure in written:
        height, width = matplotlib.image.imread(quick_output / "figures" / figure).shape[:2]
        assert min(height, width) > 100
