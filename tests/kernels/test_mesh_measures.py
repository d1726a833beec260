"""Measures are those of NumPy, and components those of SciPy, however the work is divided."""

import nicmm_kernels
import numpy as np
import pytest
from nicmm_kernels import library, mesh_measures
from scipy import sparse
from scipy.sparse import csgraph


@pytest.fixture(params=[False, True])
def in_parts(request, monkeypatch):
    """Whether the work is divided among threads and calls."""
    if request.param:
        monkeypatch.setattr(library, "MOST_WORK", 17)
        monkeypatch.setattr(mesh_measures, "ROWS_OF_A_THREAD", 10)
    return request.param


@pytest.mark.usefixtures("in_parts")
def test_areas_and_lengths():
    rng = np.random.default_rng(1)
    vertices, faces = rng.normal(size=(40, 3)), rng.integers(0, 40, (100, 3))
    first, second, third = vertices[faces.T]
    np.testing.assert_array_equal(
        nicmm_kernels.area_vectors(vertices, faces, lambda: None),
        np.cross(second - first, third - first),
    )
    edges = np.ascontiguousarray(faces[:, :2])
    np.testing.assert_allclose(
        nicmm_kernels.edge_lengths(vertices, edges, lambda: None),
        np.linalg.norm(second - first, axis=1),
        rtol=1e-15,
    )


@pytest.mark.parametrize("arcs", [0, 20, 60, 300])
def test_components(arcs, in_parts):
    one, other = np.random.default_rng(arcs).integers(0, 100, (2, arcs))
    calls = []
    number, label = nicmm_kernels.connected_components(100, one, other, lambda: calls.append(1))
    graph = sparse.coo_array((np.ones(arcs), (one, other)), shape=(100, 100))
    expected, labels = csgraph.connected_components(graph, directed=False)
    assert number == expected
    np.testing.assert_array_equal(label, labels)
    assert len(calls) == (max(0, (arcs - 1) // 17) if in_parts else 0)


def test_wrong_indices_are_errors():
    vertices = np.zeros((3, 3))
    with pytest.raises(nicmm_kernels.KernelError, match="out of range"):
        nicmm_kernels.area_vectors(vertices, np.array([[0, 1, 3]]), lambda: None)
    with pytest.raises(nicmm_kernels.KernelError, match="out of range"):
        nicmm_kernels.edge_lengths(vertices, np.array([[0, -1]]), lambda: None)
    with pytest.raises(nicmm_kernels.KernelError, match="out of range"):
        nicmm_kernels.connected_components(2, np.array([0]), np.array([2]), lambda: None)
