"""Corners in Blender: given in scripts, toggled, kept when a curve changes, sharp in outputs."""

import os
import runpy
from importlib import import_module

import bpy
import numpy as np
import pytest

from mathutils import Vector
from mathutils.bvhtree import BVHTree

from tests.blender import scenes
from tests.blender.scenes import module
from tests.blender.test_point_operators import call, content, refusal, undo_and_redo

pytestmark = pytest.mark.usefixtures("remembered_designs")

ROUNDING = 2e-6
SQUARE = np.array([[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0], [0.5, 0.5, 0.0], [-0.5, 0.5, 0.0]])
STRAIGHT = 1e-3
"""Greatest distance of a relaxed curve from the square; that of one without corners is 0.1."""

TEXT = ", ".join(" ".join(map(str, place)) for place in SQUARE)


@pytest.fixture
def plane(empty_scene):
    """A plane from -1 to 1, of 31 × 31 quads."""
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=31, y_subdivisions=31, size=2.0)
    bpy.ops.ed.undo_push(message="Plane")
    return bpy.context.active_object


@pytest.fixture
def square(plane):
    """A closed curve through the corners of a square, which are corners of the curve; active."""
    return draw(corners="0, 1, 2, 3")


def draw(**settings):
    settings = {"points": TEXT, "spline": "EXACT", **settings}
    assert bpy.ops.nicmm.design_curve("EXEC_DEFAULT", True, **settings) == {"FINISHED"}
    return bpy.context.active_object


def corners(curve):
    """Whether each control point of a curve is a corner."""
    return list(curve["nicmm_curve"]["corner_points"])


def controls(curve):
    return np.array(curve["nicmm_curve"]["control_positions"]).reshape(-1, 3)


def off_square(points):
    """Greatest distance of points from the square in the larger coordinate."""
    return np.abs(np.abs(np.asarray(points)[:, :2]).max(axis=1) - 0.5).max()


def is_passed(points, place):
    return np.linalg.norm(np.asarray(points) - place, axis=1).min() < ROUNDING


# Outputs.


@pytest.mark.parametrize("spline", ["EVEN", "EXACT"])
def test_points_of_a_square(plane, spline):
    curve = draw(corners="0, 1, 2, 3", spline=spline)
    points = scenes.points(curve)
    assert off_square(points) < STRAIGHT
    assert all(is_passed(points, place) for place in SQUARE)
    assert off_square(scenes.points(draw_on(plane, spline=spline))) > 0.05


def draw_on(plane, **settings):
    scenes.activate(plane)
    return draw(**settings)


def test_handles_at_corners_are_free(plane):
    curve = draw(corners="0, 2", spline="BEZIER")
    points = curve.data.splines[0].bezier_points
    places = np.array([point.co[:] for point in points])
    kinds = {
        number: {(points[k].handle_left_type, points[k].handle_right_type) for k in found}
        for number, place in enumerate(SQUARE)
        for found in [np.flatnonzero(np.linalg.norm(places - place, axis=1) < ROUNDING)]
    }
    assert kinds == {
        0: {("FREE", "FREE")},
        1: {("ALIGNED", "ALIGNED")},
        2: {("FREE", "FREE")},
        3: {("ALIGNED", "ALIGNED")},
    }


def test_a_bezier_square_has_straight_sides(plane):
    curve = draw(corners="0, 1, 2, 3", spline="BEZIER")
    points = curve.data.splines[0].bezier_points
    assert len(points) == 4
    for name in ("co", "handle_left", "handle_right"):
        assert off_square(scenes.get(points, name, 3)) < STRAIGHT


@pytest.mark.parametrize("spline", ["EVEN", "BEZIER"])
def test_sticky_curves(plane, spline):
    curve = draw(corners="0, 1, 2, 3", output="STICKY", spline=spline)
    points = scenes.evaluated_points(curve)
    assert off_square(points) < STRAIGHT
    assert all(is_passed(points, place) for place in SQUARE)


def test_a_tube_is_as_thick_beside_a_corner_as_elsewhere(plane):
    """Blender's tube is thinner at the corner itself."""
    radius = 0.03
    curve = draw(corners="0, 1, 2, 3", spline="EVEN", radius=radius)
    assert len(curve.data.splines[0].points) < 60
    evaluated = curve.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    tube = BVHTree.FromPolygons(
        [vertex.co for vertex in mesh.vertices], [face.vertices[:] for face in mesh.polygons]
    )
    for along in np.linspace(-0.5 + 1.1 * radius, 0.5 - 1.1 * radius, 60):
        for start, towards in (((along, -2.0), (0.0, 1.0)), ((2.0, along), (-1.0, 0.0))):
            place = tube.ray_cast(Vector((*start, 0.0)), Vector((*towards, 0.0)))[0]
            assert off_square([place]) == pytest.approx(radius, rel=0.06)


@pytest.mark.parametrize("output", ["STICKY", "CURVE"])
def test_updates_keep_the_points_beside_corners(plane, output):
    curve = draw(corners="0, 1, 2, 3", spline="EVEN", radius=0.03, output=output)
    for _ in range(2):
        points = scenes.evaluated_points(curve) if output == "STICKY" else scenes.points(curve)
        for place in SQUARE:
            nearest = np.sort(np.linalg.norm(points - place, axis=1))[:3]
            np.testing.assert_allclose(nearest, [0.0, 0.03, 0.03], atol=1e-5)
        assert bpy.ops.nicmm.update_curves(curve=curve.name) == {"FINISHED"}


@pytest.mark.parametrize("output", ["EDGES", "PARTS"])
def test_cuts(plane, output):
    draw(corners="0, 1, 2, 3", output=output, parts_as="OBJECTS")
    vertices = scenes.positions(plane)
    assert all(is_passed(vertices, place) for place in SQUARE)
    if output == "EDGES":
        cut = [vertex.index for vertex in plane.data.vertices if vertex.select]
        assert off_square(vertices[cut]) < STRAIGHT
    else:
        (part,) = [each for each in bpy.data.objects if each != plane]
        area = sum(face.area for face in part.data.polygons)
        assert area == pytest.approx(1.0, abs=4 * STRAIGHT)


# Which points are meant.


def test_corners_are_given_points_in_any_order(plane):
    crossed = ", ".join(" ".join(map(str, SQUARE[k])) for k in (0, 2, 1, 3))
    curve = draw(points=crossed, order="SHORTEST", corners="1")
    (place,) = controls(curve)[np.flatnonzero(corners(curve))]
    np.testing.assert_allclose(place, SQUARE[2], atol=ROUNDING)


@pytest.mark.parametrize("recorded", [True, False])
def test_corners_among_selected_vertices(plane, recorded):
    """They are counted in the order of selection; without this order, by ascending index."""
    vertices = scenes.nearest_vertices(plane, SQUARE)
    vertices = [vertices[k] for k in (3, 2, 1, 0)]
    scenes.select(plane, vertices, vertices if recorded else [])
    assert bpy.ops.nicmm.design_curve(corners="0") == {"FINISHED"}
    curve = bpy.context.active_object
    (place,) = controls(curve)[np.flatnonzero(corners(curve))]
    meant = vertices[0] if recorded else min(vertices)
    assert min(vertices) != vertices[0]
    np.testing.assert_allclose(place, scenes.positions(plane)[meant], atol=ROUNDING)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("0, 4", 'The corner "4" is not the index of a control point, 0 to 3'),
        ("-1", 'The corner "-1" is not the index'),
        ("0; 2", 'The corner "0; 2" is not the index'),
        ("0,", 'The corner "" is not the index'),
    ],
)
def test_what_is_no_index_is_refused(plane, given, message):
    assert message in refusal("design_curve", points=TEXT, corners=given)
    assert not scenes.curves()


def test_other_methods_have_no_corners(plane):
    message = refusal("design_curve", points=TEXT, corners="0", method="VARIATIONAL")
    assert 'needs the method "elastic"' in message


@pytest.mark.slow
def test_other_courses_have_the_same_corners(empty_scene):
    bpy.ops.mesh.primitive_torus_add(major_segments=24, minor_segments=12)
    places = [(1.25, 0.0, 0.0), (0.0, 1.25, 0.0), (-1.25, 0.0, 0.0)]
    points = ", ".join(map(str, scenes.nearest_vertices(bpy.context.active_object, places)))
    draw(points=points, alternatives=2, corners="0, 2")
    drawn = scenes.curves()
    assert len(drawn) > 1
    assert [corners(each) for each in drawn] == [[1, 0, 1]] * len(drawn)
    before = scenes.points(bpy.context.active_object)
    assert bpy.ops.nicmm.next_course() == {"FINISHED"}
    changed = bpy.context.active_object
    assert corners(changed) == [1, 0, 1]
    assert scenes.distances_to(before, scenes.points(changed)).max() > 0.1


# Changes of a curve.


def test_toggling_is_one_undo_step(plane):
    curve = draw()
    name = curve.name
    before = content()
    assert off_square(scenes.points(curve)) > 0.05
    states = [before]
    for number in range(4):
        call("toggle_corner", index=number)
        states.append(content())
    curve = bpy.data.objects[name]
    assert corners(curve) == [1, 1, 1, 1]
    assert off_square(scenes.points(curve)) < STRAIGHT
    undo_and_redo(states)
    call("toggle_corner", index=1)
    assert corners(bpy.data.objects[name]) == [1, 0, 1, 1]


def test_toggling_off_gives_the_smooth_curve_back(plane):
    smooth = draw()
    before = scenes.points(smooth)
    for _ in range(2):
        call("toggle_corner", index=2)
    assert scenes.distances_to(before, scenes.points(smooth)).max() < 0.04


def test_a_point_that_does_not_exist(square):
    assert "There is no control point 4" in refusal("toggle_corner", index=4)


@pytest.mark.parametrize("mode", ["SCULPT", "WEIGHT_PAINT"])
def test_in_modes_of_painting(square, plane, mode):
    bpy.context.view_layer.objects.active = plane
    bpy.ops.object.mode_set(mode=mode)
    call("toggle_corner", index=0)
    assert corners(square) == [0, 1, 1, 1]


@pytest.mark.slow
def test_points_keep_their_corners(square):
    call("toggle_corner", index=3)
    assert corners(square) == [1, 1, 1, 0]
    call("move_point", index=0, position=(-0.55, -0.5, 0.0))
    assert corners(square) == [1, 1, 1, 0]
    call("insert_point", index=1, position=(0.0, -0.5, 0.0))
    assert corners(square) == [1, 0, 1, 1, 0]
    call("remove_point", index=0)
    assert corners(square) == [0, 1, 1, 0]
    call("add_point", position=(-0.5, 0.0, 0.0))
    assert corners(square) == [0, 1, 1, 0, 0]


@pytest.mark.parametrize("name", ["closed", "smoothness", "normal_bending", "use_modifiers"])
def test_changes_of_settings_keep_corners(square, name):
    before = getattr(square.nicmm_settings, name)
    setattr(square.nicmm_settings, name, 0.5 if isinstance(before, float) else not before)
    assert getattr(square.nicmm_settings, name) != before
    assert corners(square) == [1, 1, 1, 1]
    setattr(square.nicmm_settings, name, before)
    assert corners(square) == [1, 1, 1, 1]
    assert off_square(scenes.points(square)) < STRAIGHT


def test_a_change_of_the_spline_keeps_corners(square):
    square.nicmm_settings.spline = "BEZIER"
    points = square.data.splines[0].bezier_points
    assert {point.handle_left_type for point in points} == {"FREE"}
    assert corners(square) == [1, 1, 1, 1]


def test_updates_keep_corners(square, plane):
    for vertex in plane.data.vertices:
        vertex.co.z = 0.1 * vertex.co.x
    assert bpy.ops.nicmm.update_curves(curve=square.name) == {"FINISHED"}
    assert corners(square) == [1, 1, 1, 1]
    points = scenes.points(square)
    assert off_square(points) < 0.01
    np.testing.assert_allclose(points[:, 2], 0.1 * points[:, 0], atol=ROUNDING)


@pytest.mark.slow
def test_another_method_forgets_corners(square, plane):
    bpy.context.scene.nicmm_curves.method = "VARIATIONAL"
    assert bpy.ops.nicmm.update_curves(curve=square.name, use_panel=True) == {"FINISHED"}
    assert square["nicmm_curve"]["asked"]["method"] == "VARIATIONAL"
    assert corners(square) == [0, 0, 0, 0]


@pytest.mark.parametrize("output", ["CURVE", "STICKY"])
def test_conversions_and_copies_keep_corners(square, output):
    call("toggle_corner", index=1)
    copy = square.copy()
    copy.data = square.data.copy()
    bpy.context.collection.objects.link(copy)
    assert corners(copy) == [1, 0, 1, 1]
    assert bpy.ops.nicmm.convert_curve(output=output, spline="BEZIER") == {"FINISHED"}
    converted = bpy.context.active_object
    assert corners(converted) == [1, 0, 1, 1]
    if output == "CURVE":
        points = converted.data.splines[0].bezier_points
        assert sum(point.handle_left_type == "FREE" for point in points) == 3
    call("move_point", index=0, position=(-0.55, -0.5, 0.0), curve=copy.name)
    assert corners(copy) == [1, 0, 1, 1]


def test_files_keep_corners(square, tmp_path):
    path = str(tmp_path / "square.blend")
    name = square.name
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    assert corners(bpy.data.objects[name]) == [1, 1, 1, 1]
    call("toggle_corner", index=1)
    assert corners(bpy.data.objects[name]) == [1, 0, 1, 1]


@pytest.mark.parametrize("damaged", [[1, 1], [0, 1, 2, 0], [0.5, 0, 0, 0], "yes", [-1, 0, 0, 0]])
def test_damaged_corners_are_refused(square, damaged):
    square["nicmm_curve"]["corner_points"] = damaged
    assert "is damaged: corner_points" in refusal("toggle_corner", index=0)


# Setting all points.


def as_points(places):
    return [{"name": "", "position": tuple(place)} for place in places]


@pytest.mark.slow
def test_edit_curve(plane):
    assert bpy.ops.nicmm.edit_curve(points=as_points(SQUARE), corners="0, 2") == {"FINISHED"}
    curve = bpy.context.active_object
    assert corners(curve) == [1, 0, 1, 0]
    # Other settings leave them as they are, a new list of points has none.
    assert bpy.ops.nicmm.edit_curve(smoothness=2.0) == {"FINISHED"}
    assert corners(curve) == [1, 0, 1, 0]
    assert bpy.ops.nicmm.edit_curve(corners="1") == {"FINISHED"}
    assert corners(curve) == [0, 1, 0, 0]
    assert bpy.ops.nicmm.edit_curve(corners="") == {"FINISHED"}
    assert corners(curve) == [0, 0, 0, 0]
    assert bpy.ops.nicmm.edit_curve(corners="0, 1, 2, 3") == {"FINISHED"}
    assert off_square(scenes.points(curve)) < STRAIGHT
    assert bpy.ops.nicmm.edit_curve(points=as_points(SQUARE)) == {"FINISHED"}
    assert corners(curve) == [0, 0, 0, 0]
    assert "The corner" in refusal("edit_curve", corners="9")


# The command line and the tool.


def test_command_line(plane, empty_scene, tmp_path):
    before, after = tmp_path / "in.blend", tmp_path / "out.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(before))
    main = import_module(f"{empty_scene.name}.nicmm_blender.command_line").main
    arguments = ["--file", str(before), "--output-file", str(after), "--points", TEXT]
    assert main([*arguments, "--corners", "0,2", "--normal-bending", "0.5"]) == 0
    bpy.ops.wm.open_mainfile(filepath=str(after))
    (curve,) = scenes.curves()
    assert corners(curve) == [1, 0, 1, 0]
    assert curve["nicmm_curve"]["asked"]["normal_bending"] == 0.5


KEYMAPS = {
    "Window",
    "Screen",
    "Screen Editing",
    "Frames",
    "Animation",
    "3D View",
    "3D View Generic",
    "Object Mode",
    "Object Non-modal",
    "Sculpt",
    "Weight Paint",
    "Paint Face Mask (Weight, Vertex, Texture)",
    "Paint Vertex Selection (Weight, Vertex)",
    "Grease Pencil",
}
"""Blender's keymaps that take events in a 3D viewport in the modes of the tool."""


def test_blender_does_not_use_the_key(empty_scene):
    toolbar = module(empty_scene, "tool.toolbar")
    (key,) = [event["type"] for name, event, _ in toolbar.KEYMAP if name == "nicmm.toggle_corner"]
    folder = bpy.utils.system_resource("SCRIPTS", path="presets/keyconfig/keymap_data")
    path = os.path.join(folder, "blender_default.py")
    used = {}
    for name, _, items in runpy.run_path(path)["generate_keymaps"]():
        for operator, event, _ in items["items"] if name in KEYMAPS else ():
            modifiers = {"ctrl", "shift", "alt", "oskey"} & {each for each in event if event[each]}
            if not modifiers:
                used.setdefault(event["type"], []).append((name, operator))
    assert ("Object Mode", "transform.translate") in used["G"]
    assert key not in used


# Normal bending.


def test_normal_bending_takes_effect_immediately(empty_scene):
    """On a bump the curve goes round it, the more the greater the weight."""
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=40, y_subdivisions=40, size=2.0)
    bump = bpy.context.active_object
    for vertex in bump.data.vertices:
        vertex.co.z = 0.3 * np.exp(-12.0 * ((vertex.co.y - 0.08) ** 2 + vertex.co.x**2))
    ends = scenes.nearest_vertices(bump, [(-0.8, 0.0, 0.0), (0.8, 0.0, 0.0)])
    curve = draw(points=", ".join(map(str, ends)), closed=False)
    flat = scenes.points(curve)
    curve.nicmm_settings.normal_bending = 1.0
    assert curve["nicmm_curve"]["asked"]["normal_bending"] == 1.0
    assert scenes.points(curve)[:, 2].max() < flat[:, 2].max() - 0.01
