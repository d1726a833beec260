"""Tests that curves never enter obstacles of weight 1, and the error if no curve exists."""

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.distances import build_distance_surface, propagate
from nicmm_core.surface_designer import SurfaceDesigner
from tests.core.checks import assert_valid_design
from tests.oracles.named_curves import nearest_vertices

pytestmark = pytest.mark.usefixtures("one_attempt_each")


def length_inside(mesh, curve, weights):
    """Length of a curve in faces whose three corners have weight 1."""
    n_segments = len(curve.points) if curve.closed else len(curve.points) - 1
    ends = np.roll(curve.points, -1, axis=0)
    lengths = np.linalg.norm(ends - curve.points, axis=1)[:n_segments]
    inside = (weights[mesh.faces] >= 1.0).all(axis=1)
    return lengths[inside[curve.faces[:n_segments]]].sum()


def disc_on(mesh, curve, radius):
    """Weights of a disc around the point of a curve that is farthest from its control points."""
    controls = curve.points[curve.control_index]
    apart = np.linalg.norm(curve.points[:, None] - controls, axis=2).min(axis=1)
    away = np.linalg.norm(mesh.vertices - curve.points[apart.argmax()], axis=1)
    return (away < radius).astype(float)


def some_vertices(mesh, count, seed):
    return np.random.default_rng(seed).choice(
        np.flatnonzero(mesh.referenced), size=count, replace=False
    )


@pytest.mark.slow
@pytest.mark.parametrize("method", ["elastic", "nicmm", "variational"])
def test_every_method_goes_round(method):
    ball = shapes.sphere(3)
    chosen = nearest_vertices(ball, [[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]])
    free = nicmm.design_curve(ball, chosen, method=method).curves[0]
    weights = disc_on(ball, free, 0.25)
    assert length_inside(ball, free, weights) > 0.2
    design = nicmm.design_curve(ball, chosen, method=method, obstacles=weights)
    assert_valid_design(ball, design)
    assert length_inside(ball, design.curves[0], weights) == 0.0


@pytest.mark.slow
@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize("seed", range(2))
def test_no_length_inside_on_any_surface(surface, closed, seed):
    chosen = some_vertices(surface, 4, seed)
    free = nicmm.design_curve(surface, chosen, closed=closed, order="shortest").curves[0]
    weights = disc_on(surface, free, 0.06 * surface.diagonal)
    weights[chosen] = 0.0
    try:
        design = nicmm.design_curve(
            surface, chosen, closed=closed, order="shortest", obstacles=weights
        )
    except nicmm.UnreachableError as error:
        # A disc that blocks a limb makes a curve impossible; so may one beside the rim.
        assert "obstacles" in str(error) or "order" in str(error)
        return
    assert_valid_design(surface, design, closed=closed)
    assert length_inside(surface, design.curves[0], weights) == 0.0


@pytest.mark.slow
def test_lower_weights_may_be_crossed():
    ball = shapes.sphere(4)
    # The curve has to cross this belt around the equator twice.
    belt = 0.9 * (np.abs(ball.vertices[:, 2]) < 0.2)
    chosen = nearest_vertices(ball, [[0.6, 0, 0.8], [-0.6, 0, 0.8], [0, 0.6, -0.8]])
    assert_valid_design(ball, nicmm.design_curve(ball, chosen, obstacles=belt))
    with pytest.raises(nicmm.UnreachableError, match="obstacles of weight 1 separate"):
        nicmm.design_curve(ball, chosen, obstacles=np.ceil(belt))


def test_a_point_inside_is_named():
    ball = shapes.sphere(3)
    weights = (ball.vertices[:, 2] > 0.5).astype(float)
    chosen = nearest_vertices(ball, [[0, 1, -0.5], [1, 0, -0.5], [0, 0, 1]])
    with pytest.raises(nicmm.UnreachableError, match=r"control_points\[2\] lies inside"):
        nicmm.design_curve(ball, chosen, obstacles=weights)
    with pytest.raises(nicmm.UnreachableError, match="cover the whole surface"):
        nicmm.design_curve(ball, chosen, obstacles=np.ones(len(ball.vertices)))


@pytest.mark.slow
def test_clearance_keeps_the_curve_away():
    ball = shapes.sphere(4)
    chosen = nearest_vertices(ball, [[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]])
    weights = disc_on(ball, nicmm.design_curve(ball, chosen).curves[0], 0.15)
    design = nicmm.design_curve(ball, chosen, obstacles=weights, clearance=0.2)
    assert_valid_design(ball, design)
    distance = np.where(weights >= 1.0, 0.0, np.inf)
    propagate(
        build_distance_surface(ball.vertices, ball.faces, ball.mean_edge_length), distance, np.inf
    )
    curve = design.curves[0]
    along = (curve.barycentric * distance[ball.faces[curve.faces]]).sum(axis=1)
    assert along.min() >= 0.2
    with pytest.raises(nicmm.ArgumentError, match="clearance"):
        nicmm.design_curve(ball, chosen, clearance=0.2)
    for wrong in (-1.0, np.nan, np.inf, "far"):
        with pytest.raises(nicmm.ArgumentError, match="clearance"):
            nicmm.design_curve(ball, chosen, obstacles=weights, clearance=wrong)


@pytest.mark.slow
def test_dragging_beside_an_obstacle_goes_on_from_the_last_curve(monkeypatch):
    from_nothing = []
    designed = SurfaceDesigner._designed
    monkeypatch.setattr(
        SurfaceDesigner, "_designed", lambda *given: from_nothing.append(1) or designed(*given)
    )
    ball = shapes.sphere(4)
    chosen = nearest_vertices(ball, [[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]])
    weights = disc_on(ball, nicmm.design_curve(ball, chosen).curves[0], 0.2)
    from_nothing.clear()
    designer = nicmm.Designer(ball)
    first = designer.design(chosen, obstacles=weights)
    again = designer.design(chosen, obstacles=weights)
    assert np.array_equal(first.curves[0].points, again.curves[0].points)
    around = ball.faces[ball.faces_at(chosen[:1])].ravel()
    chosen[0] = next(vertex for vertex in around if vertex not in chosen)
    from_nothing.clear()
    moved = designer.design(chosen, obstacles=weights, start=first)
    assert_valid_design(ball, moved)
    assert length_inside(ball, moved.curves[0], weights) == 0.0
    assert not from_nothing


def test_distances_are_along_what_is_left():
    ball = shapes.sphere(3)
    chosen = nearest_vertices(ball, [[0, 1, -0.5], [1, 0, -0.5], [-1, 0, -0.5]])
    weights = (ball.vertices[:, 2] > 0.5).astype(float)
    design = nicmm.design_curve(ball, chosen, obstacles=weights)
    assert design.field.shape == (len(ball.vertices),)
    assert np.isfinite(design.field).all()
