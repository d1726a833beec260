"""Tests that courses are simple and pass their control points, and which of them is the best."""

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.courses import course_search, course_surface
from nicmm_core.courses.comparison import farthest_between
from nicmm_core.courses.course_search import find_courses, random_waves
from nicmm_core.courses.course_set import CourseSet, energies_of_courses, with_nodes
from nicmm_core.courses.hop_graph import build_hop_graph, distances_along_edges
from nicmm_core.courses.leg_combinations import (
    CROSSING,
    cheapest_combinations,
    crossing_legs,
    curves_on_routes,
    junctions_of_routes,
)
from nicmm_core.geometry.refinement import refined
from nicmm_core.relaxation.curve_nodes import curve_surface, nodes_at
from nicmm_core.relaxation.elastic_energy import bending_energy, comparable_energies
from tests.core.checks import assert_valid_design, points_near, random_surface_points
from tests.core.courses.test_hop_graph import LEGS, graph_through, routes_through


@pytest.fixture(scope="module")
def body():
    return shapes.creature(5, resolution=32, faces=1500, subdivisions=1)


def test_combinations_that_cross_cost_more(body):
    graph = graph_through(body, body.vertices[[5, 100, 700]])
    routes = routes_through(graph, LEGS, closed=True)
    curves = curves_on_routes(graph, routes, len(LEGS), 1.0)
    crosses = crossing_legs(curves)
    assert crosses.any() and not crosses.all()
    costs, junctions = [leg.cost for leg in routes], junctions_of_routes(graph, routes, True)

    def crossings(found):
        one, other = np.triu_indices(3)
        return crosses[found.choice[:, one], found.choice[:, other]].sum(axis=1)

    found = cheapest_combinations(costs, junctions, crosses, closed=True)
    assert (np.diff(found.cost) >= 0.0).all()
    free = cheapest_combinations(costs, junctions, np.zeros_like(crosses), closed=True)
    price = CROSSING * sum(leg.cost.min() for leg in routes)
    without = {
        tuple(choice): cost for choice, cost in zip(free.choice.tolist(), free.cost, strict=True)
    }
    for choice, cost, number in zip(
        found.choice.tolist(), found.cost, crossings(found), strict=True
    ):
        if tuple(choice) in without:
            assert cost == pytest.approx(without[tuple(choice)] + number * price)
    assert crossings(found).sum() < crossings(free).sum()


def test_only_the_cheapest_combinations_of_the_same_kinds_are_kept(body):
    """Of each choice of kinds, for one first and one last curve; the others cost no less."""
    graph = graph_through(body, body.vertices[[5, 100, 700]])
    routes = routes_through(graph, LEGS, closed=True)
    costs, junctions = [leg.cost for leg in routes], junctions_of_routes(graph, routes, True)
    offset = np.cumsum([0] + [len(cost) for cost in costs])
    kinds = [leg.alike.argmax(axis=1) for leg in routes]
    crosses = np.zeros((offset[-1], offset[-1]), dtype=bool)
    every = cheapest_combinations(costs, junctions, crosses, closed=True)
    found = cheapest_combinations(costs, junctions, crosses, closed=True, kinds=kinds)

    def kinds_of(combinations):
        own = combinations.choice - offset[:-1]
        middle = kinds[1][own[:, 1]]
        return [tuple(each) for each in np.stack([own[:, 0], middle, own[:, 2]], axis=1).tolist()]

    assert len(set(kinds_of(found))) == len(found.choice)
    assert len(set(kinds_of(every))) < len(every.choice)
    assert found.cost[0] == every.cost[0]
    least = dict(zip(kinds_of(found), found.cost, strict=True))
    for kind, cost in zip(kinds_of(every), every.cost, strict=True):
        assert least.get(kind, found.cost[-1]) <= cost


@pytest.mark.slow
@pytest.mark.parametrize("closed", [True, False])
def test_courses_pass_their_points(body, closed):
    """In the given order, or in the order of the indices at the nodes."""
    surface = curve_surface(body)
    points = random_surface_points(body, 4, seed=3)
    graph, fixed = build_hop_graph(surface), np.ones(4, dtype=bool)
    for any_order in (False, True):
        along = distances_along_edges(surface, points)
        found = list(
            find_courses(graph, surface, points, along, fixed, ~fixed, closed, 1.0, any_order)
        )
        assert found
        for nodes, visit, _ in found:
            order = visit[visit >= 0]
            passed = nodes.positions[visit >= 0]
            there = points.positions(body)[order]
            np.testing.assert_allclose(passed, there, atol=1e-9 * body.diagonal)
            assert order[0] == 0 or not closed
            if not any_order:
                np.testing.assert_array_equal(order, np.arange(4))


@pytest.mark.slow
@pytest.mark.parametrize("closed", [True, False])
def test_many_legs_with_via_points(body, closed):
    """Courses of more than eight legs have more nodes; via points are no control points."""
    chosen = [20, 250, 600, 900, 1100, 1300]
    via = {0: [100, 150], 2: [700], 3: [1000]}
    design = nicmm.design_curve(body, chosen, closed=closed, via_points=via)
    assert_valid_design(body, design, body.vertices[chosen], closed)


def test_the_best_course_round_a_ball_is_a_great_circle():
    ball = shapes.sphere(4)
    surface = curve_surface(ball)
    angle = np.array([0.3, 2.2, 4.6])
    on_circle = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(3)])
    points = points_near(ball, on_circle)
    graph = build_hop_graph(surface)
    along, fixed = distances_along_edges(surface, points), np.ones(3, bool)
    nodes, *_ = next(find_courses(graph, surface, points, along, fixed, ~fixed, True, 1.0, False))
    assert np.abs(nodes.positions[:, 2]).max() < 0.02
    energy = comparable_energies(surface, nodes, 1.0, 2.0 * np.pi)
    assert energy[0] == pytest.approx(4.0 * np.pi**2, rel=0.01)


def winding_of_a_thin_torus(windings, count):
    """A curve that winds around the tube of a thin torus."""
    minor = 0.06
    ring = shapes.torus(1.0, minor, 240, 24)
    surface = curve_surface(ring)
    angle = 2.0 * np.pi * np.arange(count) / count
    away, height = 1.0 + minor * np.cos(windings * angle), minor * np.sin(windings * angle)
    wound = np.column_stack([away * np.cos(angle), away * np.sin(angle), height])
    return surface, nodes_at(surface, points_near(ring, wound), closed=True)


@pytest.mark.parametrize(("windings", "doubled"), [(4, False), (24, True)])
def test_nodes_are_doubled_until_energies_are_true(windings, doubled):
    """Four nodes a winding are too few: lines between them pass through the tube."""
    count = 96
    surface, nodes = winding_of_a_thin_torus(windings, count)
    visit = np.full(count, -1)
    visit[0] = 0

    def growth(courses):
        """Of the energy, with twice as many nodes along the traces."""
        both = courses, with_nodes(surface, courses, 2)
        before, after = (energies_of_courses(surface, each.nodes, 1.0) for each in both)
        return after[0] / before[0]

    courses = CourseSet(nodes, visit, np.ones(1, dtype=bool))
    assert (growth(courses) > course_search.UNDER_RESOLVED) == doubled
    found = course_search._resolved(surface, courses, 1.0, 1)
    assert (found.doublings > 0) == doubled
    assert found.nodes.per_curve == count * 2**found.doublings
    assert growth(found) < course_search.UNDER_RESOLVED


@pytest.mark.slow
def test_courses_bend_less_than_the_initial_path(monkeypatch):
    """In the geometric mean over some bodies; on single bodies they may bend more."""

    def total(seed):
        mesh = shapes.creature(seed, resolution=32, faces=1500)
        chosen = np.random.default_rng(seed).choice(len(mesh.vertices), 4, replace=False)
        design = nicmm.design_curve(mesh, chosen, order="shortest")
        assert_valid_design(mesh, design)
        curve = design.resumable.curve
        return curve.length * bending_energy(curve.nodes) + 4.0 * np.pi**2

    searched = [total(seed) for seed in range(4)]
    monkeypatch.setattr(course_surface, "find_courses", lambda *arguments, **named: iter(()))
    by_path = [total(seed) for seed in range(4)]
    assert np.mean(np.log(np.divide(searched, by_path))) < np.log(0.9)


@pytest.mark.parametrize("times", [0, 1, 2])
def test_a_refined_mesh_is_the_same_surface(body, times):
    divided = refined(body, times)
    assert len(divided.mesh.faces) == 4**times * len(body.faces)
    parents = np.bincount(divided.parent, divided.mesh.face_areas)
    np.testing.assert_allclose(parents, body.face_areas, rtol=1e-9)
    points = random_surface_points(body, 60, seed=1)
    there = divided.in_parts(points)
    np.testing.assert_allclose(
        there.positions(divided.mesh), points.positions(body), atol=1e-12 * body.diagonal
    )
    back = divided.in_parents(there)
    np.testing.assert_array_equal(back.faces, points.faces)
    np.testing.assert_allclose(back.barycentric, points.barycentric, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("closed", [True, False])
def test_alternatives_are_whole_curves_that_differ(body, closed):
    chosen = [20, 250, 600]
    plain = nicmm.design_curve(body, chosen, closed=closed)
    assert plain.alternatives == []
    design = nicmm.design_curve(body, chosen, closed=closed, alternatives=2)
    assert closed <= len(design.alternatives) <= 2
    every = [design, *design.alternatives, plain]
    scale = min(one.resumable.curve.length for one in every)
    energies = []
    for one in every:
        assert_valid_design(body, one, body.vertices[chosen], closed)
        nodes = one.resumable.curve.nodes
        energies += comparable_energies(curve_surface(body), nodes, 1.0, scale).tolist()
    assert energies[:-1] == sorted(energies[:-1]) and energies[0] <= energies[-1]
    for number, one in enumerate(every[:-1]):
        for other in every[:number]:
            away = farthest_between(one.curves[0].points, other.curves[0].points)
            assert away > 0.01 * body.diagonal


def test_alternatives_that_cannot_be_given(body):
    for wrong in (-1, 1.5, True, "two"):
        with pytest.raises(nicmm.ArgumentError, match="alternatives"):
            nicmm.design_curve(body, [20, 250, 600], alternatives=wrong)
    with pytest.raises(nicmm.ArgumentError, match="alternatives"):
        nicmm.design_curve(body, [20, 250, 600], alternatives=1, method="variational")
    with pytest.raises(nicmm.ArgumentError, match="alternatives"):
        nicmm.Designer(body).design([20, 250, 600], alternatives=1, max_iterations=3)


def test_random_waves_depend_on_distances_alone():
    """They have zero mean and unit deviation, the symmetry of the points, and differ by seed."""
    distances = np.random.default_rng(0).uniform(0.0, 50.0, (4, 2000))
    waves = random_waves(distances, 1.0, seed=1)
    assert abs(waves.mean()) < 0.1
    assert waves.std() == pytest.approx(1.0, abs=0.1)
    np.testing.assert_allclose(random_waves(distances[[2, 0, 3, 1]], 1.0, seed=1), waves)
    np.testing.assert_allclose(random_waves(7.0 * distances, 7.0, seed=1), waves)
    other = random_waves(distances, 1.0, seed=2)
    assert abs(np.corrcoef(waves, other)[0, 1]) < 0.1
