"""Tests that strands that touch only on the given mesh are moved apart on the surface."""

import numpy as np
import pytest

from nicmm_core.geometry.curve import curve_on_mesh
from nicmm_core.geometry.surface_points import SurfacePoints
from nicmm_core.repair.strand_separation import separated
from tests.core.checks import grid
from tests.oracles.checker import judge_curve

SIZE = 4
MESH = grid(SIZE)


def vertex(x, y):
    return x * (SIZE + 1) + y


def identified(*pairs):
    """Index of the place of each vertex, where both vertices of each pair have the same place."""
    place = np.arange(len(MESH.vertices))
    for one, other in pairs:
        place[other] = one
    return place


def polyline(*points, closed=False):
    """Polyline through points given by vertex weights, each in a face that contains the next."""
    faces, barycentric = [], []
    for number, point in enumerate(points):
        last = number + 1 == len(points)
        beside = points[number - 1] if last and not closed else points[(number + 1) % len(points)]
        both = np.array(sorted({*point, *beside}))
        face = int(np.flatnonzero(np.isin(MESH.faces, both).sum(axis=1) == len(both))[0])
        faces.append(face)
        barycentric.append([point.get(corner, 0.0) for corner in MESH.faces[face].tolist()])
    return SurfacePoints(np.array(faces), np.array(barycentric))


def along(*vertices):
    """Polyline through vertices."""
    return polyline(*({one: 1.0} for one in vertices))


def shared_places(points, place):
    """Number of points that coincide with another one on the given mesh."""
    here = points.barycentric > 0.0
    keys = []
    for corners, weights, positive in zip(
        place[MESH.faces[points.faces]], points.barycentric, here, strict=True
    ):
        keys.append(tuple(sorted(zip(corners[positive], weights[positive].round(12), strict=True))))
    return len(keys) - len(set(keys))


def assert_simple_on_mesh(points):
    """Assert that the polyline lies on the surface and no strand touches another."""
    curve = curve_on_mesh(MESH, False, points.faces, points.barycentric, np.array([0]))
    assert not judge_curve(MESH, curve, closed=False).faults


STRAIGHT = [vertex(x, 1) for x in range(SIZE + 1)]
"""Vertices along a grid line from rim to rim; all but the first and the last are interior."""

TURNING = [vertex(0, 1), vertex(1, 1), vertex(2, 2), vertex(2, 3), vertex(1, 3), vertex(0, 3)]


@pytest.mark.parametrize("fixed", [[], [1], [3]])
@pytest.mark.parametrize("path", [STRAIGHT, TURNING], ids=["straight", "turning"])
def test_one_strand_goes_round_a_doubled_vertex(path, fixed):
    place = identified((path[1], path[3]))
    before = along(*path)
    assert shared_places(before, place) == 1
    after, number = separated(MESH, place, before, False, np.array([0, *fixed, len(path) - 1]))
    assert shared_places(after, place) == 0
    assert_simple_on_mesh(after)
    gone = np.flatnonzero(number < 0)
    assert len(gone) == 1 and gone[0] in ({1, 3} - set(fixed))
    kept = np.flatnonzero(number >= 0)
    np.testing.assert_allclose(
        after[number[kept]].positions(MESH), before[kept].positions(MESH), atol=0
    )
    # It stays within a small fraction of an edge from the previous curve.
    share = np.linspace(0.0, 1.0, 101)[:, None, None]
    line = before.positions(MESH)
    line = ((1.0 - share) * line[:-1] + share * line[1:]).reshape(-1, 3)
    apart = after.positions(MESH)[:, None] - line[None]
    assert np.linalg.norm(apart, axis=2).min(axis=1).max() < 0.1 / SIZE


def test_a_strand_that_enters_and_leaves_by_one_face():
    corner, beside = vertex(2, 2), vertex(3, 2)
    face = next(f for f in MESH.faces.tolist() if {corner, beside} <= set(f))
    third = next(v for v in face if v not in (corner, beside))
    start, end = {beside: 0.5, third: 0.5}, {corner: 0.1, beside: 0.8, third: 0.1}
    path = polyline(start, {corner: 1.0}, end)
    far = along(vertex(0, 0), vertex(0, 1))
    points = SurfacePoints(
        np.concatenate([path.faces, far.faces]), np.concatenate([path.barycentric, far.barycentric])
    )
    place = identified((corner, vertex(0, 0)))
    after, number = separated(MESH, place, points, False, np.array([0, 3, 4]))
    assert number.tolist() == [0, -1, 1, 2, 3]
    assert shared_places(after, place) == 0


def test_strands_that_cross_copies_of_an_edge_at_the_same_point():
    a, b, c, d = vertex(1, 1), vertex(1, 2), vertex(3, 1), vertex(3, 2)
    place = identified((a, c), (b, d))
    first = polyline({vertex(0, 1): 1.0}, {a: 0.5, b: 0.5}, {vertex(2, 2): 1.0})
    second = polyline({vertex(2, 1): 1.0}, {c: 0.5, d: 0.5}, {vertex(4, 2): 1.0})
    points = SurfacePoints(
        np.concatenate([first.faces, second.faces]),
        np.concatenate([first.barycentric, second.barycentric]),
    )
    assert shared_places(points, place) == 1
    after, number = separated(MESH, place, points, False, np.array([0, 5]))
    assert number.tolist() == list(range(6))
    assert shared_places(after, place) == 0
    np.testing.assert_allclose(after.barycentric.sum(axis=1), 1.0, atol=1e-15)
    moved = np.linalg.norm(after.positions(MESH) - points.positions(MESH), axis=1)
    assert np.flatnonzero(moved).tolist() == [4] and moved.max() < 0.1 / SIZE


def test_a_strand_along_a_copy_of_an_edge_that_another_crosses():
    a, b, c, d = vertex(1, 1), vertex(1, 2), vertex(3, 1), vertex(3, 2)
    place = identified((a, c), (b, d))
    crossing = polyline({vertex(0, 1): 1.0}, {a: 0.5, b: 0.5}, {vertex(2, 2): 1.0})
    running = along(c, d)
    points = SurfacePoints(
        np.concatenate([crossing.faces, running.faces]),
        np.concatenate([crossing.barycentric, running.barycentric]),
    )
    after, number = separated(MESH, place, points, False, np.array([0, 3, 4]))
    assert number.tolist() == [0, 1, 2, 3, 5]
    assert (after.barycentric[4] > 0.0).all()


def test_what_does_not_touch_stays_as_it_is():
    before = along(*STRAIGHT)
    after, number = separated(MESH, identified(), before, False, np.array([0]))
    assert after is before
    np.testing.assert_array_equal(number, np.arange(len(before)))
