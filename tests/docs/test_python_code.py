"""Runs the Python code of the documentation that needs no Blender, and the notebook."""

import json

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import improvement, shapes
from tests.docs.pages import PAGES, ROOT, blocks, is_for_blender, numbered

pytestmark = pytest.mark.slow

CODE = {
    page: [each for each in blocks(page, "python") if not is_for_blender(each)] for page in PAGES
}
NOTEBOOK = ROOT / "docs" / "examples" / "first_curves.ipynb"


def names(page, folder):
    """What the code of a page may use without defining it."""
    mesh = shapes.cube(16) if page.name == "feature_loops.md" else numbered(shapes.sphere(4))
    nicmm.write_mesh(folder / "mesh.obj", mesh)
    beside = next(v for v in mesh.faces[(mesh.faces == 41).any(axis=1)][0] if v != 41)
    angle = np.linspace(0.0, 2.0, 100)
    return {
        "nicmm": nicmm,
        "np": np,
        "mesh": mesh,
        "vertices": mesh.vertices,
        "faces": mesh.faces,
        "points": mesh.vertices[[12, 80, 41]],
        "drag": [mesh.vertices[[12, 80, beside]]],
        "designer": nicmm.Designer(mesh),
        "curve": nicmm.design_curve(mesh, [12, 80, 41]).curves[0],
        "stroke": np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1),
        "weights": np.zeros(len(mesh.vertices)),
        "uv": np.zeros((len(mesh.faces), 3, 2)),
    }


@pytest.mark.parametrize("page", [page for page in PAGES if CODE[page]], ids=lambda page: page.stem)
def test_code_of_a_page(page, tmp_path, monkeypatch):
    monkeypatch.setattr(improvement, "MOST_WORK", 0)  # the code has to run, fair or not
    monkeypatch.chdir(tmp_path)
    namespace = names(page, tmp_path)
    for code in CODE[page]:
        exec(compile(code, str(page), "exec"), namespace)


def test_the_cells_of_the_notebook_run_in_order():
    cells = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    namespace = {}
    for cell in cells:
        assert not cell.get("outputs")  # pictures are drawn where it runs
        if cell["cell_type"] == "code":
            exec("".join(cell["source"]), namespace)
    assert namespace["region"].area > 0.0
