import itertools

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import improvement, shapes, start_search
from nicmm_core.courses import attempts
from nicmm_core.courses.bent_part import (
    APART,
    DIRECTION,
    HALF_LENGTH,
    bent_part,
    request_for_part,
    with_part,
)
from nicmm_core.relaxation.curve_energies import scaled_bending
from nicmm_core.relaxation.curve_nodes import curve_surface
from nicmm_core.relaxation.discrete_curve import is_simple, noded
from nicmm_core.relaxation.simple_curve import simple_curve
from tests.core.checks import points_near

COUNT = 100


@pytest.fixture(scope="module")
def surface():
    return curve_surface(shapes.sphere(4))


def wavy_curve(surface, closed, shift=0):
    """A loop around a pole, or most of it, with four control points and a sharp bend.

    The bend is at node 60 of a closed curve, and near the end of an open one.
    """
    angle = 2.0 * np.pi * np.arange(COUNT) / COUNT * (1.0 if closed else 0.9)
    bend = np.exp(-(((np.arange(COUNT) - (60.3 if closed else 91.3)) / 2.0) ** 2))
    latitude = 0.4 + 0.02 * np.sin(3.0 * angle) + 0.15 * bend
    points = np.column_stack(
        [np.cos(latitude) * np.cos(angle), np.cos(latitude) * np.sin(angle), np.sin(latitude)]
    )
    controls = np.array([0, 30, 55, 80 if closed else COUNT - 1])
    points = np.roll(points, -shift, axis=0)
    controls = np.sort((controls - shift) % COUNT)
    places = points_near(surface.mesh, points)
    curve = simple_curve(surface, places, controls, places[controls], closed)
    assert curve is not None and len(curve.nodes.positions) == COUNT
    return curve


def own_course(surface, curve, part):
    """The part of the curve itself, as a course through the nodes that the part must pass."""
    nodes = np.arange(part.passed[0], part.passed[0] + 1 + np.ptp(unwrapped(part.passed)))
    places = curve.nodes.places[nodes % COUNT]
    at = unwrapped(part.passed) - part.passed[0]
    return simple_curve(surface, places, at, places[at], closed=False)


def unwrapped(passed):
    """Ascending indices of nodes, beyond the number of nodes where the part passes node 0."""
    return passed + COUNT * np.append(0, np.cumsum(np.diff(passed) < 0))


@pytest.mark.parametrize("shift", [0, 30, 55])
def test_the_part_around_the_sharpest_bend(surface, shift):
    curve = wavy_curve(surface, True, shift)
    part = bent_part(curve, [])
    bend = (60 - shift) % COUNT
    assert np.linalg.norm(part.middle - curve.nodes.positions[bend]) < 0.05 * curve.length
    assert part.length == pytest.approx(2.0 * (HALF_LENGTH + DIRECTION) * curve.length, rel=0.2)
    inside = part.passed[part.first + 1 : part.last]
    assert (55 - shift) % COUNT in inside and (30 - shift) % COUNT not in inside


def test_another_part_is_apart_from_those_tried(surface):
    curve = wavy_curve(surface, True)
    first = bent_part(curve, [])
    second = bent_part(curve, [first.middle])
    away = np.linalg.norm(first.middle - second.middle)
    assert away >= APART * curve.length
    everywhere = list(curve.nodes.positions)
    assert bent_part(curve, everywhere) is None


@pytest.mark.parametrize(("closed", "shift"), [(True, 0), (True, 55), (False, 0)])
def test_a_part_replaced_by_itself_changes_nothing(surface, closed, shift):
    """Also where it contains the first node of the curve, or an end of an open curve."""
    curve, tried = wavy_curve(surface, closed, shift), []
    wrapped = clipped = False
    while (part := bent_part(curve, tried)) is not None:
        tried.append(part.middle)
        wrapped |= bool((np.diff(part.passed) < 0).any())
        clipped |= part.first == 0 or part.last == len(part.passed) - 1
        same = with_part(surface, curve, part, own_course(surface, curve, part))
        np.testing.assert_array_equal(same.control_nodes, curve.control_nodes)
        np.testing.assert_allclose(same.nodes.positions, curve.nodes.positions, atol=1e-6)
    assert tried and clipped == (not closed)
    assert wrapped == (shift == 55)


def test_the_tension_is_that_of_the_whole_curve(surface):
    curve = wavy_curve(surface, True)
    part = bent_part(curve, [])
    design = nicmm.design_curve(surface.mesh, [12, 80, 41], smoothness=2.0)
    request = request_for_part(design.resumable.request, curve, part)
    whole = 4.0 * np.pi**2 / (2.0 * curve.length**2)
    assert 4.0 * np.pi**2 / (request.smoothness * part.length**2) == pytest.approx(whole)
    assert not request.closed and len(request.points) == len(part.passed)


def test_the_result_never_crosses_itself(surface):
    """A course once round the pole meets the rest of the curve."""
    curve = wavy_curve(surface, True)
    part = bent_part(curve, [])
    passed = unwrapped(part.passed)
    there = curve.nodes.positions[part.passed]
    turned = np.linspace(0.0, 2.0 * np.pi, COUNT)[1:-1, None]
    x, y = 0.75 * np.cos(turned + np.pi), 0.75 * np.sin(turned + np.pi)
    ring = np.column_stack([x, y, np.sqrt(1.0 - x**2 - y**2)])
    before, after = part.first + 1, len(passed) - part.first - 1
    points = np.concatenate([there[:before], ring, there[before:]])
    controls = np.concatenate([np.arange(before), COUNT - 2 + before + np.arange(after)])
    course = noded(surface, points_near(surface.mesh, points), controls, False)
    found = with_part(surface, curve, part, course)
    assert found is None or is_simple(surface, found)


@pytest.mark.parametrize("closed", [True, False])
def test_another_course_of_the_sharpest_bend_bends_less(surface, closed):
    search = start_search.StartSearch(surface.mesh)
    curve = wavy_curve(surface, closed)
    controls = curve.nodes.places[curve.control_nodes]
    design = nicmm.design_curve(surface.mesh, controls, closed=closed)
    request = design.resumable.request
    start = start_search.InitialCurve(curve, np.arange(4), surface, 1.0)
    part = bent_part(curve, [])
    changed = next(search.with_other_part(request, start, curve, part))
    assert scaled_bending(changed.curve) < 0.5 * scaled_bending(curve)
    np.testing.assert_array_equal(changed.visited, np.arange(4))
    found = changed.curve.nodes.places[changed.curve.control_nodes]
    np.testing.assert_allclose(found.positions(surface.mesh), controls.positions(surface.mesh))


def test_searches_for_parts_are_bounded(monkeypatch):
    parts = []
    select = improvement.bent_part

    def counted(curve, tried):
        parts.append(len(tried))
        return select(curve, tried)

    monkeypatch.setattr(improvement, "bent_part", counted)
    monkeypatch.setattr(improvement, "FURTHER_SEEDS", ())
    monkeypatch.setattr(attempts, "STRONGLY_BENT", 0.0)
    monkeypatch.setattr(attempts, "MOST_WORK", 1e9)
    monkeypatch.setattr(attempts, "LEAST_GAIN", 1.0)
    body, chosen = shapes.creature(5, resolution=32, faces=1500, subdivisions=1), [20, 250, 600]
    nicmm.design_curve(body, chosen)
    assert parts == list(range(attempts.FRUITLESS_PARTS))
    parts.clear()
    monkeypatch.setattr(attempts, "FRUITLESS_PARTS", 100)
    nicmm.design_curve(body, chosen)
    assert len(parts) <= attempts.SEARCHES_FOR_PARTS
    assert all(b == a + 1 for a, b in itertools.pairwise(parts))
    parts.clear()
    monkeypatch.setattr(attempts, "MOST_WORK", 0)
    nicmm.design_curve(body, chosen)
    assert not parts
