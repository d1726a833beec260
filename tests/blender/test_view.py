"""The view: maps pixels to points on the mesh and back, and finds what can be picked."""

from dataclasses import replace

import bpy
import numpy as np
import pytest

from tests.blender import scenes
from tests.blender.scenes import module

CENTRE = np.array([400.0, 300.0])


def matrices(eye, perspective):
    """The matrix of a view of 800 × 600 pixels from a point on the y axis towards the origin."""
    near, far, half = 0.1, 100.0, 0.5
    forward = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, eye], [0, 0, 0, 1.0]])
    ratio = 600 / 800
    if perspective:
        depth = [-(far + near) / (far - near), -2 * far * near / (far - near)]
        projection = np.array(
            [[1 / half, 0, 0, 0], [0, 1 / half / ratio, 0, 0], [0, 0, *depth], [0, 0, -1, 0]]
        )
    else:
        projection = np.diag([0.5, 0.5 / ratio, -2 / (far - near), 1.0])
        projection[2, 3] = -(far + near) / (far - near)
    return projection @ forward


def drawn(extension, mesh_object):
    """A curve through five points around a sphere, opened for editing."""
    bpy.context.view_layer.objects.active = mesh_object
    places = [mesh_object.closest_point_on_mesh(place)[1] for place in scenes.five_places()]
    points = [{"name": "", "position": place} for place in places]
    bpy.ops.nicmm.edit_curve(points=points, spline="EXACT")
    edited_curve = module(extension, "outputs.edited_curve")
    return edited_curve.open_curve(bpy.context, bpy.context.active_object)


def looking(extension, opened, eye=-5.0, perspective=True, xray=False):
    surface = opened.surface
    mesh = module(extension, "scene.surface_cache").core_mesh(surface)
    view = module(extension, "tool.view").View
    size = np.array([800.0, 600.0])
    return view(matrices(eye, perspective), size, surface, mesh, xray)


@pytest.mark.parametrize("perspective", [True, False])
@pytest.mark.parametrize("scale", [(1, 1, 1), (1, 1, 2)])
def test_pixels_and_places(empty_scene, perspective, scale):
    sphere = scenes.sphere(4)
    sphere.scale = scale
    bpy.context.view_layer.update()
    opened = drawn(empty_scene, sphere)
    view = looking(empty_scene, opened, perspective=perspective)
    for pixel in ([400.0, 300.0], [450.0, 330.0], [370.0, 280.0]):
        found = view.surface_point_at(pixel)
        place = opened.surface.points(found.faces, found.barycentric)
        np.testing.assert_allclose(view.project(place)[0], pixel, atol=1e-3)
        assert place[0, 1] < 0  # on the side that faces the eye
        assert view.visible(place).all()
        assert not view.visible(place * [1, -1, 1]).any()
    assert view.surface_point_at([10.0, 10.0]) is None
    behind = np.array([[0.0, -6.0, 0.0]])
    assert np.isnan(view.project(behind)).all() == perspective


def test_only_what_is_visible_is_picked(empty_scene):
    opened = drawn(empty_scene, scenes.sphere(4))
    view, through = looking(empty_scene, opened), looking(empty_scene, opened, xray=True)
    positions = opened.positions()
    visible = view.visible(positions)
    np.testing.assert_array_equal(visible, positions[:, 1] < -1 / 5)
    assert visible.any() and not visible.all() and through.visible(positions).all()
    pixels = view.project(positions)
    for number, pixel in enumerate(pixels):
        found = view.nearest_point(pixel + [3.0, 0.0], positions, 10.0)
        assert found == (number if visible[number] else None)
        assert through.nearest_point(pixel + [3.0, 0.0], positions, 10.0) == number
    line = opened.lines()[0]
    segment = int(np.flatnonzero(view.visible(line))[10])
    pixel = view.project(0.5 * line[[segment]] + 0.5 * line[[segment + 1]])[0]
    found = view.nearest_on_line(pixel, line, 5.0)
    place = line[found[0]] * (1 - found[1]) + line[found[0] + 1] * found[1]
    np.testing.assert_allclose(place, 0.5 * (line[segment] + line[segment + 1]), atol=1e-3)
    assert view.nearest_on_line(pixel + [0, 200.0], line, 5.0) is None


def test_a_tube_over_the_horizon_is_picked_where_it_is_seen(empty_scene):
    """The sphere hides the curve, but not a tube around it with a tenth of the sphere's radius."""
    opened = drawn(empty_scene, scenes.sphere(5))
    view = looking(empty_scene, opened, perspective=False)
    angles = np.linspace(0.3, np.pi - 0.3, 60)
    depth = 0.1
    line = np.sqrt(1 - depth**2) * np.stack(
        [np.cos(angles), np.zeros(60), np.sin(angles)], axis=1
    ) + [0.0, depth, 0.0]
    top = view.project(np.array([[0.0, depth, np.sqrt(1 - depth**2)]]))[0]
    over = view.project(np.array([[0.0, 0.0, 1.06]]))[0]
    assert view.nearest_on_line(top, line, 20.0) is None
    assert view.nearest_on_line(over, line, 20.0) is None
    assert view.nearest_on_line(over, line, 2.0, radius=0.1) is not None
    assert view.nearest_on_line(over, line, 2.0, radius=0.01) is None
    assert view.nearest_on_line(over + [0, 30.0], line, 2.0, radius=0.1) is None
    # In the middle of the view the front of the sphere hides the tube.
    assert view.nearest_on_line(CENTRE, line * [1, 1, 0], 2.0, radius=0.1) is None


def test_what_is_behind_hidden_faces_is_seen_and_picked(empty_scene):
    opened = drawn(empty_scene, scenes.sphere(4))
    surface = opened.surface
    facing = surface.local_positions[surface.faces].mean(axis=1)[:, 1] < 0.0
    view = looking(empty_scene, replace(opened, surface=replace(surface, hidden=facing)))
    pixel = np.array([450.0, 330.0])
    found = view.surface_point_at(pixel)
    place = surface.points(found.faces, found.barycentric)
    assert place[0, 1] > 0.0
    assert view.visible(place).all() and view.nearest_point(pixel, place, 1.0) == 0
    all_hidden = replace(surface, hidden=np.ones(len(facing), dtype=bool))
    view = looking(empty_scene, replace(opened, surface=all_hidden))
    assert view.surface_point_at(pixel) is None and view.visible(place).all()
