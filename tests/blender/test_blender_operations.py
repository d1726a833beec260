"""Blender's own operators on a mesh or its curves: what stays, and which errors are raised."""

import bpy
import numpy as np
import pytest

from tests.blender import scenes
from tests.blender.scenes import module
from tests.blender.test_shown_surface import curve_deviation, in_world

pytestmark = pytest.mark.usefixtures("remembered_designs")

SINGLE = 1e-6
"""Rounding of single precision, in diagonals."""


def grid():
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=20, y_subdivisions=20)
    return bpy.context.active_object


def design(mesh_object, points, **settings):
    scenes.activate(mesh_object)
    assert bpy.ops.nicmm.design_curve(points=points, spline="EXACT", **settings) == {"FINISHED"}
    return bpy.context.active_object


def update(curve):
    scenes.activate(curve)
    assert bpy.ops.nicmm.update_curves() == {"FINISHED"}


def control_positions(curve):
    return np.array(curve["nicmm_curve"]["control_positions"]).reshape(-1, 3)


def edit(mesh_object, operator, **arguments):
    scenes.activate(mesh_object)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    operator(**arguments)
    bpy.ops.object.mode_set(mode="OBJECT")


class TestNumbering:
    """Control points stay in place when vertices get other indices."""

    @pytest.mark.slow
    def test_separate_parts_beside_another_curve(self, empty_scene, capfd):
        mesh_object = grid()
        kept = design(mesh_object, "200, 212, 110")
        other = design(mesh_object, "22, 24, 66, 64")
        before = control_positions(kept)
        scenes.activate(other)
        bpy.ops.nicmm.convert_curve(output="PARTS", parts_as="OBJECTS")
        scenes.activate(kept)
        with pytest.raises(RuntimeError, match="no longer exist"):
            bpy.ops.nicmm.convert_curve(output="CURVE")
        update(kept)
        np.testing.assert_allclose(control_positions(kept), before, atol=1e-5)
        assert "3 control points moved to the nearest positions" in capfd.readouterr().out
        assert curve_deviation(kept, kept.parent) < SINGLE

    @pytest.mark.slow
    def test_sorted_vertices(self, empty_scene):
        bpy.ops.mesh.primitive_uv_sphere_add()
        mesh_object = bpy.context.active_object
        curve = design(mesh_object, "100, 220, 330")
        before = control_positions(curve)
        edit(mesh_object, bpy.ops.mesh.sort_elements, type="REVERSE", elements={"VERT"})
        update(curve)
        np.testing.assert_allclose(control_positions(curve), before, atol=1e-5)

    def test_turned_normals_change_no_index(self, empty_scene, capfd):
        """Even on a symmetric mesh that was deformed as well."""
        bpy.ops.mesh.primitive_uv_sphere_add()
        mesh_object = bpy.context.active_object
        curve = design(mesh_object, "100, 220, 330")
        before = control_positions(curve)
        edit(mesh_object, bpy.ops.mesh.flip_normals)
        mesh_object.data.transform(np.diag([-1.0, 1.0, 1.0, 1.0]))
        mesh_object.data.update()
        update(curve)
        np.testing.assert_allclose(control_positions(curve), before * [-1, 1, 1], atol=1e-5)
        assert "nearest" not in capfd.readouterr().out

    def test_a_deformed_mesh_with_new_faces(self, empty_scene, capfd):
        ball = scenes.sphere()
        curve = design(ball, "0, 40, 90")
        bpy.ops.mesh.primitive_cube_add(location=(4, 0, 0))
        bpy.context.active_object.select_set(True)
        bpy.context.view_layer.objects.active = ball
        ball.select_set(True)
        bpy.ops.object.join()
        before = control_positions(curve)
        ball.data.transform(np.diag([1.5, 1.5, 1.5, 1.0]))
        ball.data.update()
        update(curve)
        np.testing.assert_allclose(control_positions(curve), 1.5 * before, atol=1e-5)
        assert "nearest" not in capfd.readouterr().out


class TestPlace:
    """A curve stays on the surface, with its radius, when the mesh gets another transform."""

    @pytest.mark.parametrize("output", ["CURVE", "STICKY"])
    @pytest.mark.parametrize("change", ["origin", "scale", "rotation"])
    def test_the_tube_stays_round(self, empty_scene, change, output):
        ball = scenes.sphere()
        ball.location, ball.rotation_euler = (1, 2, 3), (0.3, 0.4, 0.5)
        bpy.context.view_layer.update()
        curve = design(ball, "0, 40, 90", radius=0.02, output=output)
        bpy.ops.object.select_all(action="DESELECT")
        scenes.activate(ball)
        if change == "origin":
            bpy.ops.object.origin_set(type="ORIGIN_CURSOR")
        else:
            wanted = {"location": False, "rotation": False, "scale": False, change: True}
            bpy.ops.object.transform_apply(**wanted)
        ball.scale.y *= 3
        bpy.context.view_layer.update()
        update(curve)
        assert curve_deviation(curve, ball) < SINGLE
        assert radius_in_scene(curve) == pytest.approx(0.02 * 3 ** (1 / 3), rel=1e-3)

    def test_transforms_of_mesh_and_curve_applied_together(self, empty_scene):
        """Blender then puts the scale of a curve object into the radii of its points."""
        ball = scenes.sphere()
        ball.scale = (2, 2, 2)
        bpy.context.view_layer.update()
        curve = design(ball, "0, 40, 90", radius=0.02)
        bpy.ops.object.select_all(action="SELECT")
        bpy.ops.object.transform_apply()
        bpy.context.view_layer.update()
        assert curve.nicmm_settings.radius == pytest.approx(0.02, rel=1e-4)
        curve.nicmm_settings.radius = 0.05
        assert radius_in_scene(curve) == pytest.approx(0.05, rel=1e-4)
        update(curve)
        assert radius_in_scene(curve) == pytest.approx(0.05, rel=1e-4)

    @pytest.mark.parametrize("output", ["CURVE", "STICKY"])
    def test_a_curve_without_points_keeps_its_radius(self, empty_scene, output):
        """Also if the tube had been thickened in Edit Mode."""
        ball = scenes.sphere()
        curve = design(ball, "0, 40", closed=False, radius=0.02, output=output)
        if output == "CURVE":
            points = curve.data.splines[0].points
            points.foreach_set("radius", np.full(len(points), 3.0, dtype=np.float32))
        radius = radius_in_scene(curve)
        scenes.activate(curve)
        assert bpy.ops.nicmm.remove_point(index=0) == {"FINISHED"}
        assert curve.nicmm_settings.radius == pytest.approx(radius, rel=1e-4)
        position = np.array([vertex.co for vertex in ball.data.vertices])[90]
        assert bpy.ops.nicmm.add_point(position=position) == {"FINISHED"}
        assert radius_in_scene(curve) == pytest.approx(radius, rel=1e-4)

    @pytest.mark.slow
    @pytest.mark.parametrize("kind", ["DECIMATE", "WELD"])
    def test_control_points_under_modifiers_that_move_corners(self, empty_scene, kind):
        """A face that such a modifier keeps may be elsewhere."""
        ball = scenes.sphere(4)
        modifier = ball.modifiers.new("Collapse", kind)
        name, values = {"DECIMATE": ("ratio", (0.5, 0.2)), "WELD": ("merge_threshold", (0.1, 0.2))}[
            kind
        ]
        setattr(modifier, name, values[0])
        curve = design(ball, "0, 40, 90")
        before = control_positions(curve)
        setattr(modifier, name, values[1])
        bpy.context.view_layer.update()
        update(curve)
        assert np.linalg.norm(control_positions(curve) - before, axis=1).max() < 0.3
        assert curve_deviation(curve, ball) < 1e-5

    @pytest.mark.parametrize("output", ["CURVE", "STICKY"])
    @pytest.mark.parametrize("scale", [(2.0, 2.0, 2.0), (1.0, 0.5, 2.0), (-1.0, 1.0, 1.0)])
    def test_applied_transforms(self, empty_scene, scale, output):
        """Blender compensates for applied transforms of the mesh by transforms of its children."""
        ball = scenes.sphere()
        ball.location, ball.rotation_euler, ball.scale = (1, 2, 3), (0.3, 0.4, 0.5), scale
        bpy.context.view_layer.update()
        curve = design(ball, "0, 40, 90", radius=0.02, output=output)
        expected = in_world(curve)
        assert radius_in_scene(curve) == pytest.approx(0.02, rel=1e-4)
        bpy.ops.object.select_all(action="DESELECT")
        scenes.activate(ball)
        bpy.ops.object.transform_apply(location=True, rotation=True, scale=True)
        np.testing.assert_allclose(in_world(curve), expected, atol=1e-4)
        update(curve)
        assert curve_deviation(curve, ball) < SINGLE
        assert radius_in_scene(curve) == pytest.approx(0.02, rel=1e-4)


def radius_in_scene(curve):
    """The radius of a tube in the scene, from the attributes that Blender draws."""
    bpy.context.view_layer.update()
    if curve.type == "CURVES":
        local = scenes.get(curve.data.attributes["radius"].data, "value", 1).max()
    else:
        (spline,) = curve.data.splines
        local = curve.data.bevel_depth * scenes.get(spline.points, "radius").max()
    scale = np.abs(np.array(curve.matrix_world.to_scale()))
    np.testing.assert_allclose(scale, scale.mean(), rtol=1e-4)  # the tube is round
    return float(local * scale.mean())


class TestRefusals:
    """What an update would destroy or could not show raises an error."""

    def test_splines_that_were_not_designed(self, empty_scene):
        ball = scenes.sphere()
        first, second = design(ball, "0, 40, 90"), design(ball, "0, 30, 80")
        bpy.ops.object.select_all(action="DESELECT")
        second.select_set(True)
        first.select_set(True)
        bpy.context.view_layer.objects.active = first
        bpy.ops.object.join()
        with pytest.raises(RuntimeError, match="splines that were not designed"):
            bpy.ops.nicmm.update_curves()
        assert len(first.data.splines) == 2

    def test_shape_keys_of_a_curve(self, empty_scene):
        design(scenes.sphere(), "0, 40, 90")
        bpy.ops.object.shape_key_add()
        with pytest.raises(RuntimeError, match="has shape keys"):
            bpy.ops.nicmm.update_curves()

    @pytest.mark.slow
    def test_a_setting_does_not_drop_a_renamed_map(self, empty_scene):
        ball = scenes.sphere()
        group = ball.vertex_groups.new(name="Wall")
        group.add([20], 1.0, "REPLACE")
        curve = design(ball, "0, 40, 90", obstacle_group="Wall")
        group.name = "Fence"
        curve.nicmm_settings.smoothness = 0.5
        assert curve.nicmm_settings.obstacle_group == "Wall"
        problem = module(empty_scene, "operators.curve_settings").problem_of(curve)
        assert 'no vertex group "Wall". Choose one of "Fence"' in problem
        curve.nicmm_settings.obstacle_group = "Fence"
        curve.nicmm_settings.smoothness = 0.5
        assert curve.nicmm_settings.smoothness == 0.5

    @pytest.mark.slow
    def test_a_map_that_no_longer_exists_can_be_cleared(self, empty_scene):
        ball = scenes.sphere()
        group = ball.vertex_groups.new(name="Wall")
        group.add([20], 1.0, "REPLACE")
        curve = design(ball, "0, 40, 90", obstacle_group="Wall")
        ball.vertex_groups.remove(group)
        curve.nicmm_settings.obstacle_group = ""
        assert curve.nicmm_settings.obstacle_group == ""
        problem = module(empty_scene, "operators.curve_settings").problem_of(curve)
        assert not problem

    @pytest.mark.parametrize("name", ["smoothness", "clearance", "offset", "radius"])
    def test_settings_that_are_not_finite(self, empty_scene, name):
        """Blender limits infinite values to those of the property, but passes on NaN."""
        ball = scenes.sphere()
        with pytest.raises(RuntimeError, match=f"{name.capitalize()} is nan"):
            design(ball, "0, 40, 90", **{name: float("nan")})
        assert not scenes.curves()

    def test_a_mesh_in_an_excluded_collection(self, empty_scene):
        ball = scenes.sphere()
        curve = design(ball, "0, 40, 90")
        collection = bpy.data.collections.new("Hidden")
        bpy.context.scene.collection.children.link(collection)
        for found in ball.users_collection:
            found.objects.unlink(ball)
        collection.objects.link(ball)
        bpy.context.view_layer.layer_collection.children["Hidden"].exclude = True
        scenes.activate(curve)
        with pytest.raises(RuntimeError, match="excluded from this view layer"):
            bpy.ops.nicmm.convert_curve(output="STICKY")


def test_parts_of_a_rigid_body(empty_scene):
    """A copy of a rigid body joins the collection of the simulation by itself."""
    ball = scenes.sphere()
    bpy.ops.rigidbody.object_add()
    faces = len(ball.data.polygons)
    curve = design(ball, ", ".join(map(str, scenes.ring(ball, 4))))
    physics = bpy.context.scene.rigidbody_world.collection
    assert curve.name not in physics.objects
    bpy.ops.nicmm.convert_curve(output="PARTS", parts_as="OBJECTS")
    parts = [each for each in bpy.context.view_layer.objects if each.type == "MESH"]
    assert len(parts) == 2
    assert sum(len(part.data.polygons) for part in parts) > faces
