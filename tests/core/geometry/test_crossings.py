"""Tests crossings of polylines against brute force, and in degenerate cases."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import nicmm_core as nicmm
from nicmm_core.geometry.crossings import crossing_segments
from nicmm_core.geometry.surface_points import SurfacePoints
from tests.core.checks import curve_through, flipped, renumbered

TRIANGLE = nicmm.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
FAN = nicmm.Mesh(
    [[0, 0, 0], *([np.cos(a), np.sin(a), 0] for a in np.arange(6) * np.pi / 3)],
    [[0, 1 + k, 1 + (k + 1) % 6] for k in range(6)],
)


def in_triangle(points):
    """Points (x, y) of the triangle above."""
    x, y = np.transpose(np.asarray(points, dtype=float))
    return SurfacePoints(np.zeros(len(x), dtype=np.int64), np.stack([1 - x - y, x, y], axis=1))


def pairs(mesh, polyline, closed):
    return {
        tuple(sorted(pair)) for pair in crossing_segments(mesh.faces, polyline, closed).tolist()
    }


def pairs_by_solving(points, closed):
    """Pairs of crossing segments, from the parameters at which their lines intersect."""
    n = len(points)
    count = n if closed else n - 1
    found = set()
    for i in range(count):
        for j in range(i + 2, count):
            if closed and (j + 1) % n == i:
                continue
            a, b, c, d = points[i], points[(i + 1) % n], points[j], points[(j + 1) % n]
            s, t = np.linalg.solve(np.stack([b - a, c - d], axis=1), c - a)
            if 0 < s < 1 and 0 < t < 1:
                found.add((i, j))
    return found


@given(st.integers(0, 100_000), st.integers(3, 9), st.booleans())
def test_random_polylines_in_one_face_against_brute_force(seed, count, closed):
    points = np.random.default_rng(seed).dirichlet([1, 1, 1], size=count)[:, :2]
    assert pairs(TRIANGLE, in_triangle(points), closed) == pairs_by_solving(points, closed)


@pytest.mark.slow
@given(st.integers(0, 100_000))
def test_random_polylines_over_many_faces_against_brute_force(flat_disc, seed):
    """Parts of straight traces cross exactly where the whole segments do."""
    corners = np.random.default_rng(seed).uniform(-0.6, 0.6, (7, 2))
    controls = np.arange(7)
    curve = curve_through(flat_disc, np.pad(corners, ((0, 0), (0, 1))), controls)
    found = crossing_segments(flat_disc.faces, SurfacePoints(curve.faces, curve.barycentric), True)
    owner = np.searchsorted(curve.control_index, found, side="right") - 1
    assert sorted(map(tuple, np.sort(owner).tolist())) == sorted(pairs_by_solving(corners, True))


BETWEEN = {
    "apart": ([(0.1, 0.1), (0.4, 0.1), (0.4, 0.3), (0.1, 0.3)], set()),
    "crosses": ([(0.1, 0.1), (0.5, 0.3), (0.5, 0.1), (0.1, 0.3)], {(0, 2)}),
    "ends on a segment": ([(0.1, 0.1), (0.5, 0.1), (0.5, 0.4), (0.3, 0.1)], {(0, 2)}),
    "begins on a segment": ([(0.3, 0.1), (0.5, 0.4), (0.5, 0.1), (0.1, 0.1)], {(0, 2)}),
    "ends before a segment": ([(0.1, 0.1), (0.5, 0.1), (0.5, 0.4), (0.3, 0.11)], set()),
    "returns to a point": ([(0.1, 0.1), (0.5, 0.1), (0.5, 0.4), (0.1, 0.1)], {(0, 2)}),
    "runs along itself": (
        [(0.1, 0.1), (0.5, 0.1), (0.5, 0.4), (0.2, 0.1), (0.3, 0.1)],
        {(0, 2), (0, 3)},
    ),
    "on one line, apart": ([(0.1, 0.1), (0.2, 0.1), (0.2, 0.4), (0.3, 0.1), (0.5, 0.1)], set()),
}


@pytest.mark.parametrize(("points", "expected"), BETWEEN.values(), ids=BETWEEN.keys())
def test_open_polylines_by_hand(points, expected):
    assert pairs(TRIANGLE, in_triangle(points), False) == expected


def test_only_a_closed_polyline_has_a_last_segment():
    bow = in_triangle([(0.1, 0.1), (0.5, 0.3), (0.1, 0.3), (0.5, 0.1)])
    assert pairs(TRIANGLE, bow, True) == {(0, 2)}
    assert pairs(TRIANGLE, rolled(bow), True) == {(1, 3)}
    assert pairs(TRIANGLE, rolled(bow), False) == set()


def rolled(points):
    """A closed polyline that starts at its second point."""
    return SurfacePoints(np.roll(points.faces, -1), np.roll(points.barycentric, -1, axis=0))


def test_strands_of_different_faces_do_not_meet():
    """Equal barycentric coordinates in two faces are different points."""
    cross = in_triangle([(0.1, 0.1), (0.5, 0.3), (0.5, 0.1), (0.1, 0.3)])
    two = SurfacePoints(np.array([0, 0, 3, 3]), cross.barycentric)
    assert pairs(FAN, two, False) == set()
    assert pairs(FAN, SurfacePoints(np.zeros(4, np.int64), cross.barycentric), False) == {(0, 2)}


@pytest.mark.parametrize("change", [flipped, renumbered])
def test_neither_numbers_nor_orientation_matter(flat_disc, change):
    angle = np.arange(50) * 2 * np.pi / 50
    x, y = 0.7 * np.cos(2 * angle + 0.1), 0.5 * np.sin(3 * angle + 0.3) + 0.2 * np.cos(2 * angle)
    knot = np.stack([x, y, 0 * angle], axis=1)
    counts = []
    for mesh in (flat_disc, change(flat_disc, 4)):
        curve = curve_through(mesh, knot, [0])
        polyline = SurfacePoints(curve.faces, curve.barycentric)
        counts.append(len(crossing_segments(mesh.faces, polyline, True)))
    # A Lissajous figure with frequencies 2 and 3 has 7 crossings; it is not aligned with the mesh.
    assert counts == [7, 7]


@pytest.mark.parametrize("seed", [None, 1, 2, 3])
def test_a_crossing_on_an_edge_is_found(flat_disc, seed):
    """A figure whose axis lies on edges: three of its crossings are points of two faces."""
    mesh = flat_disc if seed is None else flipped(flat_disc, seed)
    angle = np.arange(50) * 2 * np.pi / 50
    knot = np.stack([0.7 * np.cos(2 * angle), 0.5 * np.sin(3 * angle + 0.4), 0 * angle], axis=1)
    curve = curve_through(mesh, knot, [0])
    found = pairs(mesh, SurfacePoints(curve.faces, curve.barycentric), True)
    places = np.array([curve.points[list(pair)].mean(axis=0) for pair in found])
    # Up to four pairs of segments meet at such a crossing.
    near = np.linalg.norm(places[:, None] - places, axis=2) < mesh.mean_edge_length
    assert len(np.unique(near, axis=0)) == 7


def test_a_point_of_an_edge_passed_twice_is_found():
    """The polyline crosses the edge between faces 0 and 1 twice, at the same point."""
    weights = [[0.2, 0.5, 0.3], [0.4, 0.6, 0.0], [0.3, 0.2, 0.5], [0.2, 0.2, 0.6]]
    weights += [[0.4, 0.0, 0.6], [0.6, 0.3, 0.1]]
    polyline = SurfacePoints(np.array([0, 1, 1, 1, 0, 0]), np.array(weights))
    assert pairs(FAN, polyline, False)


def test_a_vertex_passed_twice_is_found():
    """The polyline passes the centre of the fan twice, in different faces."""
    middle = [1.0, 0.0, 0.0]
    inside = [0.4, 0.3, 0.3]
    weights = [inside, middle, inside, inside, middle, inside]
    polyline = SurfacePoints(np.array([0, 1, 1, 3, 4, 4]), np.array(weights))
    assert pairs(FAN, polyline, False) == {(1, 4)}


def test_a_vertex_passed_once_in_several_faces_is_no_crossing():
    """The same point, the centre of the fan, is given in one face after the other."""
    inside, middle = [0.4, 0.3, 0.3], [1.0, 0.0, 0.0]
    polyline = SurfacePoints(np.array([0, 1, 2, 3, 3]), np.array([inside, *[middle] * 3, inside]))
    assert pairs(FAN, polyline, False) == set()
