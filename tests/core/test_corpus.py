"""Meshes that nobody made for this: a valid curve or a typed error on each."""

from pathlib import Path

import igl
import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core.files import read_mesh
from tests.core.checks import assert_valid_design

CORPUS = Path(__file__).parents[3] / "shared" / "meshes" / "shrec16"
COUNT = 6


def some_files():
    """A few files from all over the collection."""
    files = sorted(file for file in CORPUS.rglob("*") if file.suffix in (".obj", ".off", ".ply"))
    return files[:: max(1, len(files) // COUNT)][:COUNT]


@pytest.mark.skipif(not some_files(), reason="the collection of meshes is not beside this folder")
@pytest.mark.parametrize(
    "path", some_files(), ids=lambda path: f"{path.parent.parent.name}-{path.stem}"
)
def test_subdivided_scan_gives_a_valid_curve_or_a_typed_error(path):
    coarse = read_mesh(path)
    mesh = nicmm.Mesh(*igl.loop(coarse.vertices.copy(), coarse.faces.copy(), 2))
    chosen = np.random.default_rng(len(path.stem)).choice(len(mesh.vertices), 4, replace=False)
    try:
        design = nicmm.design_curve(mesh, chosen, order="shortest")
    except nicmm.UnreachableError as error:
        assert "control_points" in str(error)
        return
    assert_valid_design(mesh, design)
