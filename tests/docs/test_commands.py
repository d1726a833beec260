"""Runs the lines of the documentation that call the command nicmm."""

import shlex

import pytest

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.commands import main
from tests.docs.pages import PAGES, blocks, numbered

pytestmark = pytest.mark.slow

LINES = {
    page: [
        line.partition("  #")[0]
        for code in blocks(page, "sh")
        for line in code.replace("\\\n", " ").splitlines()
        if line.startswith("nicmm ")
    ]
    for page in PAGES
}


@pytest.mark.parametrize(
    "page", [page for page in PAGES if LINES[page]], ids=lambda page: page.stem
)
def test_commands_of_a_page(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    nicmm.write_mesh("mesh.obj", numbered(shapes.sphere(4)))
    for table in blocks(page, "text"):
        (tmp_path / "jobs.csv").write_text(table, encoding="utf-8")
    for line in LINES[page]:
        assert main(shlex.split(line)[1:]) == 0, (line, capsys.readouterr().err)
