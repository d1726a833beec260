"""Tests the triangulation of one face along random segments."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nicmm_core.outputs.triangulation import ConstraintError, FaceTriangulation, orientation

CORNERS = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
EQUILATERAL = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, 0.75**0.5]])


def triangulation_of(weights):
    return FaceTriangulation(weights, np.array(weights) @ EQUILATERAL)


def area(weights, triangle):
    return float(np.linalg.det(np.array([weights[corner] for corner in triangle])))


def assert_fills_the_face(weights, triangles):
    areas = [area(weights, triangle) for triangle in triangles]
    assert all(orientation(*(weights[k] for k in triangle)) == 1 for triangle in triangles)
    assert sum(areas) == pytest.approx(1.0, abs=1e-12)
    assert {corner for triangle in triangles for corner in triangle} == set(range(len(weights)))


def edges_of(triangles):
    return {frozenset(pair) for a, b, c in triangles for pair in ((a, b), (b, c), (c, a))}


def test_orientation_is_exact():
    assert orientation(*CORNERS) == 1
    assert orientation(CORNERS[1], CORNERS[0], CORNERS[2]) == -1
    one, other = (0.3, 0.7, 0.0), (1.0 / 3.0, 2.0 / 3.0, 0.0)
    assert orientation(CORNERS[0], one, other) == 0
    just_beside = (0.3, 0.7, 1e-300)
    assert orientation(CORNERS[0], CORNERS[1], just_beside) == 1


@pytest.mark.slow
@settings(max_examples=150)
@given(
    seed=st.integers(0, 10**6),
    counts=st.tuples(*[st.integers(0, 4)] * 3),
    inner=st.integers(0, 8),
    on_a_line=st.booleans(),
)
def test_random_points_and_segments(seed, counts, inner, on_a_line):
    generator = np.random.default_rng(seed)
    weights, sides = list(CORNERS), []
    for corner, count in enumerate(counts):
        shares = np.sort(generator.random(count))
        sides.append([len(weights) + k for k in range(count)])
        for share in shares.tolist():
            point = [0.0, 0.0, 0.0]
            point[corner], point[(corner + 1) % 3] = 1.0 - share, share
            weights.append(tuple(point))
    insides = generator.dirichlet([1.0] * 3, size=inner)
    if on_a_line and inner > 1:
        share = np.sort(generator.random(inner))[:, None]
        insides = (1.0 - share) * insides[0] + share * insides[-1]
    first_inner = len(weights)
    weights += [tuple(point) for point in insides.tolist()]

    triangulation = triangulation_of(weights)
    for corner, points in enumerate(sides):
        triangulation.add_on_side(corner, points)
    for point in range(first_inner, len(weights)):
        triangulation.add_inside(point)
    asked, kept = [], []
    for _ in range(6):
        start, end = generator.choice(len(weights), 2, replace=False).tolist()
        asked.append((start, end))
        try:
            triangulation.add_segment(start, end)
        except ConstraintError as error:
            assert {start, end} <= set(error.points)
            assert any(
                meets(weights, (start, end), other) for other in kept
            ) or leads_through_a_point(weights, start, end)
        else:
            kept.append((start, end))
    triangulation.improve()

    assert_fills_the_face(weights, triangulation.triangles)
    assert {frozenset(pair) for pair in kept} <= edges_of(triangulation.triangles)


def meets(weights, one, other):
    a, b, c, d = (weights[point] for point in (*one, *other))
    return (
        orientation(a, b, c) * orientation(a, b, d) <= 0
        and orientation(c, d, a) * orientation(c, d, b) <= 0
    )


def leads_through_a_point(weights, start, end):
    others = [w for k, w in enumerate(weights) if k not in (start, end)]
    return any(orientation(weights[start], weights[end], other) == 0 for other in others)


def test_without_segments_it_is_delaunay():
    generator = np.random.default_rng(5)
    weights = CORNERS + [tuple(p) for p in generator.dirichlet([1.0] * 3, size=12).tolist()]
    triangulation = triangulation_of(weights)
    for point in range(3, len(weights)):
        triangulation.add_inside(point)
    triangulation.improve()
    flat = np.array(weights) @ EQUILATERAL
    for triangle in triangulation.triangles:
        a, b, c = flat[list(triangle)]
        lifted = np.concatenate([flat - a, ((flat - a) ** 2).sum(axis=1, keepdims=True)], axis=1)
        side_b, side_c = lifted[triangle[1]], lifted[triangle[2]]
        inside = np.linalg.det(np.stack(np.broadcast_arrays(side_b, side_c, lifted), axis=1))
        assert (inside > -1e-9).all()


@pytest.mark.parametrize("seed", range(5))
def test_points_along_a_line_leave_no_sliver(seed):
    """As on a curve that runs straight inside a face."""
    generator = np.random.default_rng(seed)
    start, end = generator.dirichlet([1.0] * 3, size=2)
    share = np.linspace(0.0, 1.0, 7)[:, None]
    weights = CORNERS + [tuple(p) for p in ((1.0 - share) * start + share * end).tolist()]
    triangulation = triangulation_of(weights)
    for point in range(3, len(weights)):
        triangulation.add_inside(point)
    for point in range(4, len(weights)):
        triangulation.add_segment(point - 1, point)
    triangulation.improve()
    assert_fills_the_face(weights, triangulation.triangles)
    assert min(area(weights, triangle) for triangle in triangulation.triangles) > 1e-4


def test_points_that_coincide_and_segments_that_cross_are_refused():
    middle = (1 / 3, 1 / 3, 1 / 3)
    twice = triangulation_of([*CORNERS, middle, middle])
    twice.add_inside(3)
    with pytest.raises(ConstraintError):
        twice.add_inside(4)

    crossing = triangulation_of([*CORNERS, (0.5, 0.5, 0.0), (0.0, 0.5, 0.5)])
    crossing.add_on_side(0, [3])
    crossing.add_on_side(1, [4])
    crossing.add_segment(3, 2)
    with pytest.raises(ConstraintError) as caught:
        crossing.add_segment(0, 4)
    assert set(caught.value.points) >= {0, 4}

    through = triangulation_of([*CORNERS, (0.5, 0.25, 0.25), (0.0, 0.5, 0.5)])
    through.add_inside(3)
    through.add_on_side(1, [4])
    with pytest.raises(ConstraintError) as caught:
        through.add_segment(0, 4)
    assert 3 in caught.value.points
