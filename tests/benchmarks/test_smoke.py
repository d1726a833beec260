"""Tests that every measurement runs at the smallest scale and writes its data and section."""

import dataclasses
import importlib
import pkgutil
import re
import sys
from pathlib import Path

import matplotlib.image
import pytest

import nicmm_core
from benchmarks import evidence, report
from benchmarks.__main__ import MEASUREMENTS, measure_one
from benchmarks.scale import Scale
from nicmm_core.network.finetuning import FinetuningConfig

pytestmark = pytest.mark.slow

FEW_ITERATIONS = 40
CORE = evidence.ROOT / "nicmm_core"


@pytest.fixture(autouse=True)
def short_finetuning(monkeypatch):
    """Limit fine-tuning to a few iterations by default, because it takes most of the time."""
    defaults = tuple(
        FEW_ITERATIONS if field.name == "iterations" else field.default
        for field in dataclasses.fields(FinetuningConfig)
    )
    monkeypatch.setattr(FinetuningConfig.__init__, "__defaults__", defaults)


@pytest.fixture
def quick_output(tmp_path, monkeypatch):
    for module in (evidence, report):
        monkeypatch.setattr(module, "QUICK_OUTPUT", tmp_path / "quick")
    monkeypatch.setattr(evidence, "DATA", tmp_path / "full" / "data")
    monkeypatch.setattr(report, "RESULTS", tmp_path / "full" / "RESULTS.md")
    monkeypatch.setattr(report, "FIGURES", tmp_path / "full" / "figures")
    return tmp_path / "quick"


@pytest.fixture
def rooms_entered():
    """Folders of the core in which a function was called; imports alone do not count."""
    for module in pkgutil.walk_packages(nicmm_core.__path__, "nicmm_core."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    files = set()

    def note(frame, event, _argument):
        if event == "call":
            files.add(frame.f_code.co_filename)

    def rooms():
        paths = [Path(name) for name in files if name.startswith(str(CORE))]
        return {path.relative_to(CORE).parts[0] for path in paths}

    sys.setprofile(note)
    yield rooms
    sys.setprofile(None)


@pytest.mark.parametrize("name", MEASUREMENTS)
def test_measurement_keeps_its_data_and_writes_its_section(
    name, tmp_path, quick_output, rooms_entered
):
    without = getattr(importlib.import_module(f"benchmarks.{name}"), "WITHOUT", ())
    if not without:
        sys.setprofile(None)
    measure_one(name, Scale.SMOKE)
    sys.setprofile(None)

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
    assert not rooms_entered() & set(without)
    assert set(without) <= {path.name for path in CORE.iterdir() if path.is_dir()}
