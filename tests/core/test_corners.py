"""Tests curves that turn freely at some of their control points."""

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.relaxation.curve_nodes import curve_surface
from nicmm_core.relaxation.elastic_energy import bending_energy
from tests.core.checks import assert_valid_design, scaled
from tests.oracles.reference_energy import energy, linearised

SQUARE = np.array([[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0], [0.5, 0.5, 0.0], [-0.5, 0.5, 0.0]])


def turns(curve):
    """Angle by which the curve turns at each control point, in radians."""
    points, index = curve.points, curve.control_index
    n = len(points)
    before = points[index] - points[(index - 1) % n]
    after = points[(index + 1) % n] - points[index]
    cosine = (before * after).sum(axis=1)
    cosine /= np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
    return np.arccos(cosine.clip(-1.0, 1.0))


@pytest.mark.slow
def test_indices_may_be_an_array():
    mesh = shapes.disc(12)
    by_list = nicmm.design_curve(mesh, SQUARE, corners=[1, 2])
    by_array = nicmm.design_curve(mesh, SQUARE, corners=np.array([1, 2]))
    np.testing.assert_array_equal(by_array.curves[0].points, by_list.curves[0].points)
    with pytest.raises(nicmm.ArgumentError, match="corners needs the method"):
        nicmm.design_curve(mesh, SQUARE, corners=np.array([1, 2]), method="variational")


@pytest.mark.parametrize("factor", [1e-3, 1.0, 1e3])
def test_a_square_through_four_corners(factor):
    mesh = scaled(shapes.disc(30), factor)
    design = nicmm.design_curve(mesh, factor * SQUARE, corners=[0, 1, 2, 3])
    assert_valid_design(mesh, design, factor * SQUARE)
    curve = design.curves[0]
    off = np.abs(np.abs(curve.points[:, :2] / factor).max(axis=1) - 0.5).max()
    assert off < 1e-3
    assert turns(curve) == pytest.approx(np.full(4, np.pi / 2), abs=1e-2)
    assert design.energy["smooth"] < 1e-3


@pytest.mark.slow
def test_only_corners_turn():
    """Between two corners, the curve through a third point is smooth there."""
    mesh = shapes.disc(30)
    design = nicmm.design_curve(mesh, SQUARE, corners=[0, 2])
    angle = turns(design.curves[0])
    assert (angle[[0, 2]] > 0.3).all()
    assert (angle[[1, 3]] < 0.1).all()
    smooth = nicmm.design_curve(mesh, SQUARE)
    assert (turns(smooth.curves[0]) < 0.1).all()
    assert design.energy["smooth"] < smooth.energy["smooth"]


@pytest.mark.slow
def test_an_open_curve_with_a_corner_consists_of_two_open_curves(body):
    """With a corner in the middle, each part has free ends as a curve of its own has."""
    points = np.array([3, 250, 399, 120, 333])
    whole = nicmm.design_curve(body, points, closed=False, corners=[2])
    assert_valid_design(body, whole, body.vertices[points], closed=False)
    nodes = whole.resumable.curve.nodes
    assert nodes.corners is not None
    assert nodes.angles[nodes.corners] == 0.0
    designer = nicmm.Designer(body)
    smooth = designer.design(points, closed=False)
    turned = designer.design(points, closed=False, corners=[2], start=smooth)  # the same course
    assert turned.energy["smooth"] < smooth.energy["smooth"]


def test_corners_are_kept_in_any_order(body):
    """Corners are indices of the given points, also if the curve visits them in another order."""
    points = [3, 250, 399, 120]
    design = nicmm.design_curve(body, points, order="shortest", corners=[1])
    assert_valid_design(body, design)
    curve, resumable = design.curves[0], design.resumable
    (corner,) = resumable.curve.corner_nodes
    place = int(np.flatnonzero(resumable.curve.control_nodes == corner)[0])
    assert resumable.visited[place] == 1
    np.testing.assert_allclose(curve.points[curve.control_index[place]], body.vertices[250])


@pytest.mark.slow
def test_a_corner_can_be_set_and_removed_from_a_start():
    mesh = shapes.disc(30)
    designer = nicmm.Designer(mesh)
    smooth = designer.design(SQUARE)
    cornered = designer.design(SQUARE, start=smooth, corners=[0, 1, 2, 3])
    assert turns(cornered.curves[0]) == pytest.approx(np.full(4, np.pi / 2), abs=0.02)
    again = designer.design(SQUARE, start=cornered)
    assert again.energy["smooth"] == pytest.approx(smooth.energy["smooth"], rel=0.02)
    dragged = SQUARE + np.array([[0.02, 0.03, 0.0], [0, 0, 0], [0, 0, 0], [0, 0, 0]])
    moved = designer.design(dragged, start=cornered, corners=[0, 1, 2, 3])
    assert_valid_design(mesh, moved, dragged)
    assert moved.energy["smooth"] < 1e-3


@pytest.mark.slow
def test_corners_on_a_large_mesh():
    """There courses are found on a coarse mesh."""
    mesh = shapes.sphere(6)
    assert len(mesh.vertices) > 6_000
    generator = np.random.default_rng(2)
    points = generator.choice(len(mesh.vertices), 4, replace=False)
    design = nicmm.design_curve(mesh, points, order="shortest", corners=[0, 1, 2, 3])
    assert_valid_design(mesh, design, None)
    assert design.energy["smooth"] < 0.05  # four parts of great circles


@pytest.mark.slow
def test_the_energy_at_corners_is_that_of_the_formula(flat_disc):
    design = nicmm.design_curve(flat_disc, SQUARE, corners=[1, 3])
    nodes = design.resumable.curve.nodes
    here = linearised(curve_surface(design.resumable.mesh), nodes)
    assert here.energy == pytest.approx(energy(nodes, here))
    assert bending_energy(nodes) == pytest.approx((nodes.angles**2 / nodes.ds).sum())


@pytest.mark.parametrize(
    ("corners", "message"),
    [
        ([4], r"corners\[0\] is 4; pass the index of a control point, 0 … 3"),
        ([0, -1], r"corners\[1\] is -1"),
        ([0.5], r"corners\[0\] is 0.5"),
        ([True], r"corners\[0\] is True"),
        (3, "corners is 3; pass indices"),
        ("a", r"corners\[0\] is 'a'"),
    ],
)
def test_what_is_no_index_is_refused(flat_disc, corners, message):
    with pytest.raises(nicmm.ArgumentError, match=message):
        nicmm.design_curve(flat_disc, SQUARE, corners=corners)


@pytest.mark.parametrize("method", ["nicmm", "variational"])
def test_other_methods_have_no_corners(flat_disc, method):
    with pytest.raises(nicmm.ArgumentError, match='corners needs the method "elastic"'):
        nicmm.design_curve(flat_disc, SQUARE, corners=[0], method=method)
    with pytest.raises(nicmm.ArgumentError, match='normal_bending needs the method "elastic"'):
        nicmm.design_curve(flat_disc, SQUARE, normal_bending=1.0, method=method)
