"""Curves that avoid those above them in the list: distance, order, following, junctions."""

import bpy
import numpy as np
import pytest

from tests.blender import scenes
from tests.blender.scenes import module
from tests.blender.test_point_operators import call, refusal

pytestmark = [pytest.mark.usefixtures("remembered_designs")]

CLEARANCE = 0.1
LEAST = 0.97
"""Least distance in space from an avoided curve, in clearances; it is less than along the
surface."""

ROUNDING = 2e-6


@pytest.fixture
def sphere(empty_scene):
    made = scenes.sphere(4)
    bpy.ops.ed.undo_push(message="Sphere")
    return made


def around(height, count=4, wave=0.0):
    """Positions around the unit sphere at a height, (count, 3)."""
    angles = 2.0 * np.pi * np.arange(count) / count
    heights = height + wave * np.cos(2.0 * angles)
    radii = np.sqrt(1.0 - heights**2)
    return np.stack([radii * np.cos(angles), radii * np.sin(angles), heights], axis=1)


def on(mesh_object, places):
    return [list(mesh_object.closest_point_on_mesh(place)[1]) for place in places]


def draw(mesh_object, places, name, **settings):
    """A designed curve through positions, which becomes the active object."""
    scenes.activate(mesh_object)
    points = [{"name": "", "position": place} for place in on(mesh_object, places)]
    assert bpy.ops.nicmm.edit_curve("EXEC_DEFAULT", True, points=points, **settings) == {"FINISHED"}
    made = bpy.context.active_object
    made.name = name
    bpy.ops.ed.undo_push(message="Name")
    return made


def line_of(extension, curve):
    """The recorded curve of the core, on the present surface of its mesh."""
    record = module(extension, "scene.curve_record")
    mesh_object = record.mesh_of(curve)
    surface = module(extension, "scene.surface").read(mesh_object, True)
    (found,) = record.read_curves(curve, surface)
    return found


def distance(extension, one, other):
    """Least distance in space between two curves."""
    lines = [line_of(extension, each).points for each in (one, other)]
    dense = [scenes_dense(line) for line in lines]
    return min(np.linalg.norm(dense[1] - point, axis=1).min() for point in dense[0])


def scenes_dense(line, count=8):
    ends = np.roll(line, -1, axis=0)
    shares = np.linspace(0.0, 1.0, count, endpoint=False)[:, None, None]
    return ((1.0 - shares) * line + shares * ends).reshape(-1, 3)


def order(mesh_object, extension):
    found = module(extension, "scene.curve_record").designed_on(mesh_object)
    return [each.name for each in found]


def test_first(empty_scene, sphere):
    first = draw(sphere, around(0.0), "First")
    second = draw(sphere, around(0.2, wave=0.08), "Second", avoid_others=True, clearance=CLEARANCE)
    print(distance(empty_scene, first, second))
    assert order(sphere, empty_scene) == ["First", "Second"]
    before = line_of(empty_scene, second).points
    call("move_point", curve="First", index=0, position=on(sphere, [(1.0, 0.0, 0.12)])[0])
    after = line_of(empty_scene, second).points
    print(len(before), len(after), distance(empty_scene, first, second))
    bpy.ops.ed.undo()
    assert (line_of(empty_scene, bpy.data.objects["Second"]).points == before).all()
