"""Tests data files with their digests, the generated documents, and the command `all`."""

import importlib
import shutil

import pytest

from benchmarks import __main__ as command
from benchmarks import documents, evidence, report
from benchmarks.__main__ import MEASUREMENTS
from benchmarks.scale import Scale


def test_documents_are_those_that_the_data_give():
    records = report.kept_records(MEASUREMENTS)
    assert records
    for path, text in documents.generated(records).items():
        assert path.read_text(encoding="utf-8") == text, (
            f"{path.name} differs from its data: run python -m benchmarks write"
        )


@pytest.fixture
def stale_after(tmp_path, monkeypatch):
    """Function that changes a file of a copy of the sources, and names whose digest changes."""
    for folder in ("nicmm_core", "kernels", "benchmarks", "tests/oracles"):
        shutil.copytree(
            evidence.ROOT / folder,
            tmp_path / folder,
            ignore=shutil.ignore_patterns("data", "figures", "quick", "__pycache__", "*.so"),
        )
    monkeypatch.setattr(evidence, "ROOT", tmp_path)
    before = {name: evidence.code_behind(name) for name in MEASUREMENTS}

    def changed(file, change):
        path = tmp_path / file
        text = path.read_text(encoding="utf-8")
        assert change(text) != text
        path.write_text(change(text), encoding="utf-8")
        evidence._digest.cache_clear()
        return {name for name in MEASUREMENTS if evidence.code_behind(name) != before[name]}

    yield changed
    evidence._digest.cache_clear()


OF_THE_CODE = set(MEASUREMENTS) - {"portfolio"}
"""Measurements whose results depend on the code."""


def statement_added(text):
    return text + "\nMORE = 1\n"


def with_room(room):
    """Measurements that depend on a folder of the core."""
    modules = {name: importlib.import_module(f"benchmarks.{name}") for name in MEASUREMENTS}
    return {n for n, module in modules.items() if room in (getattr(module, "ROOMS", (room,)) or ())}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("file", "expected"),
    [
        ("nicmm_core/relaxation/relaxing.py", with_room("relaxation")),
        ("nicmm_core/strokes/stretch.py", with_room("strokes")),
        ("nicmm_core/improvement.py", OF_THE_CODE),
        ("kernels/source/tracing.c", OF_THE_CODE),
        ("benchmarks/samples.py", OF_THE_CODE),
        ("benchmarks/courses.py", set()),
        ("benchmarks/plots.py", set()),
    ],
)
def test_a_statement_asks_for_the_measurements_that_depend_on_it(stale_after, file, expected):
    assert stale_after(file, statement_added) == expected


@pytest.mark.slow
def test_comments_and_wording_ask_for_nothing_and_samples_do(stale_after):
    own = "benchmarks/messes.py"
    comment = "\n# More.\n"
    assert not stale_after("nicmm_core/improvement.py", lambda text: text + comment)
    assert not stale_after(own, lambda t: t.replace("in chains of these", "one after the other"))
    assert stale_after(own, lambda t: t.replace("scale.choose(", "1 + scale.choose(")) == {"messes"}


def test_measurements_of_the_network_do_not_depend_on_the_search():
    assert {"pretraining", "transfer"} <= with_room("paper") - with_room("courses")
    assert {"courses", "runtime", "messes"} <= with_room("courses")
    assert with_room("offsets") == {"offsets", "corpus", "fuzz"}


@pytest.fixture
def kept(tmp_path, monkeypatch):
    """An empty data folder, and only two measurements."""
    monkeypatch.setattr(evidence, "DATA", tmp_path)
    monkeypatch.setattr(command, "MEASUREMENTS", ("messes", "fuzz"))
    monkeypatch.setattr(command, "write", lambda: None)


def fake(monkeypatch, begun, fails=(), interrupted=()):
    def run_apart(name, scale):
        begun.append(name)
        if name in interrupted:
            raise KeyboardInterrupt
        if name not in fails:
            evidence.save(name, evidence.code_behind(name), {}, 7200.0, scale)
        return name not in fails

    monkeypatch.setattr(command, "run_apart", run_apart)


@pytest.mark.slow
def test_stale_names_what_was_measured_with_other_code(kept, monkeypatch, capsys):
    monkeypatch.setattr(command.sys, "argv", ["benchmarks", "stale"])
    assert command.main() == 1
    assert capsys.readouterr().out == "messes\nfuzz\n2 of 2 measurements are stale\n"
    for name in command.MEASUREMENTS:
        evidence.save(name, evidence.code_behind(name), {}, 1.0, Scale.FULL)
    assert command.main() == 0
    assert capsys.readouterr().out == ""
    evidence.save("messes", "0" * 16, {}, 1.0, Scale.FULL)
    assert command.main() == 1
    assert capsys.readouterr().out == "messes\n1 of 2 measurements are stale\n"


@pytest.mark.slow
def test_an_interrupted_run_goes_on_where_it_was(kept, monkeypatch):
    begun = []
    fake(monkeypatch, begun, interrupted=("fuzz",))
    with pytest.raises(KeyboardInterrupt):
        command.measure_all(Scale.FULL, 1)
    assert begun == ["messes", "fuzz"]
    fake(monkeypatch, begun)
    command.measure_all(Scale.FULL, 1)
    assert begun == ["messes", "fuzz", "fuzz"]
    command.measure_all(Scale.FULL, 1)
    assert begun == ["messes", "fuzz", "fuzz"]


def test_a_failure_stops_nothing_else(kept, monkeypatch):
    begun = []
    fake(monkeypatch, begun, fails=("messes",))
    assert command.measure_all(Scale.FULL, 2) == ["messes"]
    assert sorted(begun) == ["fuzz", "messes"]
    assert evidence.is_kept("fuzz") and not evidence.is_kept("messes")


@pytest.mark.slow
def test_a_run_apart_keeps_its_output(monkeypatch, tmp_path):
    monkeypatch.setattr(command, "_log_of", lambda name: tmp_path / "log.txt")
    assert not command.run_apart("nothing", Scale.SMOKE)
    assert "invalid choice: 'nothing'" in (tmp_path / "log.txt").read_text()
