"""Best paths in a graph of hops, and legs made of them, compared with brute force."""

import nicmm_kernels
import numpy as np
import pytest
from hypothesis import given as property_of
from hypothesis import strategies as st
from nicmm_kernels import KernelError

from tests.kernels.test_library import (
    arguments_legs,
    arguments_routes,
    arguments_turning,
    path_arrays,
)


def arcs_of(given):
    """All pairs of states, (p,) each, and the costs of going on from one to the other."""
    onward, leaving, arriving = (given[name] for name in ("onward", "leaving", "arriving"))
    m, d = len(onward[0]) - 1, len(leaving[0]) - 1
    before = np.arange(m + d).repeat(np.concatenate([np.diff(onward[0]), np.diff(leaving[0])]))
    after = m + d + np.arange(d).repeat(np.diff(arriving[0]))
    one, other = np.append(before, arriving[1]), np.concatenate([onward[1], leaving[1], after])
    bending = np.concatenate([onward[2], leaving[2], arriving[2]])
    return one, other, bending + given["weights"][other]


def test_paths_are_those_of_brute_force():
    given = arguments_turning(k=3)
    one, other, added = arcs_of(given)
    costs, previous, first = nicmm_kernels.turning_paths(**given)
    states = np.arange(costs.shape[1])
    m = len(given["onward"][0]) - 1
    for number in range(3):
        own = m + np.arange(*given["begins"][number : number + 2])
        expected = np.full(len(states), np.inf)
        expected[own] = given["weights"][own]
        for _ in states:
            np.minimum.at(expected, other, expected[one] + added)
        np.testing.assert_allclose(costs[number], expected)
        reached = np.isfinite(expected)
        begins = previous[number] < 0
        np.testing.assert_array_equal(np.flatnonzero(begins & reached), own)
        np.testing.assert_array_equal(first[number][begins], states[begins])
        goes_on = ~begins
        np.testing.assert_array_equal(
            first[number][goes_on], first[number][previous[number][goes_on]]
        )
        assert not begins[reached & ~np.isin(states, own)].any()


def test_of_equal_paths_the_one_through_the_state_of_lowest_index_counts():
    given = arguments_turning()
    for name in ("onward", "leaving", "arriving"):
        given[name][2][:] = 0.25
    given["weights"][:] = 0.5
    costs, previous, _ = nicmm_kernels.turning_paths(**given)
    one, other, _ = arcs_of(given)
    for number in range(2):
        for state in np.flatnonzero(previous[number] >= 0):
            before = one[other == state]
            least = costs[number][before].min()
            assert previous[number][state] == before[costs[number][before] == least].min()


def test_negative_costs_are_refused():
    given = arguments_turning()
    given["weights"][:] = -1.0
    with pytest.raises(KernelError, match="a cost is negative"):
        nicmm_kernels.turning_paths(**given)


@pytest.mark.parametrize("spread", [0.0, 3.0, 12.0])
@pytest.mark.parametrize("seed", range(8))
def test_paths_do_not_depend_on_the_order_of_states_with_similar_costs(seed, spread):
    """Costs of very different sizes, some of them equal, so that states are looked at again."""
    rng = np.random.default_rng(seed)
    given = arguments_turning(k=2)

    def costs_of(count):
        return rng.integers(0, 3, count) * 10.0 ** (spread * np.round(rng.uniform(-1, 1, count), 1))

    for name in ("onward", "leaving", "arriving"):
        given[name][2][:] = costs_of(len(given[name][2]))
    given["weights"][:] = costs_of(len(given["weights"]))
    costs, previous, first = nicmm_kernels.turning_paths(**given)
    one, other, added = arcs_of(given)
    m, d = (len(given[name][0]) - 1 for name in ("onward", "leaving"))
    for number in range(2):
        own = m + np.arange(*given["begins"][number : number + 2])
        expected = np.full(costs.shape[1], np.inf)
        expected[own] = given["weights"][own]
        for _ in range(m + 2):
            np.minimum.at(expected, other, expected[one] + added)
        np.testing.assert_array_equal(costs[number], expected)
        for state in np.flatnonzero(previous[number] >= 0):
            into = other == state
            before = one[into][expected[one[into]] + added[into] == expected[state]]
            chosen = previous[number][state]
            assert first[number][state] == first[number][chosen]
            if state >= m + d:  # an arrival
                assert chosen == before.min()
            elif (expected[before] < expected[state]).any():
                assert chosen == before[np.argmin(expected[before])]
            else:
                assert chosen in before
        at = np.flatnonzero(np.isfinite(expected))
        for _ in range(len(expected)):
            at = at[previous[number][at] >= 0]
            at = previous[number][at]
        assert not len(at), "a path has a cycle"


def leg_through(graph, leg, state):
    """The states of the best leg through a state."""
    before, after = [state], []
    while (state := graph.previous[leg[0]][state]) >= 0:
        before.insert(0, state)
    state = graph.reverse[before[-1]]
    while (state := graph.previous[leg[1]][state]) >= 0:
        after.append(graph.reverse[state])
    return [*before, *after]


def test_best_legs_are_the_cheapest_of_their_directions_and_cells():
    given = arguments_legs()
    graph, leg = given["graph"], given["leg"]
    totals, by_direction, by_cell = nicmm_kernels.best_legs(**given)
    exact = graph.costs[0] + graph.costs[1][graph.reverse] - given["weights"]
    np.testing.assert_allclose(totals, exact, rtol=1e-8)
    cheapest, at_cell = {}, {}
    for state in np.lexsort((np.arange(len(totals)), totals)).tolist():
        if np.isfinite(totals[state]):
            states = leg_through(graph, leg, state)
            cheapest.setdefault((states[0], states[-1]), state)
            at_cell.setdefault(int(graph.ends[state]), state)
    assert sorted(by_direction.tolist()) == sorted(cheapest.values())
    assert by_cell.tolist() == [at_cell[cell] for cell in sorted(at_cell)]
    assert len(cheapest) > 5


@pytest.mark.parametrize(("aligned", "different"), [(40, 40), (3, 2), (0, 5)])
def test_routes_differ_as_in_brute_force(aligned, different):
    given = {**arguments_routes(), "aligned": aligned, "different": different}
    graph, leg, via = given["graph"], given["leg"], given["via"]
    near = np.eye(10, dtype=bool)
    near[[0, 1, 2, 3], [1, 0, 3, 2]] = True
    cells = []
    for state in via.tolist():
        states = leg_through(graph, leg, state)
        cells.append([int(graph.starts[states[0]]), *graph.ends[states].tolist()])

    def alike(one, other):
        beside = near[np.ix_(cells[one], cells[other])]
        return beside.any(axis=1).all() and beside.any(axis=0).all()

    expected = []
    for number in range(len(via)):
        is_first = number < given["first_count"]
        so_far = sum(chosen < given["first_count"] for chosen in expected)
        full = so_far == aligned if is_first else len(expected) == so_far + different
        simple = len(set(cells[number])) == len(cells[number])
        same = [
            chosen
            for chosen in expected
            if alike(chosen, number)
            and (not is_first or all(cells[chosen][k] == cells[number][k] for k in (1, -2)))
        ]
        if simple and not full and not same:
            expected.append(number)
    legs, first, last, passed, pairs = nicmm_kernels.distinct_routes(**given)
    assert legs.tolist() == expected
    assert [route.tolist() for route in passed] == [cells[number] for number in expected]
    np.testing.assert_array_equal(graph.starts[first], 8 + leg[0])
    np.testing.assert_array_equal(graph.ends[last], 8 + leg[1])
    np.testing.assert_array_equal(
        pairs, [[alike(one, other) for other in expected] for one in expected]
    )


@pytest.mark.slow
@property_of(st.integers(0, 2**32 - 1))
def test_paths_with_arbitrary_states_crash_nothing(seed):
    rng = np.random.default_rng(seed)
    graph = path_arrays()
    spoilt = {
        name: np.where(rng.random(array.shape) < 0.1, rng.integers(-2, 90, array.shape), array)
        for name, array in graph._asdict().items()
        if name in ("starts", "ends", "reverse", "previous", "first") and rng.random() < 0.5
    }
    graph = graph._replace(**spoilt)
    for function, given in (
        (nicmm_kernels.best_legs, arguments_legs()),
        (nicmm_kernels.distinct_routes, arguments_routes()),
    ):
        try:
            function(**{**given, "graph": graph})
        except KernelError as error:
            assert "index is out of range" in str(error)


def test_legs_of_other_points_and_cells_are_refused():
    given = arguments_legs()
    with pytest.raises(KernelError, match=r"leg is \(0, 2\); pass two of 2"):
        nicmm_kernels.best_legs(**{**given, "leg": (0, 2)})
    with pytest.raises(KernelError, match="cells is -1"):
        nicmm_kernels.best_legs(**{**given, "graph": path_arrays()._replace(cells=-1)})
