"""Tests that groups, distinct rows and components are those of NumPy and SciPy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import sparse
from scipy.sparse import csgraph

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry import mesh
from nicmm_core.geometry.grouping import (
    components,
    distinct_rows,
    first_of_components,
    grouped,
    occurrences,
    shortest_chain,
)
from nicmm_core.geometry.surface_points import first_hits, nearest_points

SEEDS = st.integers(0, 10_000)


def some_keys(seed):
    """Random keys: few or many distinct ones, integers or floats, unsorted or sorted."""
    generator = np.random.default_rng(seed)
    size, kinds = generator.integers(0, 90), generator.choice([1, 5, 40, 1000])
    keys = generator.integers(-kinds, kinds, size=size)
    if generator.random() < 0.3:
        keys = np.sort(keys)
    return keys if generator.random() < 0.5 else keys * generator.choice([0.0, -0.5, np.pi])


@given(SEEDS)
def test_order_and_groups(seed):
    keys = some_keys(seed)
    expected = np.argsort(keys, kind="stable")
    order, start, count = grouped(keys)
    _, first, counts = np.unique(keys, return_index=True, return_counts=True)
    np.testing.assert_array_equal(order, expected)
    np.testing.assert_array_equal(order[start], first)
    np.testing.assert_array_equal(count, counts)


@given(SEEDS)
def test_distinct_rows(seed):
    generator = np.random.default_rng(seed)
    rows = generator.integers(-2, 3, size=(generator.integers(0, 60), 3)) * 0.5
    first, number = distinct_rows(rows)
    _, expected, inverse = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    np.testing.assert_array_equal(first, expected)
    np.testing.assert_array_equal(number, inverse.ravel())


@given(SEEDS)
def test_components(seed):
    generator = np.random.default_rng(seed)
    size = int(generator.integers(1, 60))
    one, other = generator.integers(size, size=(2, generator.integers(0, 80)))
    graph = sparse.coo_array((np.ones(len(one)), (one, other)), shape=(size, size))
    count, expected = csgraph.connected_components(graph, directed=False)
    found, label = components(size, one, other)
    assert found == count
    np.testing.assert_array_equal(label, expected)


@pytest.fixture
def bumpy():
    ball = shapes.sphere(4)
    generator = np.random.default_rng(2)
    return ball.vertices * generator.uniform(0.97, 1.03, (len(ball.vertices), 1)), ball.faces


def test_trees_of_some_faces_find_the_same_as_one_of_all(bumpy, monkeypatch):
    generator = np.random.default_rng(1)
    positions = generator.uniform(-1.2, 1.2, (50, 3))
    rays = 3.0 * positions, -positions + 0.2 * generator.normal(size=(50, 3))
    found = []
    for size in (10**9, 900):
        monkeypatch.setattr(mesh, "MOST_FACES_PER_TREE", size)
        surface = nicmm.Mesh(*bumpy)
        near, distance = nearest_points(surface, positions)
        hits, along = first_hits(surface, *rays)
        found.append((near.positions(surface), distance, hits.faces, hits.barycentric, along))
    assert len(surface.face_trees) == 6
    for whole, split in zip(*found, strict=True):
        np.testing.assert_allclose(split, whole, atol=1e-12)
    assert 0 < (hits.faces >= 0).sum() < 50


def test_occurrences_are_those_of_a_direct_comparison():
    generator = np.random.default_rng(3)
    keys, wanted = generator.integers(0, 20, 50), generator.integers(0, 25, 12)
    which, place = occurrences(keys, wanted)
    expected = [(w, k) for w, key in enumerate(wanted) for k in np.flatnonzero(keys == key)]
    assert list(zip(which.tolist(), place.tolist(), strict=True)) == expected
    assert [len(each) for each in occurrences(keys, np.zeros(0, dtype=np.int64))] == [0, 0]


def test_first_nodes_of_components():
    first = first_of_components(6, np.array([4, 5, 2]), np.array([2, 3, 4]))
    assert first.tolist() == [0, 1, 2, 3, 2, 3]


def test_the_shortest_chain_to_any_end():
    beside = {0: [1, 2], 1: [3], 2: [4], 3: [5], 4: [2, 6], 5: [], 6: [5]}
    assert shortest_chain(0, beside.get, lambda node: node in (5, 6)) == [0, 1, 3, 5]
    assert shortest_chain(4, beside.get, lambda node: node == 5) == [4, 6, 5]
    assert shortest_chain(2, beside.get, lambda node: node == 2) == [2]
    assert shortest_chain(1, beside.get, lambda node: node == 0) == []
