"""Tests that further attempts at a curve never make it worse."""

from dataclasses import replace

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import improvement, shapes, start_search
from nicmm_core.coarsening.retriangulated import retriangulated
from nicmm_core.geometry.curve import resample
from nicmm_core.geometry.surface_points import nearest_points, snapped
from nicmm_core.relaxation.curve_energies import energies_of
from nicmm_core.relaxation.curve_nodes import curve_surface
from nicmm_core.surface_designer import SurfaceDesigner
from tests.core.checks import random_surface_points
from tests.oracles.energies import named_requests

REQUESTS = {request.name: request for request in named_requests()}
BENT = [name for name in REQUESTS if name.startswith("creature") and "closed" in name]


@pytest.mark.slow
@pytest.mark.parametrize("name", BENT)
def test_more_attempts_do_not_raise_the_energy(monkeypatch, name):
    """On the Delaunay triangulation, where attempts are compared, by the length of the first."""
    asked = REQUESTS[name]
    on_copy = nicmm.Designer(asked.mesh).design(asked.points, **asked.options, max_iterations=1)
    delaunay = retriangulated(on_copy.resumable.mesh)
    request = delaunay.request_to(on_copy.resumable.request)
    designer = SurfaceDesigner(delaunay.mesh)
    every = designer.design(request, 0.0).resumable
    monkeypatch.setattr(improvement, "MOST_WORK", 0)
    first = designer.design(request, 0.0).resumable
    surface = curve_surface(delaunay.mesh)
    one, all_of_them = energies_of(surface, [first.curve, every.curve], 1.0, first.curve.length)
    assert all_of_them <= one * (1.0 + 1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", BENT[::4])
def test_more_attempts_hardly_raise_the_energy_on_the_given_triangles(monkeypatch, name):
    """The last relaxation may change the order of curves that are almost equally fair."""
    asked = REQUESTS[name]
    designer = nicmm.Designer(asked.mesh)
    every = designer.design(asked.points, **asked.options).resumable
    monkeypatch.setattr(improvement, "MOST_WORK", 0)
    first = designer.design(asked.points, **asked.options).resumable
    surface = curve_surface(first.mesh)
    one, all_of_them = energies_of(surface, [first.curve, every.curve], 1.0, first.curve.length)
    assert all_of_them <= one * (1.0 + 1e-4)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "vertices", "count"),
    [(0, [100, 357, 918, 1403, 479], 14), (1, [40, 500, 900, 1300], 12), (2, [7, 300, 800], 18)],
)
def test_a_curve_through_many_points_of_a_fair_curve_is_as_fair(seed, vertices, count):
    """On the first body the spline and the search agree on a leg on the wrong side of a limb."""
    body = shapes.creature(seed, resolution=32, faces=200)
    designer = nicmm.Designer(body)
    curve = designer.design(vertices, order="shortest").curves[0]
    n = len(curve.faces)
    places = np.linspace(0, n, count, endpoint=False)
    places += np.random.default_rng([23, 40, count]).uniform(-0.25, 0.25, count) * n / count
    at = np.unique(places.round().clip(0, n - 1).astype(int))
    points = nicmm.SurfacePoints(curve.faces[at], curve.barycentric[at])
    given = replace(curve, control_index=at)
    found, kept = (designer.design(points, start=start).resumable for start in (None, given))
    surface = curve_surface(found.mesh)
    new, old = energies_of(surface, [found.curve, kept.curve], 1.0, kept.curve.length)
    assert new <= 1.02 * old


@pytest.mark.slow
def test_the_order_of_two_curves_does_not_depend_on_a_third(ball):
    """Although the third is shorter than both."""
    points = [[3, 200, 400], [10, 300, 500, 610], [7, 8, 9]]
    designer = nicmm.Designer(ball)
    curves = [designer.design(each).resumable for each in points]
    surface = curve_surface(curves[0].mesh)

    class Result:
        def __init__(self, curve):
            self.discrete_curve = curve

    results = [Result(each.curve) for each in curves]
    start = start_search.InitialCurve(curves[0].curve, np.arange(3), surface, 1.0)

    def energies(count):
        search, request = start_search.StartSearch(ball), curves[0].request
        return improvement.Improvement(
            search, request, None, 0, [], [start] * count, results[:count]
        ).energies

    assert energies(3)[:2] == energies(2)


@pytest.mark.slow
@pytest.mark.parametrize("smoothness", [1.0, 0.5])
def test_alternatives_tell_their_energy_relative_to_the_fairest_curve(ball, smoothness):
    design = nicmm.design_curve(ball, [3, 200, 400, 611], alternatives=4, smoothness=smoothness)
    designs = [design, *design.alternatives]
    assert len(designs) > 2
    found = [each.resumable.curve for each in designs]
    energies = np.array(energies_of(curve_surface(design.resumable.mesh), found, smoothness))
    relative = [each.relative_energy for each in designs]
    assert relative[0] == 1.0 and relative == sorted(relative)
    # Energies depend on a length scale, here the least length and there that of the first attempt.
    np.testing.assert_allclose(relative, energies / energies[0], rtol=0.2)


@pytest.mark.slow
def test_relative_energies_are_at_least_one_with_maps(ball):
    lane = np.exp(-((ball.vertices[:, 2] / 0.1) ** 2))
    design = nicmm.design_curve(ball, [3, 200, 400, 611], alternatives=4, alignment=lane)
    relative = [each.relative_energy for each in (design, *design.alternatives)]
    assert len(relative) > 1 and relative[0] == 1.0 and relative == sorted(relative)


@pytest.mark.slow
@pytest.mark.parametrize("count", [8, 16])
@pytest.mark.parametrize("closed", [False, True])
def test_many_points_of_a_fair_curve_have_a_curve_as_fair(surface, closed, count):
    """The curve from which they are taken passes through them."""
    points = random_surface_points(surface, 4, 3)
    designer = nicmm.Designer(surface)
    known = designer.design(points, closed=closed, order="shortest")
    places, _ = resample(known.curves[0].points, count, closed)
    controls, _ = nearest_points(surface, places)
    found = designer.design(snapped(controls), closed=closed)
    assert found.energy["smooth"] <= 1.03 * known.energy["smooth"]


@pytest.mark.slow
def test_the_spline_through_many_points_is_tried(ball, monkeypatch):
    tried = []
    by_spline = start_search.StartSearch.by_spline

    def spy(search, request, visited):
        tried.append(len(visited))
        return by_spline(search, request, visited)

    monkeypatch.setattr(start_search.StartSearch, "by_spline", spy)
    for count in (4, start_search.FEWEST_FOR_SPLINE):
        nicmm.design_curve(ball, random_surface_points(ball, count, 1), order="shortest")
    assert tried == [start_search.FEWEST_FOR_SPLINE]


@pytest.mark.parametrize("weight", [0.0, 1.0])
def test_a_curve_that_bends_like_a_circle_is_searched_for_again(flat_disc, monkeypatch, weight):
    """Although curves with normal bending may bend more along the surface."""
    seeds = []
    courses = start_search.StartSearch.courses

    def spy(self, request, search, **named):
        seeds.append(search.seed)  # when the first course is asked for
        yield from courses(self, request, search, **named)

    monkeypatch.setattr(start_search.StartSearch, "courses", spy)
    square = [[0.5, 0.0, 0.0], [0.0, 0.5, 0.0], [-0.5, 0.0, 0.0], [0.0, -0.5, 0.0]]
    nicmm.design_curve(flat_disc, square, normal_bending=weight)
    assert seeds[:2] == [0, 1]


@pytest.mark.parametrize("differs", [True, False])
def test_a_design_ends_when_a_rival_is_beaten_by_another_curve(monkeypatch, differs):
    """Otherwise it is the same as without a rival."""
    attempts = []
    attempt = improvement.Improvement.attempt
    monkeypatch.setattr(
        improvement.Improvement,
        "attempt",
        lambda self, *given: attempts.append(given) or attempt(self, *given),
    )
    asked = REQUESTS[BENT[0]]
    there = nicmm.Designer(asked.mesh).design(asked.points, **asked.options).resumable
    designer, request = SurfaceDesigner(there.mesh), there.request
    attempts.clear()
    whole = designer.design(request, 0.0)
    number = len(attempts)
    attempts.clear()
    worse = designer.design(request, 0.0, max_iterations=0).resumable
    rival = improvement.Rival(worse.curve, lambda points: differs)
    found = designer.design(request, 0.0, rival=rival)
    assert number > 0
    assert len(attempts) == (0 if differs else number)
    if not differs:
        np.testing.assert_array_equal(found.curves[0].points, whole.curves[0].points)
