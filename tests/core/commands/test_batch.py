"""Tests of curves on many meshes: files, resuming, failures and errors."""

import csv

import pytest

from nicmm_core.commands import main
from nicmm_core.io.files import read_curve, write_mesh


@pytest.fixture
def jobs(small_ball, tmp_path):
    (tmp_path / "scans").mkdir()
    for name in ("a", "b"):
        write_mesh(tmp_path / "scans" / f"{name}.off", small_ball)
    path = tmp_path / "jobs.csv"
    path.write_text(
        "mesh,points,name\n"
        "scans/a.off,3 60 100,collar\n"
        "scans/a.off,5 17 80 33,belt\n"
        "scans/b.off,3 3 100,impossible\n",
        encoding="utf-8",
    )
    return path


def files(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.slow
def test_curves_are_written_and_failures_listed(jobs, tmp_path, capsys):
    folder = tmp_path / "curves"
    arguments = ["batch", str(jobs), "-o", str(folder), "--processes", "1", "--order", "shortest"]
    assert main(arguments) == 2
    assert "1 of 3 curves could not be designed" in capsys.readouterr().err
    assert files(folder) == ["belt.json", "collar.json", "failures.csv"]
    assert len(read_curve(folder / "belt.json").control_index) == 4
    (failure,) = csv.DictReader((folder / "failures.csv").open(encoding="utf-8"))
    assert failure["points"] == "3 3 100" and "control_points" in failure["message"]

    # The second run designs only what is missing, and removes the list once all curves exist.
    jobs.write_text(jobs.read_text().replace("3 3 100", "4 60 100"))
    before = (folder / "belt.json").stat().st_mtime_ns
    assert main(arguments) == 0
    assert files(folder) == ["belt.json", "collar.json", "impossible.json"]
    assert (folder / "belt.json").stat().st_mtime_ns == before


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("mesh,points\na.off,\n", "line 2: mesh or points is missing"),
        ("file,points\na.off,1 2 3\n", "line 2: mesh or points is missing"),
        ("mesh,points\na.off,1 2 3\na.off,4 5 6\n", "line 3: another line also writes a.json"),
    ],
)
def test_unusable_jobs(tmp_path, capsys, text, message):
    path = tmp_path / "jobs.csv"
    path.write_text(text)
    assert main(["batch", str(path), "-o", str(tmp_path / "curves")]) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "curves").exists()


def test_a_missing_file(tmp_path, capsys):
    assert main(["batch", str(tmp_path / "none.csv"), "-o", str(tmp_path)]) == 2
    assert "check the path" in capsys.readouterr().err
