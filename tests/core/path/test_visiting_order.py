"""Tests the shortest order: optimal for few points, at least as good as greedy for many."""

from itertools import permutations

import numpy as np
import pytest

from nicmm_core.path.visiting_order import (
    EXACT_UP_TO,
    order_along_boundaries,
    shortest_order,
)


def distances(points):
    return np.linalg.norm(points[:, None] - points[None], axis=2)


def length(distance, tour, closed=True):
    following = np.roll(tour, -1) if closed else tour[1:]
    return distance[tour if closed else tour[:-1], following].sum()


def nearest_neighbour_tour(distance):
    tour = [0]
    while len(tour) < len(distance):
        rest = [i for i in range(len(distance)) if i not in tour]
        tour.append(min(rest, key=lambda i: distance[tour[-1], i]))
    return np.array(tour)


@pytest.mark.parametrize("count", [3, 4, 5, 6, 7])
@pytest.mark.parametrize("seed", range(4))
def test_few_points_get_the_optimal_closed_tour(count, seed):
    distance = distances(np.random.default_rng(seed).normal(size=(count, 3)))
    tour = shortest_order(distance, closed=True)
    assert tour[0] == distance.sum(axis=1).argmax()
    assert sorted(tour.tolist()) == list(range(count))
    best = min(length(distance, np.array([0, *p])) for p in permutations(range(1, count)))
    assert length(distance, tour) == pytest.approx(best, rel=1e-12)


@pytest.mark.parametrize("count", [2, 3, 5, 6])
@pytest.mark.parametrize("seed", range(4))
def test_few_points_get_the_optimal_open_tour(count, seed):
    distance = distances(np.random.default_rng(seed).normal(size=(count, 3)))
    tour = shortest_order(distance, closed=False)
    assert sorted(tour.tolist()) == list(range(count))
    best = min(length(distance, np.array(p), closed=False) for p in permutations(range(count)))
    assert length(distance, tour, closed=False) == pytest.approx(best, rel=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_many_points_get_a_tour_that_no_reversal_shortens(seed):
    """The tour is at most as long as the nearest-neighbour tour, too."""
    count = EXACT_UP_TO + 11
    distance = distances(np.random.default_rng(seed).normal(size=(count, 3)))
    tour = shortest_order(distance, closed=True)
    assert tour[0] == distance.sum(axis=1).argmax()
    assert sorted(tour.tolist()) == list(range(count))
    found = length(distance, tour)
    assert found <= length(distance, nearest_neighbour_tour(distance))
    for start in range(count):
        for end in range(start + 2, count + 1):
            reversed_part = tour.copy()
            reversed_part[start:end] = tour[start:end][::-1]
            assert length(distance, reversed_part) > found - 1e-9


@pytest.mark.parametrize("count", [EXACT_UP_TO, EXACT_UP_TO + 1, 24])
def test_points_of_a_circle_are_visited_round_it(count):
    """For points in convex position, only the tour along the polygon has no crossing."""
    angle = np.random.default_rng(count).permutation(count) * 2 * np.pi / count
    tour = shortest_order(distances(np.stack([np.cos(angle), np.sin(angle)], 1)), closed=True)
    steps = np.diff(np.unwrap(angle[np.append(tour, tour[0])]))
    assert len(set(np.sign(steps))) == 1
    np.testing.assert_allclose(np.abs(steps), 2 * np.pi / count)


def test_points_of_a_line_are_visited_along_it():
    place = np.random.default_rng(0).permutation(7).astype(float)
    tour = shortest_order(distances(place[:, None]), closed=False)
    np.testing.assert_allclose(np.abs(np.diff(place[tour])), 1.0)


@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize("count", [3, 4, 6, EXACT_UP_TO + 4])
def test_numbers_of_the_points_make_no_difference(count, closed):
    generator = np.random.default_rng(count)
    distance = distances(generator.normal(size=(count, 3)))
    tour = shortest_order(distance, closed)
    for _ in range(5):
        other = generator.permutation(count)
        found = shortest_order(distance[np.ix_(other, other)], closed)
        np.testing.assert_array_equal(other[found], tour)


def test_equal_distances_end():
    """With ties, 2-opt must terminate."""
    distance = 1.0 - np.eye(EXACT_UP_TO + 3)
    assert sorted(shortest_order(distance, closed=True).tolist()) == list(range(len(distance)))


class TestAlongBoundaries:
    """Points on one boundary loop are visited in the direction of the loop."""

    @pytest.mark.parametrize("closed", [True, False])
    @pytest.mark.parametrize("seed", range(4))
    def test_loops_stay_whole(self, seed, closed):
        generator = np.random.default_rng(seed)
        distance = distances(generator.random((11, 2)))
        loops = [np.array([4, 1, 7]), np.array([2]), np.array([0, 9, 3, 5]), np.array([], int)]
        tour = order_along_boundaries(distance, loops, closed)
        assert sorted(tour.tolist()) == list(range(11))
        for loop in loops:
            # In the direction of the loop, starting at any of its points.
            met = [point for point in tour.tolist() if point in loop]
            start = met.index(loop[0]) if len(loop) else 0
            assert met[start:] + met[:start] == loop.tolist()

    def test_an_open_tour_leaves_out_the_longest_leg(self):
        distance = distances(np.array([[0.0, 0], [1, 0], [2, 0], [9, 0]]))
        tour = order_along_boundaries(distance, [np.array([0, 1, 2, 3])], False)
        assert tour.tolist() == [0, 1, 2, 3]

    def test_inner_points_are_put_where_they_cost_least(self):
        corners = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.1]])
        tour = order_along_boundaries(distances(corners), [np.array([0, 1, 2, 3])], True)
        assert tour.tolist() == [0, 4, 1, 2, 3]
