"""Curves from strokes and along features, in the installed extension."""

from importlib import import_module

import bpy
import numpy as np
import pytest

from mathutils import Matrix, Vector

from tests.blender import scenes

pytestmark = pytest.mark.usefixtures("remembered_designs")


@pytest.fixture
def ball(empty_scene):
    return scenes.sphere(4)


def on_ball(angles, heights):
    """Positions on the unit sphere."""
    radius = np.sqrt(1.0 - heights**2)
    return np.stack([radius * np.cos(angles), radius * np.sin(angles), heights], axis=1)


def as_points(positions):
    return [{"name": "", "position": tuple(place)} for place in positions]


def control_points(extension, curve):
    """Positions of the control points of a curve."""
    record = scenes.module(extension, "scene.curve_record")
    surface = record.surface_of(curve, curve.parent)
    points, _ = record.read_control_points(curve, surface)
    return surface.points(points.faces, points.barycentric)


@pytest.mark.slow
@pytest.mark.parametrize("closed", [False, True])
def test_a_stroke_becomes_a_curve_with_few_points(extension, ball, closed):
    angles = np.linspace(0.0, 6.2 if closed else 3.0, 200)
    stroke = on_ball(angles, 0.3 * np.sin(2.0 * angles))
    assert bpy.ops.nicmm.stroke_curve(points=as_points(stroke), tolerance=0.06, closed=closed) == {
        "FINISHED"
    }
    curve = bpy.context.active_object
    assert curve is not ball and curve.data.splines[0].use_cyclic_u == closed
    assert scenes.distances_to(stroke, scenes.points(curve)).max() < 0.08
    assert 3 <= len(control_points(extension, curve)) <= 20


@pytest.mark.slow
def test_the_curve_of_a_stroke_is_not_designed_twice(extension, ball, monkeypatch):
    """The fit has designed it already."""
    designer = import_module(f"{extension.name}.nicmm_core.surface_designer").SurfaceDesigner
    requests, design = [], designer.design

    def spy(self, request, *given):
        requests.append(request)
        return design(self, request, *given)

    monkeypatch.setattr(designer, "design", spy)
    fit, fitted = extension.core.Designer.fit_stroke, []

    def fit_and_count(self, *given, **named):
        points = fit(self, *given, **named)
        fitted.append(len(requests))
        return points

    monkeypatch.setattr(extension.core.Designer, "fit_stroke", fit_and_count)
    angles = np.linspace(0.0, 3.0, 100)
    stroke = on_ball(angles, 0.3 * np.sin(2.0 * angles))
    assert bpy.ops.nicmm.stroke_curve(points=as_points(stroke), tolerance=0.06) == {"FINISHED"}
    assert fitted == [len(requests)]


@pytest.mark.slow
def test_a_stroke_redraws_a_stretch_and_nothing_else(extension, ball):
    vertices = scenes.ring(ball, 8)
    scenes.select(ball, vertices)
    assert bpy.ops.nicmm.design_curve(order="GIVEN") == {"FINISHED"}
    curve = bpy.context.active_object
    before = control_points(extension, curve)
    angles = np.linspace(0.3, 2.0, 80)
    bump = 0.4 * np.sin((angles - 0.3) / 1.7 * np.pi)
    stroke = on_ball(angles, bump)
    assert bpy.ops.nicmm.stroke_curve(points=as_points(stroke), tolerance=0.06, redraw=True) == {
        "FINISHED"
    }
    after = control_points(extension, curve)
    kept = scenes.distances_to(before, after) < 1e-6
    gone = np.arctan2(before[:, 1], before[:, 0])
    assert (kept == ~((gone > 0.3) & (gone < 2.0))).all()
    line = scenes.points(curve)
    assert line[:, 2].max() > 0.33
    assert len(scenes.curves()) == 1


def test_a_stroke_off_the_surface_is_an_error(ball):
    with pytest.raises(RuntimeError, match="off the surface"):
        bpy.ops.nicmm.stroke_curve(points=as_points([(3, 0, 0), (0, 3, 0)]), tolerance=0.1)
    assert not scenes.curves()


@pytest.mark.slow
def test_a_curve_along_the_edge_of_a_cylinder(extension, empty_scene):
    bpy.ops.mesh.primitive_cylinder_add(vertices=64, radius=1.0, depth=1.0)
    body = bpy.context.active_object
    assert bpy.ops.nicmm.feature_curve(position=(0.99, 0.05, 0.5), reach=0.2) == {"FINISHED"}
    curve = bpy.context.active_object
    assert curve is not body and curve.data.splines[0].use_cyclic_u
    line = scenes.points(curve)
    np.testing.assert_allclose(line[:, 2], 0.5, atol=0.03)
    np.testing.assert_allclose(np.linalg.norm(line[:, :2], axis=1), 1.0, atol=0.03)
    assert len(control_points(extension, curve)) < 30


@pytest.mark.slow
def test_a_curve_along_the_rim_of_a_map(empty_scene):
    ball = scenes.sphere(5)
    group = ball.vertex_groups.new(name="Cap")
    for vertex in ball.data.vertices:
        if vertex.co.z > 0.5:
            group.add([vertex.index], 1.0, "REPLACE")
    bpy.context.scene.nicmm_curves.alignment_group = "Cap"
    place = scenes.positions(ball)[scenes.nearest_vertices(ball, [(0.866, 0.0, 0.5)])[0]]
    assert bpy.ops.nicmm.feature_curve(position=place, use_map=True) == {"FINISHED"}
    np.testing.assert_allclose(scenes.points(bpy.context.active_object)[:, 2], 0.53, atol=0.1)


def test_a_smooth_surface_has_no_feature(ball):
    with pytest.raises(RuntimeError, match="no sharp edge"):
        bpy.ops.nicmm.feature_curve(position=(1.0, 0.0, 0.0))
    assert not scenes.curves()


def test_the_tool_has_an_action(extension, ball):
    settings = bpy.context.scene.nicmm_curves
    assert settings.tool_action == "POINTS"
    draw = scenes.module(extension, "tool.draw_operator")
    picking = scenes.module(extension, "tool.picking")
    hit = picking.Hit(picking.Kind.SURFACE, "", 0, (1.0, 0.0, 0.0), ball.session_uid)
    assert draw._call_of_action("POINTS", hit) is None
    assert draw._call_of_action("FREEHAND", hit) is not None
    assert draw._call_of_action("FEATURE", hit)[1] == {"position": (1.0, 0.0, 0.0)}


@pytest.fixture
def circle(ball):
    """A Bézier circle around the ball, selected with the ball, which is active."""
    bpy.ops.curve.primitive_bezier_circle_add(radius=1.0)
    made = bpy.context.active_object
    made.data.bevel_depth = 0.1
    ball.select_set(True)
    bpy.context.view_layer.objects.active = ball
    return made


def test_a_curve_object_becomes_a_designed_curve(circle):
    assert bpy.ops.nicmm.strokes_to_curves(tolerance=0.05) == {"FINISHED"}
    made = bpy.context.active_object
    assert made is not circle and made.data.splines[0].use_cyclic_u
    line = scenes.points(made)
    np.testing.assert_allclose(line[:, 2], 0.0, atol=0.05)
    assert circle.name in bpy.data.objects
    assert len(bpy.data.curves) == 2  # no copies are left


def test_originals_can_be_removed(circle):
    name = circle.name
    assert bpy.ops.nicmm.strokes_to_curves(tolerance=0.05, keep_original=False) == {"FINISHED"}
    assert name not in bpy.data.objects


def test_curves_far_from_the_mesh_are_reported(circle):
    circle.location.x = 9.0
    bpy.context.view_layer.update()
    with pytest.raises(RuntimeError, match="off the surface"):
        bpy.ops.nicmm.strokes_to_curves(tolerance=0.05)
    assert len(scenes.curves()) == 1


def place_of_layer(layer, kind):
    """Move a layer, and return the matrix from its space to the world."""
    if kind == "plain":
        return Matrix()
    layer.translation = (0.0, 0.0, 3.0)
    if kind == "moved":
        return Matrix.Translation((0.0, 0.0, 3.0))
    parent = bpy.data.objects.new("Parent", None)
    bpy.context.scene.collection.objects.link(parent)
    parent.location = (1.0, 2.0, 0.0)
    layer.parent = parent
    bpy.context.view_layer.update()
    return parent.matrix_world @ layer.matrix_parent_inverse @ layer.matrix_local


@pytest.mark.parametrize("kind", ["plain", "moved", "parented"])
def test_a_grease_pencil_stroke_becomes_a_designed_curve(ball, kind):
    pencil = bpy.data.grease_pencils_v3.new("Pencil")
    drawn = bpy.data.objects.new("Pencil", pencil)
    bpy.context.scene.collection.objects.link(drawn)
    layer = pencil.layers.new("Lines")
    to_layer = place_of_layer(layer, kind).inverted()
    drawing = layer.frames.new(bpy.context.scene.frame_current).drawing
    angles = np.linspace(0.0, 2.5, 60)
    stroke = on_ball(angles, 0.2 * np.sin(angles))
    drawing.add_strokes([len(angles)])
    for point, place in zip(drawing.strokes[0].points, stroke, strict=True):
        point.position = to_layer @ Vector(place)
    scenes.activate(ball)
    drawn.select_set(True)
    assert bpy.ops.nicmm.strokes_to_curves(tolerance=0.05) == {"FINISHED"}
    made = bpy.context.active_object
    assert made.type == "CURVE" and not made.data.splines[0].use_cyclic_u
    assert scenes.distances_to(stroke, scenes.points(made)).max() < 0.08


@pytest.mark.parametrize("cyclic", [False, True])
def test_hair_curves_become_designed_curves(ball, cyclic):
    angles = np.linspace(0.0, 2 * np.pi, 40, endpoint=False)
    hair = bpy.data.hair_curves.new("Hair")
    hair.add_curves([len(angles)])
    places = on_ball(angles, 0.2 * np.sin(angles)).astype(np.float32)
    hair.points.foreach_set("position", places.ravel())
    hair.attributes.new("cyclic", "BOOLEAN", "CURVE").data[0].value = cyclic
    drawn = bpy.data.objects.new("Hair", hair)
    bpy.context.scene.collection.objects.link(drawn)
    scenes.activate(ball)
    drawn.select_set(True)
    assert bpy.ops.nicmm.strokes_to_curves(tolerance=0.05) == {"FINISHED"}
    assert bpy.context.active_object.data.splines[0].use_cyclic_u == cyclic


def test_nothing_selected_disables_the_button(ball):
    scenes.activate(ball)
    assert not bpy.ops.nicmm.strokes_to_curves.poll()


def test_the_redo_panel_is_offered(circle):
    assert bpy.ops.nicmm.strokes_to_curves(tolerance=0.05) == {"FINISHED"}
    assert bpy.ops.nicmm.strokes_to_curves.poll()
    with pytest.raises(RuntimeError, match="Select Grease Pencil or curve objects"):
        bpy.ops.nicmm.strokes_to_curves()


def test_a_failure_keeps_the_selection(circle):
    circle.location.x = 9.0
    bpy.context.view_layer.update()
    before = set(bpy.context.selected_objects)
    with pytest.raises(RuntimeError, match="off the surface"):
        bpy.ops.nicmm.strokes_to_curves(tolerance=0.05)
    assert set(bpy.context.selected_objects) == before
