"""Every measurement runs at the smallest scale and writes its section with its figures."""

import dataclasses
import importlib
import re

import matplotlib.image
import pytest

from benchmarks import report
from benchmarks.__main__ import MEASUREMENTS
from benchmarks.scale import Scale
from nicmm_core.network.finetuning import FinetuningConfig

pytestmark = pytest.mark.slow

FEW_ITERATIONS = 40


@pytest.fixture(autouse=True)
def short_finetuning(monkeypatch):
    """Stop fine-tuning early wherever the default configuration is used: time is spent there."""
    defaults = tuple(
        FEW_ITERATIONS if field.name == "iterations" else field.default
        for field in dataclasses.fields(FinetuningConfig)
    )
    monkeypatch.setattr(FinetuningConfig.__init__, "__defaults__", defaults)


@pytest.mark.parametrize("name", MEASUREMENTS)
def test_measurement_writes_its_section_and_figures(name, tmp_path, monkeypatch):
    monkeypatch.setattr(report, "RESULTS", tmp_path / "full" / "RESULTS.md")
    monkeypatch.setattr(report, "FIGURES", tmp_path / "full" / "figures")
    monkeypatch.setattr(report, "QUICK_OUTPUT", tmp_path / "quick")

    importlib.import_module(f"benchmarks.{name}").run(Scale.SMOKE)

    assert not (tmp_path / "full").exists()
    text = (tmp_path / "quick" / "RESULTS.md").read_text()
    section = re.search(rf"<!-- {name} -->\n## (.+?)<!-- /{name} -->", text, flags=re.S)
    assert section is not None
    assert f"python -m benchmarks {name} --smoke" in section[1]
    assert "nan" not in section[1].lower().split()
    shown = re.findall(r"!\[[^\]]*\]\(figures/([^)]+)\)", section[1])
    written = sorted(path.name for path in (tmp_path / "quick").glob("figures/*"))
    assert sorted(shown) == written
    for figure in written:
        height, width = matplotlib.image.imread(tmp_path / "quick" / "figures" / figure).shape[:2]
        assert min(height, width) > 100
