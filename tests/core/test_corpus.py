"""Meshes that nobody made for this: a valid curve or a typed error on each."""

from pathlib import Path

import igl
import numpy as np
import pytest

import nicmm_core as nicmm
from benchmarks import corpus
from nicmm_core.files import MESH_FORMATS, read_mesh
from tests.core.checks import assert_valid_design

CORPUS = Path(__file__).parents[3] / "shared" / "meshes" / "shrec16"
COUNT = 6

LARGEST_FILE = 150_000
"""Bytes; larger ones take long."""

SHARE = 5
"""Every how many files."""


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


def defective_files():
    """A few small files of the collections of meshes with defects, each with another request."""
    files = [
        (folder, path)
        for folder in ("nasty", "thingi10k")
        for path in sorted((CORPUS.parent / folder).glob("*.*"))
        if path.suffix in MESH_FORMATS and path.stat().st_size < LARGEST_FILE
    ]
    return files[::SHARE]


@pytest.mark.skipif(not defective_files(), reason="the meshes are not beside this folder")
@pytest.mark.parametrize(("folder", "path"), defective_files(), ids=lambda part: Path(part).stem)
def test_mesh_with_defects_gives_a_good_curve_or_the_error_that_is_due(folder, path):
    request = len(path.stem) % len(corpus.REQUESTS)
    outcome = corpus.outcome(corpus.Item(folder, path.name, path, request))
    assert outcome.verdict in (corpus.GOOD, corpus.DUE), outcome.words
