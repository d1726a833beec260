"""Next Course: other courses through the same points, in turn, and which of them is kept."""

import bpy
import numpy as np
import pytest
from scipy.spatial import cKDTree

from tests.blender import scenes
from tests.blender.test_point_operators import call, content, controls, refusal

pytestmark = pytest.mark.usefixtures("remembered_designs")

APART = 0.02

SAME = 1e-3
"""Distance up to which two lines are the same course; each search relaxes it a little further."""


@pytest.fixture
def torus(empty_scene):
    bpy.ops.mesh.primitive_torus_add(major_segments=48, minor_segments=24)
    bpy.ops.ed.undo_push(message="Torus")
    return bpy.context.active_object


@pytest.fixture
def curve(torus):
    """An open curve around a third of the torus, from the top to the bottom."""
    bpy.context.scene.nicmm_curves.closed = False
    call("add_point", position=(1.0, 0.0, 0.25))
    call("add_point", position=(-0.5, 0.866, -0.25))
    return bpy.context.active_object


def line(curve):
    """Points of the curve, (n, 3), in its own space."""
    (spline,) = curve.data.splines
    return scenes.get(spline.points, "co", 4)[:, :3]


def away(one, other):
    return max(cKDTree(one).query(other)[0].max(), cKDTree(other).query(one)[0].max())


def diagonal(mesh_object):
    return np.linalg.norm(np.ptp(scenes.positions(mesh_object), axis=0))


def all_courses(curve):
    """The lines of all courses, by Next Course until the first line appears again."""
    lines = [line(curve)]
    while True:
        call("next_course")
        if away(line(curve), lines[0]) < SAME:
            return lines
        lines.append(line(curve))
        assert len(lines) < 10


@pytest.mark.slow
def test_every_course_passes_the_points_and_differs_from_the_others(torus, curve):
    before, name, material = controls(curve), curve.name, bpy.data.materials.new("Ink")
    curve.data.materials.append(material)
    lines = all_courses(curve)
    assert len(lines) >= 3
    for number, one in enumerate(lines):
        for other in lines[:number]:
            assert away(one, other) > APART * diagonal(torus)
    np.testing.assert_array_equal(controls(curve), before)
    assert curve.name == name
    assert curve.data.materials[0] == material
    for point in before:
        assert max(np.linalg.norm(one - point, axis=1).min() for one in lines) < 1e-6


@pytest.mark.slow
def test_the_number_selects_a_course_and_the_first_is_the_fairest(torus, curve):
    fairest = line(curve)
    call("next_course", course=2)
    second = line(curve)
    assert away(second, fairest) > APART * diagonal(torus)
    call("next_course", course=1)
    assert away(line(curve), fairest) < SAME
    call("next_course")
    assert away(line(curve), second) < 1e-6


@pytest.mark.slow
def test_a_number_beyond_the_last_course_selects_the_last(torus, curve):
    lines = all_courses(curve)
    call("next_course", course=99)
    assert away(line(curve), lines[-1]) < SAME


@pytest.mark.slow
def test_updates_and_moves_keep_the_chosen_course(torus, curve):
    call("next_course", course=2)
    chosen = line(curve)
    assert bpy.ops.nicmm.update_curves() == {"FINISHED"}
    assert away(line(curve), chosen) < 0.5 * APART * diagonal(torus)
    place = torus.closest_point_on_mesh((-0.55, 0.85, -0.25))[1]
    call("move_point", index=1, position=place)
    assert away(line(curve), chosen) < 5 * APART * diagonal(torus)


@pytest.mark.slow
def test_it_is_one_undo_step(curve):
    before = content()
    call("next_course")
    after = content()
    assert after != before
    bpy.ops.ed.undo()
    assert content() == before
    bpy.ops.ed.redo()
    assert content() == after


@pytest.mark.slow
def test_without_another_course_nothing_changes(empty_scene):
    bpy.ops.mesh.primitive_plane_add()
    bpy.context.scene.nicmm_curves.closed = False
    call("add_point", position=(-0.5, 0.1, 0.0))
    call("add_point", position=(0.5, 0.2, 0.0))
    before = content()
    assert bpy.ops.nicmm.next_course("EXEC_DEFAULT", True) == {"CANCELLED"}
    assert content() == before


def test_a_drawing_without_a_curve_is_refused(torus):
    call("add_point", position=(1.0, 0.0, 0.25))
    assert "has 1 control point and no curve" in refusal("next_course")


def test_a_mesh_without_an_active_curve_is_refused(torus):
    assert "Make a designed curve active" in refusal("next_course")
