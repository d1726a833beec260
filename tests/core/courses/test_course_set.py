"""Tests that courses of several searches are compared and combined."""

import numpy as np
import pytest

from nicmm_core.courses.comparison import SAME_COURSE
from nicmm_core.courses.course_search import combine_courses
from nicmm_core.courses.course_set import (
    CourseSet,
    distinct_courses,
    energies_of_courses,
    together,
    with_nodes,
)
from tests.core.courses.test_recombination import CONTROLS, STRICTLY_INSIDE, courses

NO_CORNERS = np.zeros(4, dtype=bool)


def found_by_two_searches(closed, finer):
    """Each search has a course with a detour in another leg; the second may have more nodes."""
    sets = []
    for leg in (0, 2):
        bulges = np.zeros((1, 4 if closed else 3))
        bulges[0, leg] = 0.3
        surface, nodes, visit = courses(closed, bulges)
        sets.append(CourseSet(nodes, visit, np.ones(1, dtype=bool)))
    if finer:
        sets[1] = with_nodes(surface, sets[1], 2)
    return surface, sets


@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize("finer", [True, False])
def test_sets_are_joined_with_the_nodes_of_the_finest(closed, finer):
    surface, sets = found_by_two_searches(closed, finer)
    joined = together(surface, sets, NO_CORNERS)
    assert joined.nodes.curves == len(joined.simple) == 2
    assert joined.nodes.per_curve == max(each.nodes.per_curve for each in sets)
    assert joined.doublings == int(finer)
    passed = joined.visit >= 0
    np.testing.assert_array_equal(joined.visit[passed], np.tile(np.arange(4), 2))
    np.testing.assert_allclose(
        joined.nodes.positions[passed][:, :2], np.tile(CONTROLS, (2, 1)), atol=STRICTLY_INSIDE
    )
    energies = energies_of_courses(surface, joined.nodes, 1.0)
    np.testing.assert_allclose(energies[0], energies[1], rtol=0.3)


@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize("finer", [True, False])
def test_the_best_legs_of_two_searches_are_combined(closed, finer):
    surface, sets = found_by_two_searches(closed, finer)
    found, visit, is_finer = next(combine_courses(sets, surface, NO_CORNERS, 1.0, False))
    assert not is_finer
    np.testing.assert_array_equal(visit[visit >= 0], np.arange(4))
    (best,) = energies_of_courses(surface, found, 1.0)
    for each in sets:
        assert best < energies_of_courses(surface, each.nodes, 1.0)[0]


def test_a_single_course_leaves_nothing_to_combine():
    surface, sets = found_by_two_searches(True, False)
    assert list(combine_courses(sets[:1], surface, NO_CORNERS, 1.0, False)) == []


def test_distinct_courses_begin_with_the_best_simple_one():
    """The first two run beside each other, and the last one counts as crossing itself."""
    surface, nodes, visit = courses(
        True, [[0.3, 0, 0, 0], [0.31, 0, 0, 0], [0, 0, 0.2, 0], [0] * 4]
    )
    every = CourseSet(nodes, visit, np.array([True, True, True, False]))
    energies = energies_of_courses(surface, nodes, 1.0)
    order = distinct_courses(surface, every, 1.0, SAME_COURSE)
    assert order[-1] == 3 and energies.argmin() == 3
    assert len(order) == 3 and order[0] == 2
    assert order[1] == energies[:2].argmin()
