"""Tests contours of known fields: position, connectedness and direction."""

from dataclasses import replace

import numpy as np
import pytest

from nicmm_core.paper.contour import SNAP_MARGIN, extract_curves
from nicmm_core.path.virtual_splits import SplitMesh
from tests.core.checks import (
    assert_does_not_touch_itself,
    assert_lies_on_surface,
    assert_valid_curve,
    circle,
    euler_characteristic,
    mean_edge_length,
)
from tests.oracles.named_curves import nearest_vertices

NONE = np.zeros(0, dtype=np.int64)


def curves_of(mesh, field, controls=NONE):
    """Contour of a field that is given at the vertices of a connected mesh."""
    working, _ = SplitMesh(mesh).assemble(0)
    np.testing.assert_array_equal(working.input_vertex, np.arange(len(mesh.vertices)))
    curves = extract_curves(mesh, working, np.asarray(field, dtype=float), np.asarray(controls))
    for curve in curves:
        assert_lies_on_surface(mesh, curve)
        assert_does_not_touch_itself(mesh, curve)
    return curves


def assert_nearly_all_exact(mesh, deviation):
    """Assert that the contour is exact except at vertices to which it snaps."""
    assert np.abs(deviation).max() < SNAP_MARGIN * 1.5 * mean_edge_length(mesh)
    assert np.quantile(np.abs(deviation), 0.8) < 1e-9


@pytest.mark.parametrize("offset", [0.013, -0.37, 0.66])
def test_linear_field_gives_a_straight_line_from_boundary_to_boundary(flat_disc, offset):
    across = np.array([0.6, 0.8, 0.0])
    (curve,) = curves_of(flat_disc, flat_disc.vertices @ across - offset)
    assert not curve.closed
    assert_nearly_all_exact(flat_disc, curve.points @ across - offset)
    along = curve.points @ [-0.8, 0.6, 0.0]
    assert (np.diff(along) > 0).all() or (np.diff(along) < 0).all()
    # The rim is a polygon with 72 sides, so the chord ends slightly inside the unit circle.
    assert curve.length == pytest.approx(2 * np.sqrt(1 - offset**2), rel=5e-3)
    ends = np.linalg.norm(curve.points[[0, -1]], axis=1)
    assert (ends > 0.99).all()


@pytest.mark.parametrize("height", [0.31, -0.72])
def test_height_on_the_sphere_gives_a_parallel(ball, height):
    (curve,) = curves_of(ball, ball.vertices[:, 2] - height)
    assert curve.closed
    assert_valid_curve(ball, curve)
    assert_nearly_all_exact(ball, curve.points[:, 2] - height)
    assert curve.length == pytest.approx(2 * np.pi * np.sqrt(1 - height**2), rel=0.01)
    assert len(curve.control_index) == 0


def test_several_curves_come_longest_first(ring):
    outer, inner = curves_of(ring, ring.vertices[:, 2] - 0.01)
    assert outer.closed and inner.closed
    assert np.linalg.norm(outer.points, axis=1).min() > 1.0
    assert np.linalg.norm(inner.points, axis=1).max() < 1.0
    assert outer.length > inner.length


def test_curve_with_the_control_points_comes_first(ring):
    """Even if another curve is longer."""
    angles = np.array([0.0, 2.0, 4.0])
    controls = nearest_vertices(ring, circle(angles, radius=0.6))
    curves = curves_of(ring, ring.vertices[:, 2], controls)
    assert len(curves) == 2
    assert (curves[0].control_index >= 0).all()
    assert (curves[1].control_index == -1).all()
    assert curves[0].length < curves[1].length


def test_zeros_at_other_vertices_do_not_shatter_the_contour(ball, flat_disc):
    """A great circle and a diameter that pass through many vertices."""
    on_circle = np.abs(ball.vertices[:, 2]) < 1e-12
    assert on_circle.sum() > 20
    (curve,) = curves_of(ball, np.where(on_circle, 0.0, ball.vertices[:, 2]))
    assert_valid_curve(ball, curve)
    assert curve.length == pytest.approx(2 * np.pi, rel=0.01)
    on_line = np.abs(flat_disc.vertices[:, 1]) < 1e-12
    assert on_line.sum() > 20
    (line,) = curves_of(flat_disc, np.where(on_line, 0.0, flat_disc.vertices[:, 1]))
    assert not line.closed
    assert line.length == pytest.approx(2.0, rel=1e-3)


def test_a_patch_of_zeros_counts_as_one_side(ball):
    """All zeros count as the same sign, so a plateau moves the curve to its rim at most."""
    height = ball.vertices[:, 2]
    (curve,) = curves_of(ball, np.where(np.abs(height) < 0.3, 0.0, height))
    assert_valid_curve(ball, curve)
    assert np.abs(curve.points[:, 2]).max() < 0.5


@pytest.fixture(scope="module")
def equator(ball):
    """Four vertices of the equator in order; no two are neighbours."""
    controls = nearest_vertices(ball, circle(np.pi / 2 * np.arange(4)))
    assert (ball.vertices[controls, 2] == 0.0).all()
    return controls


def test_control_vertices_are_hit_exactly(ball, equator):
    (curve,) = curves_of(ball, ball.vertices[:, 2], equator)
    assert_valid_curve(ball, curve, ball.vertices[equator])
    np.testing.assert_array_equal(curve.points[curve.control_index], ball.vertices[equator])


def test_value_at_a_control_vertex_counts_as_zero(ball, equator):
    field = ball.vertices[:, 2].copy()
    field[equator] = [1e-9, -1e-9, 1e-3, -1e-3]
    (curve,) = curves_of(ball, field, equator)
    assert_valid_curve(ball, curve, ball.vertices[equator])


def test_direction_and_start_follow_the_visiting_order(ball, equator):
    for order in ([0, 1, 2, 3], [3, 2, 1, 0], [2, 3, 0, 1], [1, 0, 3, 2]):
        controls = equator[order]
        (curve,) = curves_of(ball, ball.vertices[:, 2], controls)
        assert_valid_curve(ball, curve, ball.vertices[controls])
        assert curve.control_index[0] == 0


def test_sign_of_the_field_does_not_matter_to_the_place(ball, equator):
    field = ball.vertices[:, 2] + 0.2 * ball.vertices[:, 0] * ball.vertices[:, 1]
    (curve,), (mirrored,) = (curves_of(ball, sign * field, equator) for sign in (1, -1))
    assert_valid_curve(ball, mirrored, ball.vertices[equator])
    assert mirrored.length == pytest.approx(curve.length, rel=1e-5)


def test_missed_control_vertex_is_marked(ball, equator):
    """A control vertex inside one of the regions is on no curve."""
    pole = nearest_vertices(ball, [[0.0, 0.0, 1.0]])
    curves = curves_of(ball, ball.vertices[:, 2] - 0.01, np.append(equator[:2], pole))
    passing = curves[0]
    assert (passing.control_index[:2] >= 0).all()
    assert passing.control_index[2] == -1


def test_no_sign_change_gives_no_curve(ball):
    assert curves_of(ball, np.ones(len(ball.vertices))) == []


def test_contour_on_split_faces_refers_to_the_input_mesh(small_ball):
    """Splits of faces do not move the contour of a linear field."""
    split = SplitMesh(small_ball)
    for face in (5, 77, 200):
        split.split_face(face)
    split.split_edge(*small_ball.faces[120, :2].tolist())
    working, _ = split.assemble(0)
    assert euler_characteristic(working.faces) == 2
    tilt = np.array([0.36, 0.48, 0.8])
    (curve,) = extract_curves(small_ball, working, working.vertices @ tilt - 0.05, NONE)
    (plain,) = curves_of(small_ball, small_ball.vertices @ tilt - 0.05)
    assert_valid_curve(small_ball, curve)
    assert_nearly_all_exact(small_ball, curve.points @ tilt - 0.05)
    assert curve.length == pytest.approx(plain.length, rel=1e-3)


def test_curve_is_frozen(ball):
    (curve,) = curves_of(ball, ball.vertices[:, 2] - 0.3)
    with pytest.raises(AttributeError):
        curve.closed = False
    assert not replace(curve, closed=False).closed
