"""Parallel curves in Blender, in the installed extension."""

import bpy
import numpy as np
import pytest

from tests.blender import scenes

pytestmark = pytest.mark.usefixtures("remembered_designs")

DISTANCE = 0.2


@pytest.fixture
def equator(empty_scene):
    """A unit sphere, and a designed curve along its equator, counter-clockwise seen from above."""
    ball = scenes.sphere(5)
    scenes.select(ball, scenes.ring(ball, 6))
    assert bpy.ops.nicmm.design_curve(order="GIVEN") == {"FINISHED"}
    return bpy.context.active_object


def latitudes(curve_object, spline=0):
    """Angles above the equator of the points of a spline."""
    points = scenes.points(curve_object, spline)
    return np.arcsin(points[:, 2] / np.linalg.norm(points, axis=1))


def add(**settings):
    """Convert the active curve to parallel curves, and return their object."""
    given = {"parallel_distance": DISTANCE, **settings}
    assert bpy.ops.nicmm.convert_curve(output="PARALLEL", **given) == {"FINISHED"}
    return bpy.context.active_object


@pytest.mark.slow
def test_parallel_curves_are_at_their_distances_and_the_curve_is_kept(equator):
    parallel = add(parallel_count=2, both_sides=True)
    assert equator.name in bpy.data.objects and parallel is not equator
    found = sorted(latitudes(parallel, spline).mean() for spline in range(4))
    expected = DISTANCE * np.array([-2, -1, 1, 2])
    np.testing.assert_allclose(found, expected, rtol=5e-3)
    assert all(spline.use_cyclic_u for spline in parallel.data.splines)


def test_a_positive_distance_is_on_the_left_side(equator):
    points = scenes.points(equator)
    area = np.cross(points, np.roll(points, -1, axis=0))[:, 2].sum()
    parallel = add()
    assert np.sign(latitudes(parallel).mean()) == np.sign(area)


@pytest.mark.slow
@pytest.mark.parametrize("spline", ["EVEN", "EXACT", "BEZIER"])
def test_every_kind_of_spline(equator, spline):
    parallel = add()
    parallel.nicmm_parallel.spline = spline
    assert not parallel.nicmm_parallel.problem
    kind = "BEZIER" if spline == "BEZIER" else "POLY"
    assert parallel.data.splines[0].type == kind


@pytest.mark.slow
def test_a_changed_setting_computes_the_curves_again(equator):
    parallel = add()
    parallel.nicmm_parallel.distance = -0.3
    np.testing.assert_allclose(np.abs(latitudes(parallel)), 0.3, rtol=1e-2)
    parallel.nicmm_parallel.count = 3
    assert len(parallel.data.splines) == 3
    parallel.nicmm_parallel.both_sides = True
    assert len(parallel.data.splines) == 6


@pytest.mark.slow
def test_a_distance_that_is_too_great_keeps_the_shape_and_says_so(equator):
    parallel = add()
    before = scenes.points(parallel)
    parallel.nicmm_parallel.distance = 5.0
    np.testing.assert_array_equal(scenes.points(parallel), before)
    assert "smaller Distance" in parallel.nicmm_parallel.problem
    parallel.nicmm_parallel.distance = 0.1
    assert not parallel.nicmm_parallel.problem


@pytest.mark.slow
def test_parallel_curves_follow_the_curve(equator):
    parallel = add()
    before = scenes.points(parallel)
    scenes.activate(equator)
    vertices = scenes.positions(equator.parent)
    [vertex] = scenes.nearest_vertices(equator.parent, [(np.cos(0.4), 0.0, np.sin(0.4))])
    place = vertices[vertex]
    assert bpy.ops.nicmm.move_point(
        "EXEC_DEFAULT", curve=equator.name, index=0, position=place
    ) == {"FINISHED"}
    after = scenes.points(parallel)
    assert after.shape != before.shape or np.abs(after - before).max() > 0.05
    curve = scenes.points(equator)
    away = scenes.distances_to(after, curve)
    assert 0.9 * DISTANCE < away.min() and away.max() < 1.05 * DISTANCE


@pytest.mark.slow
def test_parallel_curves_follow_the_mesh_when_curves_are_updated(equator):
    parallel = add()
    ball = parallel.parent
    for vertex in ball.data.vertices:
        vertex.co.z += 1.0
    scenes.activate(ball)
    assert bpy.ops.nicmm.update_curves() == {"FINISHED"}
    assert (scenes.points(parallel)[:, 2] > 0.7).all()


def test_distances_are_in_scene_units(equator):
    ball = equator.parent
    ball.scale = (2.0, 2.0, 2.0)
    bpy.context.view_layer.update()
    parallel = add()
    np.testing.assert_allclose(np.abs(latitudes(parallel)), 0.5 * DISTANCE, rtol=2e-2)


def test_without_its_curve_the_parallel_curves_stay(equator):
    parallel = add()
    before = scenes.points(parallel)
    bpy.data.objects.remove(equator, do_unlink=True)
    parallel.nicmm_parallel.distance = 0.1
    np.testing.assert_array_equal(scenes.points(parallel), before)
    assert "was deleted" in parallel.nicmm_parallel.problem


@pytest.mark.slow
def test_a_new_curve_can_have_parallel_curves_at_once(empty_scene):
    ball = scenes.sphere(4)
    scenes.select(ball, scenes.ring(ball, 6))
    assert bpy.ops.nicmm.design_curve(
        output="PARALLEL", parallel_distance=0.1, both_sides=True
    ) == {"FINISHED"}
    parallel = bpy.context.active_object
    assert len(parallel.data.splines) == 2 and parallel.nicmm_parallel.source in scenes.curves()


def test_undo_takes_the_parallel_curves_back(equator):
    bpy.ops.ed.undo_push(message="Before")
    assert bpy.ops.nicmm.convert_curve(
        "EXEC_DEFAULT", True, output="PARALLEL", parallel_distance=DISTANCE
    ) == {"FINISHED"}
    assert len(scenes.curves()) == 2
    bpy.ops.ed.undo()
    assert len(scenes.curves()) == 1


@pytest.mark.slow
def test_no_place_so_far_away_is_an_error(equator):
    with pytest.raises(RuntimeError, match="smaller Distance"):
        bpy.ops.nicmm.convert_curve(output="PARALLEL", parallel_distance=5.0)
    assert len(scenes.curves()) == 1


def test_nothing_is_left_of_a_new_curve_without_parallel_curves(empty_scene):
    ball = scenes.sphere(3)
    scenes.select(ball, scenes.ring(ball, 4))
    with pytest.raises(RuntimeError, match="smaller Distance"):
        bpy.ops.nicmm.design_curve(output="PARALLEL", parallel_distance=5.0)
    assert not scenes.curves() and not bpy.data.curves
    assert bpy.context.active_object is ball


@pytest.mark.parametrize("scale", [(1, 1, 1), (-1, 1, 1), (-1, 1, 1.5), (-1, -1, -2)])
def test_left_is_left_as_seen_from_outside_whatever_the_scale(empty_scene, scale):
    ball = scenes.sphere(4)
    ball.scale = scale
    bpy.context.view_layer.update()
    scenes.select(ball, scenes.ring(ball, 6))
    assert bpy.ops.nicmm.design_curve(order="GIVEN") == {"FINISHED"}
    curve = bpy.context.active_object
    points = scenes.points(curve) * scale
    area = np.cross(points, np.roll(points, -1, axis=0))[:, 2].sum()
    height = (scenes.points(add())[:, 2] * scale[2]).mean()
    assert np.sign(height) == np.sign(area)


@pytest.mark.parametrize("output", ["CURVE", "STICKY"])
def test_parallel_curves_follow_the_curve_that_is_converted(equator, output):
    parallel = add()
    scenes.activate(equator)
    assert bpy.ops.nicmm.convert_curve(output=output) == {"FINISHED"}
    assert parallel.nicmm_parallel.source is bpy.context.active_object
    parallel.nicmm_parallel.distance = 0.3
    assert not parallel.nicmm_parallel.problem
    np.testing.assert_allclose(np.abs(latitudes(parallel)), 0.3, rtol=1e-2)


def test_a_linked_duplicate_gets_curves_of_its_own(equator):
    parallel = add()
    bpy.ops.object.duplicate_move_linked()
    duplicate = bpy.context.active_object
    before = scenes.points(parallel)
    duplicate.nicmm_parallel.distance = -0.3
    np.testing.assert_array_equal(scenes.points(parallel), before)
    np.testing.assert_allclose(np.abs(latitudes(duplicate)), 0.3, rtol=1e-2)


def test_splines_that_were_joined_are_not_lost(equator):
    parallel = add()
    bpy.ops.curve.primitive_bezier_circle_add()
    other = bpy.context.active_object
    scenes.activate(parallel)
    other.select_set(True)
    bpy.ops.object.join()
    parallel.nicmm_parallel.distance = 0.1
    assert len(parallel.data.splines) == 2
    assert "Separate them first" in parallel.nicmm_parallel.problem
