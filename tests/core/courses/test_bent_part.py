import itertools

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import improvement, shapes, start_search
from nicmm_core.courses.bent_part import (
    APART,
    DIRECTION,
    HALF_LENGTH,
    bent_parts,
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


def first_part(curve):
    """The part around the sharpest bend."""
    return next(bent_parts(curve))


def middle(curve, part):
    """The node half the length of a part from both of its ends."""
    arc = np.append(0.0, np.cumsum(np.tile(curve.nodes.step_lengths, 2)))
    first, last = arc[unwrapped(part.passed)[[part.first, part.last]]]
    return int(np.abs(arc - 0.5 * (first + last)).argmin()) % COUNT


def two_legs(curve):
    """The parts that are the two legs at a control point."""
    controls = curve.control_nodes
    ends = {
        (int(before), int(after))
        for before, after in zip(np.roll(controls, 1), np.roll(controls, -1), strict=True)
    }
    return [
        part
        for part in bent_parts(curve)
        if (int(part.passed[part.first]), int(part.passed[part.last])) in ends
    ]


@pytest.mark.parametrize("shift", [0, 30, 55])
def test_the_part_around_the_sharpest_bend(surface, shift):
    curve = wavy_curve(surface, True, shift)
    part = first_part(curve)
    assert abs(middle(curve, part) - (60 - shift) % COUNT) <= 2
    assert part.length == pytest.approx(2.0 * (HALF_LENGTH + DIRECTION) * curve.length, rel=0.2)
    inside = part.passed[part.first + 1 : part.last]
    assert (55 - shift) % COUNT in inside and (30 - shift) % COUNT not in inside


def test_bends_are_apart(surface):
    curve = wavy_curve(surface, True)
    legs = [part.passed.tolist() for part in two_legs(curve)]
    bends = [part for part in bent_parts(curve) if part.passed.tolist() not in legs]
    middles = curve.nodes.positions[[middle(curve, part) for part in bends]]
    assert len(bends) > 1
    for one, other in itertools.combinations(middles, 2):
        assert np.linalg.norm(one - other) >= 0.95 * APART * curve.length  # a node nearby


def test_bends_come_before_legs_and_those_of_the_most_bent_control_point_first(surface):
    """The bend is at node 60, between the control points 55 and 80."""
    curve = wavy_curve(surface, True)
    parts = two_legs(curve)
    assert len(parts) == len(curve.control_nodes)
    inside = [part.passed[part.first + 1 : part.last].tolist() for part in parts]
    assert sorted(inside[:2]) == [[55], [80]]
    in_order = [part.passed.tolist() for part in bent_parts(curve)]
    assert in_order[-len(parts) :] == [part.passed.tolist() for part in parts]


def test_an_end_of_an_open_curve_has_one_leg(surface):
    curve = wavy_curve(surface, False)
    assert len(two_legs(curve)) == len(curve.control_nodes) - 2


@pytest.mark.parametrize(("closed", "shift"), [(True, 0), (True, 55), (False, 0)])
def test_a_part_replaced_by_itself_changes_nothing(surface, closed, shift):
    """Also where it contains the first node of the curve, or an end of an open curve."""
    curve, parts = wavy_curve(surface, closed, shift), []
    wrapped = clipped = False
    for part in bent_parts(curve):
        parts.append(part)
        wrapped |= bool((np.diff(part.passed) < 0).any())
        clipped |= part.first == 0 or part.last == len(part.passed) - 1
        same = with_part(surface, curve, part, own_course(surface, curve, part))
        np.testing.assert_array_equal(same.control_nodes, curve.control_nodes)
        np.testing.assert_allclose(same.nodes.positions, curve.nodes.positions, atol=1e-6)
    assert len(parts) > 3 and clipped == (not closed) and wrapped == closed


def test_the_tension_is_that_of_the_whole_curve(surface):
    curve = wavy_curve(surface, True)
    part = first_part(curve)
    design = nicmm.design_curve(surface.mesh, [12, 80, 41], smoothness=2.0)
    request = request_for_part(design.resumable.request, curve, part)
    whole = 4.0 * np.pi**2 / (2.0 * curve.length**2)
    assert 4.0 * np.pi**2 / (request.smoothness * part.length**2) == pytest.approx(whole)
    assert not request.closed and len(request.points) == len(part.passed)


def test_the_result_never_crosses_itself(surface):
    """A course once round the pole meets the rest of the curve."""
    curve = wavy_curve(surface, True)
    part = first_part(curve)
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
    part = first_part(curve)
    changed = next(search.with_other_part(request, start, curve, part))
    assert scaled_bending(changed.curve) < 0.5 * scaled_bending(curve)
    np.testing.assert_array_equal(changed.visited, np.arange(4))
    found = changed.curve.nodes.places[changed.curve.control_nodes]
    np.testing.assert_allclose(found.positions(surface.mesh), controls.positions(surface.mesh))


@pytest.mark.slow
def test_searches_for_parts_are_bounded(monkeypatch):
    """As many as are allowed, whether they gain or not, and none without work left."""
    tried = []
    seek = start_search.StartSearch.with_other_part

    def counted(self, request, start, curve, part):
        tried.append(part.passed.tolist())
        return seek(self, request, start, curve, part)

    monkeypatch.setattr(start_search.StartSearch, "with_other_part", counted)
    monkeypatch.setattr(improvement, "FURTHER_SEEDS", ())
    monkeypatch.setattr(improvement, "BENT", 0.0)
    monkeypatch.setattr(improvement, "MOST_WORK", 1e9)
    monkeypatch.setattr(improvement, "LEAST_GAIN", 1.0)
    body, chosen = shapes.creature(5, resolution=32, faces=1500, subdivisions=1), [20, 250, 600]
    nicmm.design_curve(body, chosen)
    assert 3 <= len(tried) <= improvement.SEARCHES_FOR_PARTS
    assert len(set(map(tuple, tried))) == len(tried)  # without a gain, each part is tried once
    tried.clear()
    monkeypatch.setattr(improvement, "SEARCHES_FOR_PARTS", 2)
    nicmm.design_curve(body, chosen)
    assert len(tried) == 2
    tried.clear()
    monkeypatch.setattr(improvement, "MOST_WORK", 0)
    nicmm.design_curve(body, chosen)
    assert not tried


@pytest.mark.parametrize(("closed", "shift"), [(True, 0), (True, 55), (False, 0)])
def test_positions_of_a_part_run_along_the_curve(surface, closed, shift):
    curve = wavy_curve(surface, closed, shift)
    for part in bent_parts(curve):
        positions = part.positions(curve)
        ends = curve.nodes.positions[part.passed[[0, -1]]]
        np.testing.assert_array_equal(positions[[0, -1]], ends)
        assert np.linalg.norm(np.diff(positions, axis=0), axis=1).sum() == pytest.approx(
            part.length, rel=0.05
        )
