"""Tests data files with their fingerprints, the generated documents, and the command `all`."""

import importlib

import pytest

from benchmarks import __main__ as command
from benchmarks import documents, evidence, report
from benchmarks.__main__ import MEASUREMENTS
from benchmarks.scale import Scale

RELAXATION = evidence.ROOT / "nicmm_core" / "relaxation" / "relaxing.py"


def changed(path, extra):
    """Function that reads files of the project, one of them with an addition at its end."""

    def read(asked):
        return asked.read_bytes() + (extra.encode() if asked == path else b"")

    return read


def affected(path, extra):
    """Measurements whose fingerprint changes when a file gets an addition."""
    read = changed(path, extra)
    return {
        name
        for name in MEASUREMENTS
        if evidence.code_behind(name, read) != evidence.code_behind(name)
    }


def test_documents_are_those_that_the_data_give():
    records = report.kept_records(MEASUREMENTS)
    assert records
    for path, text in documents.generated(records).items():
        assert path.read_text(encoding="utf-8") == text, (
            f"{path.name} differs from its data: run python -m benchmarks write"
        )


@pytest.mark.slow
def test_a_statement_asks_for_new_measurements_where_it_is_run_only():
    without = {
        name
        for name in MEASUREMENTS
        if "relaxation" in getattr(importlib.import_module(f"benchmarks.{name}"), "WITHOUT", ())
    }
    assert {"pretraining", "transfer"} <= without
    found = affected(RELAXATION, "\nMORE = 1\n")
    assert {"courses", "runtime", "messes"} <= found
    assert found == set(MEASUREMENTS) - without


@pytest.mark.slow
def test_a_comment_asks_for_nothing():
    read = changed(RELAXATION, "\n# More.\n")
    assert evidence.code_behind("courses", read) == evidence.code_behind("courses")


@pytest.mark.slow
def test_wording_asks_for_nothing():
    path = evidence.ROOT / "benchmarks" / "messes.py"

    def reworded(asked):
        text = asked.read_bytes()
        return (
            text.replace(b"in chains of these", b"one after the other") if asked == path else text
        )

    assert evidence.code_behind("messes", reworded) == evidence.code_behind("messes")

    def fewer(asked):
        text = asked.read_bytes()
        return text.replace(b"scale.choose(", b"1 + scale.choose(") if asked == path else text

    assert evidence.code_behind("messes", fewer) != evidence.code_behind("messes")


def test_weights_and_oracles_count():
    code = evidence.code_behind("messes")
    assert "tests/oracles/checker.py" in code
    assert any(path.startswith(evidence.WEIGHTS) for path in code)
    assert not any(path.startswith("nicmm_blender") for path in code)


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
def test_stale_says_what_changed(kept, monkeypatch, capsys):
    assert command.list_stale() == 1
    assert capsys.readouterr().out == "messes: never measured\nfuzz: never measured\n"
    for name in command.MEASUREMENTS:
        evidence.save(name, evidence.code_behind(name), {}, 1.0, Scale.FULL)
    assert command.list_stale() == 0
    assert capsys.readouterr().out == ""
    read = changed(RELAXATION, "\nMORE = 1\n")
    assert evidence.what_changed("messes", read) == ["nicmm_core/relaxation/relaxing.py"]


@pytest.mark.slow
def test_an_interrupted_run_goes_on_where_it_was(kept, monkeypatch):
    begun = []
    fake(monkeypatch, begun, interrupted=("fuzz",))
    with pytest.raises(KeyboardInterrupt):
        command.measure_all(Scale.FULL, None, 1)
    assert begun == ["messes", "fuzz"]
    fake(monkeypatch, begun)
    command.measure_all(Scale.FULL, None, 1)
    assert begun == ["messes", "fuzz", "fuzz"]
    command.measure_all(Scale.FULL, None, 1)
    assert begun == ["messes", "fuzz", "fuzz"]


def test_a_failure_stops_nothing_else(kept, monkeypatch):
    begun = []
    fake(monkeypatch, begun, fails=("messes",))
    assert command.measure_all(Scale.FULL, None, 2) == ["messes"]
    assert sorted(begun) == ["fuzz", "messes"]
    assert evidence.is_kept("fuzz") and not evidence.is_kept("messes")


@pytest.mark.slow
def test_a_run_apart_keeps_its_output(monkeypatch, tmp_path):
    monkeypatch.setattr(command, "_log_of", lambda name: tmp_path / "log.txt")
    assert not command.run_apart("nothing", Scale.SMOKE)
    assert "invalid choice: 'nothing'" in (tmp_path / "log.txt").read_text()


@pytest.mark.slow
def test_nothing_is_begun_that_would_end_after_the_hours_given(kept, monkeypatch):
    begun = []
    fake(monkeypatch, begun)
    command.measure_all(Scale.FULL, None, 1)
    for name in command.MEASUREMENTS:
        record = evidence.load(name)
        record["code"] = None
        (evidence.DATA / f"{name}.json").write_text(evidence.json.dumps(record))
    command.measure_all(Scale.FULL, 1.0, 1)
    assert begun == ["messes", "fuzz"]
    command.measure_all(Scale.FULL, 3.0, 1)
    assert begun == ["messes", "fuzz", "messes", "fuzz"]
