"""Tests requests on some of the third-party meshes: a good curve, or an error that is due."""

from pathlib import Path

import numpy as np
import pytest

from nicmm_core.io.files import MESH_FORMATS
from tests.oracles import corpus
from tests.oracles.mesh_files import COLLECTIONS

pytestmark = pytest.mark.slow

SHARES = {"shrec16": 60}
"""One file of that many is tested; the meshes of SHREC16 have no defects."""

SHARE = 20
"""The same for the other collections."""

LARGEST_FILE = 400_000
"""Greatest file size in bytes; larger meshes take long."""


def some_files():
    """Random part of each available collection, with one request per file."""
    generator = np.random.default_rng(corpus.SEED)
    chosen = []
    for folder in corpus.FOLDERS:
        root = COLLECTIONS / folder
        files = sorted(
            path
            for path in root.rglob("*")
            if path.suffix.lower() in MESH_FORMATS and path.stat().st_size < LARGEST_FILE
        )
        count = -(-len(files) // SHARES.get(folder, SHARE))
        places = generator.choice(len(files), count, replace=False)
        chosen += [(folder, files[place]) for place in np.sort(places)]
    return [(*file, number % len(corpus.REQUESTS)) for number, file in enumerate(chosen)]


@pytest.mark.skipif(not some_files(), reason="the meshes are not beside this folder")
@pytest.mark.parametrize(
    ("folder", "path", "request_number"),
    some_files(),
    ids=lambda part: part.stem if isinstance(part, Path) else str(part),
)
def test_a_good_curve_or_the_error_that_is_due(folder, path, request_number):
    name = str(path.relative_to(COLLECTIONS / folder))
    outcome = corpus.outcome(corpus.Item(folder, name, path, request_number))
    assert outcome.verdict in (corpus.GOOD, corpus.DUE), outcome.words
