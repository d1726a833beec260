"""Difficult scenes: each results in a curve on the surface, or in a message with the remedy."""

from importlib import import_module

import bpy
import numpy as np
import pytest

import bmesh
from mathutils import Matrix

from tests.blender import scenes
from tests.blender.scenes import module
from tests.blender.test_shown_surface import in_world

pytestmark = pytest.mark.usefixtures("remembered_designs")

OUTPUTS = ("CURVE", "STICKY", "EDGES", "REGION", "PARTS")


def refusal(**arguments):
    """Run the operator, which must fail and leave the file unchanged; return its report."""
    before = [(found.name, found.data) for found in bpy.data.objects], bpy.context.mode
    with pytest.raises(RuntimeError) as caught:
        bpy.ops.nicmm.design_curve(spline="EXACT", **arguments)
    assert before == ([(found.name, found.data) for found in bpy.data.objects], bpy.context.mode)
    return str(caught.value)


def assert_on_surface(core, curve, mesh_object):
    """Assert that the points of a curve object lie on the mesh, in its local space."""
    mesh = core.Mesh(scenes.positions(mesh_object), scenes.triangles(mesh_object))
    surface_points = import_module(f"{core.__name__}.geometry.surface_points")
    _, distance = surface_points.nearest_points(mesh, scenes.points(curve))
    assert distance.max() < 1e-6 * mesh.diagonal
    assert len(distance) > 10


def new_mesh(name, vertices, faces):
    data = bpy.data.meshes.new(name)
    data.from_pydata(vertices, [], faces)
    made = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(made)
    scenes.activate(made)
    return made


def test_nothing_to_draw_on(empty_scene):
    assert "Make a mesh object active" in refusal()
    bpy.ops.object.empty_add()
    assert "Make a mesh object active" in refusal()
    bpy.ops.curve.primitive_bezier_circle_add()
    assert "Make a mesh object active" in refusal()
    new_mesh("Nothing", [], [])
    assert 'No vertex of "Nothing" is selected' in refusal()
    assert "Vertex 0 is out of range; the mesh has 0 vertices" in refusal(points="0, 1, 2")


def test_vertices_without_faces(empty_scene):
    cloud = new_mesh("Cloud", [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], [])
    scenes.select(cloud, [0, 1, 2])
    assert "face" in refusal()
    loose = new_mesh("Loose", [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], [(0, 1, 2)])
    scenes.select(loose, [0, 1, 3])
    assert "no face uses" in refusal()


def test_nothing_selected_in_edit_mode(empty_scene):
    sphere = scenes.sphere()
    scenes.select(sphere, [])
    bpy.ops.object.mode_set(mode="EDIT")
    assert "select the vertices" in refusal()


@pytest.mark.parametrize("hide", ["hide_set", "hide_viewport", "collection"])
def test_hidden_objects(empty_scene, hide):
    sphere = scenes.sphere()
    scenes.select(sphere, scenes.ring(sphere, 4))
    if hide == "hide_set":
        sphere.hide_set(True)
    elif hide == "hide_viewport":
        sphere.hide_viewport = True
    else:
        collection = bpy.data.collections.new("Hidden")
        bpy.context.scene.collection.children.link(collection)
        for other in list(sphere.users_collection):
            other.objects.unlink(sphere)
        collection.objects.link(sphere)
        collection.hide_viewport = True
    bpy.context.view_layer.objects.active = sphere
    if bpy.context.active_object is None:
        assert "Make a mesh object active" in refusal()
    else:
        assert bpy.ops.nicmm.design_curve(spline="EXACT") == {"FINISHED"}
        assert_on_surface(empty_scene.core, scenes.curves()[0], sphere)


@pytest.mark.parametrize("output", OUTPUTS)
def test_hidden_faces_are_part_of_the_surface(empty_scene, output):
    sphere = scenes.sphere()
    vertices = scenes.ring(sphere, 4)
    bpy.ops.object.mode_set(mode="EDIT")
    edited = bmesh.from_edit_mesh(sphere.data)
    for face in edited.faces:
        face.hide_set(face.calc_center_median().z > 0.5)
    bmesh.update_edit_mesh(sphere.data)
    points = ", ".join(map(str, vertices))
    assert bpy.ops.nicmm.design_curve(spline="EXACT", output=output, points=points) == {"FINISHED"}
    bpy.ops.object.mode_set(mode="OBJECT")
    assert not sphere.data.validate()
    hidden = [face.center.z for face in sphere.data.polygons if face.hide]
    assert hidden and min(hidden) > 0.3


@pytest.mark.parametrize("output", OUTPUTS)
def test_several_objects_in_edit_mode(empty_scene, output):
    other = scenes.sphere()
    sphere = scenes.sphere()
    other.select_set(True)
    for found in (other, sphere):
        scenes.select(found, scenes.ring(found, 4))
    bpy.context.view_layer.objects.active = sphere
    bpy.ops.object.mode_set(mode="EDIT")
    assert set(bpy.context.objects_in_mode) == {other, sphere}
    other_faces = len(other.data.polygons)
    assert bpy.ops.nicmm.design_curve(spline="EXACT", output=output) == {"FINISHED"}
    assert bpy.context.active_object == sphere
    assert {sphere, other} <= set(bpy.context.objects_in_mode)
    bpy.ops.object.mode_set(mode="OBJECT")
    assert len(other.data.polygons) == other_faces
    assert not sphere.data.validate() and not other.data.validate()


@pytest.mark.parametrize("mode", ["OBJECT", "EDIT"])
def test_shape_keys(empty_scene, mode, capfd):
    sphere = scenes.sphere()
    vertices = scenes.ring(sphere, 4)
    scenes.select(sphere, vertices)
    sphere.shape_key_add(name="Basis")
    key = sphere.shape_key_add(name="Größer")
    for point in key.data:
        point.co *= 2.0
    key.value = 1.0
    bpy.ops.object.mode_set(mode=mode)
    assert bpy.ops.nicmm.design_curve(spline="EXACT", use_modifiers=False) == {"FINISHED"}
    bpy.ops.object.mode_set(mode="OBJECT")
    assert_on_surface(empty_scene.core, scenes.curves()[0], sphere)
    assert "without its shape keys" in capfd.readouterr().out


def test_object_of_another_file(empty_scene, tmp_path):
    sphere = scenes.sphere()
    sphere.name = "Körper"
    vertices = scenes.ring(sphere, 4, height=0.3)
    sphere.vertex_groups.new(name="Cut").add(vertices, 1.0, "REPLACE")
    path = str(tmp_path / "library.blend")
    bpy.data.libraries.write(path, {sphere})
    bpy.data.objects.remove(sphere)
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.objects = ["Körper"]
    (linked,) = wanted.objects
    bpy.context.scene.collection.objects.link(linked)
    bpy.context.view_layer.objects.active = linked
    for output in ("EDGES", "PARTS"):
        assert "is linked from" in refusal(output=output, point_group="Cut")
    assert bpy.ops.nicmm.design_curve(spline="EXACT", point_group="Cut") == {"FINISHED"}
    (curve,) = scenes.curves()
    assert curve.parent == linked and curve.library is None
    assert_on_surface(empty_scene.core, curve, linked)
    before = scenes.points(curve)
    assert bpy.ops.nicmm.update_curves() == {"FINISHED"}
    np.testing.assert_allclose(scenes.points(curve), before, atol=1e-4)


def test_override_of_another_file(empty_scene, tmp_path):
    sphere = scenes.sphere()
    sphere.vertex_groups.new(name="Cut").add(scenes.ring(sphere, 4), 1.0, "REPLACE")
    name = sphere.name
    path = str(tmp_path / "library.blend")
    bpy.data.libraries.write(path, {sphere})
    bpy.data.objects.remove(sphere)
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.objects = [name]
    made = wanted.objects[0].override_create()
    bpy.context.scene.collection.objects.link(made)
    bpy.context.view_layer.objects.active = made
    assert bpy.ops.nicmm.design_curve(spline="EXACT", point_group="Cut") == {"FINISHED"}
    (curve,) = scenes.curves()
    assert_on_surface(empty_scene.core, curve, made)
    scenes.activate(curve)
    made.scale.x = 2.0
    bpy.context.view_layer.update()
    assert bpy.ops.nicmm.update_curves() == {"FINISHED"}
    assert module(empty_scene, "scene.curve_record").mesh_of(curve) == made
    assert_on_surface(empty_scene.core, curve, made)


def test_override_of_a_collection_of_another_file(empty_scene, tmp_path):
    """Objects cannot be added to the override of a collection."""
    sphere = scenes.sphere()
    sphere.vertex_groups.new(name="Cut").add(scenes.ring(sphere, 4), 1.0, "REPLACE")
    collection = bpy.data.collections.new("Character")
    collection.objects.link(sphere)
    path = str(tmp_path / "library.blend")
    bpy.data.libraries.write(path, {collection})
    bpy.data.objects.remove(sphere)
    bpy.data.collections.remove(collection)
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.collections = ["Character"]
    layer = bpy.context.view_layer
    made = wanted.collections[0].override_hierarchy_create(bpy.context.scene, layer)
    (overridden,) = made.objects
    assert overridden.users_collection[0].override_library is not None
    layer.objects.active = overridden
    assert bpy.ops.nicmm.design_curve(spline="EXACT", point_group="Cut") == {"FINISHED"}
    (curve,) = scenes.curves()
    assert list(curve.users_collection) == [bpy.context.scene.collection]
    assert_on_surface(empty_scene.core, curve, overridden)
    scenes.activate(curve)
    assert bpy.ops.nicmm.update_curves() == {"FINISHED"}
    assert module(empty_scene, "scene.curve_record").mesh_of(curve) == overridden


def test_a_linked_duplicate_is_edited_alone(empty_scene):
    sphere = scenes.sphere(4)
    scenes.select(sphere, scenes.ring(sphere, 4))
    bpy.ops.nicmm.design_curve(spline="EXACT")
    first = bpy.context.active_object
    before = scenes.points(first)
    bpy.ops.object.duplicate(linked=True)
    twin = bpy.context.active_object
    assert twin.data == first.data
    bpy.ops.nicmm.move_point(index=0, position=sphere.closest_point_on_mesh((1, 0.3, 0.3))[1])
    assert twin.data != first.data
    np.testing.assert_array_equal(scenes.points(first), before)
    assert len(scenes.points(twin)) != len(before) or not (scenes.points(twin) == before).all()


@pytest.mark.parametrize("scale", [(2.0, 2.0, 2.0), (1.0, 3.0, 0.5)], ids=["even", "uneven"])
@pytest.mark.parametrize("parent", ["none", "empty", "mesh again"])
def test_curves_with_another_parent_stay_on_the_surface(empty_scene, scale, parent):
    sphere = scenes.sphere()
    sphere.location, sphere.rotation_euler, sphere.scale = (1, 2, 3), (0.3, 0.4, 0.5), scale
    scenes.select(sphere, scenes.ring(sphere, 4))
    bpy.context.view_layer.update()
    bpy.ops.nicmm.design_curve(spline="EXACT", radius=0.25)
    curve = bpy.context.active_object
    expected = in_world(curve)
    bpy.ops.object.parent_clear(type="CLEAR_KEEP_TRANSFORM")
    bpy.context.view_layer.update()
    if parent != "none":
        target = sphere
        if parent == "empty":
            target = bpy.data.objects.new("Empty", None)
            bpy.context.scene.collection.objects.link(target)
            target.location, target.rotation_euler = (-4, 5, 6), (1.0, 0.2, 0.1)
            bpy.context.view_layer.update()
        target.select_set(True)
        bpy.context.view_layer.objects.active = target
        assert bpy.ops.object.parent_set(type="OBJECT") == {"FINISHED"}
    scenes.activate(curve)
    np.testing.assert_allclose(in_world(curve), expected, atol=1e-4)
    assert bpy.ops.nicmm.update_curves() == {"FINISHED"}
    # An update may lower the energy a little further.
    np.testing.assert_allclose(in_world(curve), expected, atol=1e-3)
    assert curve.nicmm_settings.radius == pytest.approx(0.25, rel=1e-4)


def test_modifiers_that_change_the_mesh(empty_scene):
    sphere = scenes.sphere()
    vertices = scenes.ring(sphere, 4)
    scenes.select(sphere, vertices)
    sphere.modifiers.new("Subdivision", "SUBSURF")
    sphere.modifiers.new("Mirror", "MIRROR")
    decimate = sphere.modifiers.new("Decimate", "DECIMATE")
    decimate.ratio = 0.2
    assert bpy.ops.nicmm.design_curve(spline="EXACT", use_modifiers=False) == {"FINISHED"}
    assert_on_surface(empty_scene.core, scenes.curves()[0], sphere)


def test_instances(empty_scene):
    sphere = scenes.sphere()
    scenes.select(sphere, scenes.ring(sphere, 4))
    twin = bpy.data.objects.new("Twin", sphere.data)
    bpy.context.scene.collection.objects.link(twin)
    twin.location = (5, 0, 0)
    twin.scale = (1, 1, 2)
    scenes.activate(twin)
    assert bpy.ops.nicmm.design_curve(spline="EXACT") == {"FINISHED"}
    (curve,) = scenes.curves()
    assert curve.parent == twin
    assert_on_surface(empty_scene.core, curve, twin)
    scenes.activate(twin)
    assert "shared by 2 users" in refusal(output="EDGES")
    collection = bpy.data.collections.new("Group")
    collection.objects.link(sphere)
    instance = bpy.data.objects.new("Instance", None)
    instance.instance_type, instance.instance_collection = "COLLECTION", collection
    bpy.context.scene.collection.objects.link(instance)
    scenes.activate(instance)
    assert "Make a mesh object active" in refusal()


@pytest.mark.slow
@pytest.mark.parametrize(
    "matrix",
    [
        Matrix.Diagonal((-1, 1, 1, 1)),
        Matrix.Diagonal((-1, -2, 0.5, 1)),
        Matrix.Diagonal((1e-3, 1e-3, 1e-3, 1)),
        Matrix.Shear("XY", 4, (0.5, 0.2)),
        Matrix.Rotation(1.0, 4, (1, 1, 0)) @ Matrix.Diagonal((1, 4, 1, 1)),
    ],
    ids=["mirrored", "mirrored and stretched", "small", "sheared", "turned and stretched"],
)
@pytest.mark.parametrize("output", ["CURVE", "EDGES"])
def test_transforms(empty_scene, matrix, output):
    core = empty_scene.core
    sphere = scenes.sphere()
    sphere.matrix_world = Matrix.Translation((1, 2, 3)) @ matrix
    bpy.context.view_layer.update()
    vertices = scenes.ring(sphere, 4, height=0.4)
    scenes.select(sphere, vertices)
    place = scenes.positions(sphere) @ np.array(sphere.matrix_world.to_3x3()).T
    expected = scenes.design(core, core.Mesh(place, scenes.triangles(sphere)), vertices)
    assert bpy.ops.nicmm.design_curve(spline="EXACT", output=output) == {"FINISHED"}
    if output == "EDGES":
        assert not sphere.data.validate()
        return
    curve = scenes.curves()[0]
    bpy.context.view_layer.update()
    assert_on_surface(core, curve, sphere)
    found = scenes.points(curve) @ np.array(sphere.matrix_world.to_3x3()).T
    size = np.linalg.norm(np.ptp(place, axis=0))
    assert scenes.distances_to(expected.curves[0].points, found).max() < 5e-3 * size


def test_flat_scale_is_reported(empty_scene):
    sphere = scenes.sphere()
    scenes.select(sphere, scenes.ring(sphere, 4))
    sphere.scale = (1, 1, 0)
    bpy.context.view_layer.update()
    report = refusal()
    assert "scale" in report


@pytest.mark.slow
@pytest.mark.parametrize("output", OUTPUTS)
def test_large_and_bent_faces(empty_scene, output):
    """A star-shaped prism, each end of which is a single non-planar face with sixteen corners."""
    angles = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    radius = np.where(np.arange(16) % 2, 0.6, 1.0)
    rings = [
        np.stack([radius * np.cos(angles), radius * np.sin(angles), z + 0.1 * radius], axis=1)
        for z in (-1.0, 0.0, 1.0)
    ]
    sides = [
        (16 * r + i, 16 * r + (i + 1) % 16, 16 * r + 16 + (i + 1) % 16, 16 * r + 16 + i)
        for r in range(2)
        for i in range(16)
    ]
    faces = [tuple(range(15, -1, -1)), *sides, tuple(range(32, 48))]
    star = new_mesh("Stern", np.concatenate(rings).tolist(), faces)
    scenes.select(star, [36, 20, 12, 28])
    assert bpy.ops.nicmm.design_curve(spline="EXACT", output=output, order="SHORTEST") == {
        "FINISHED"
    }
    assert not star.data.validate()
    if output == "CURVE":
        assert_on_surface(empty_scene.core, scenes.curves()[0], star)


def test_names_in_other_scripts(empty_scene, tmp_path):
    name, group = "身体 Ünï \U0001f419", "Wände/壁"
    sphere = scenes.sphere()
    sphere.name = name
    points = scenes.ring(sphere, 4, height=0.3)
    sphere.vertex_groups.new(name=group).add(
        np.flatnonzero(scenes.positions(sphere)[:, 2] < -0.7).tolist(), 1.0, "REPLACE"
    )
    scenes.select(sphere, points)
    assert bpy.ops.nicmm.design_curve(spline="EXACT", obstacle_group=group) == {"FINISHED"}
    curve = bpy.data.objects[f"{name} Curve"]
    path = str(tmp_path / "日本.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    before = scenes.points(curve)
    bpy.ops.wm.open_mainfile(filepath=path)
    assert bpy.ops.nicmm.update_curves(curve=f"{name} Curve") == {"FINISHED"}
    np.testing.assert_allclose(scenes.points(bpy.data.objects[f"{name} Curve"]), before, atol=1e-5)


@pytest.mark.parametrize("mode", ["OBJECT", "EDIT"])
@pytest.mark.parametrize("output", ["CURVE", "STICKY"])
def test_saved_and_reopened(empty_scene, tmp_path, mode, output):
    sphere = scenes.sphere()
    scenes.select(sphere, scenes.ring(sphere, 4, height=0.3))
    bpy.ops.object.mode_set(mode=mode)
    bpy.ops.nicmm.design_curve(spline="EXACT", output=output, smoothness=3.0)
    name = f"{sphere.name} Curve"
    path = str(tmp_path / "saved.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    if bpy.context.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    scenes.activate(bpy.data.objects[name])
    assert bpy.ops.nicmm.update_curves() == {"FINISHED"}
    assert bpy.ops.nicmm.convert_curve(spline="EXACT", output="EDGES") == {"FINISHED"}
    assert name not in bpy.data.objects
    assert not bpy.context.active_object.data.validate()


def test_curve_whose_mesh_is_elsewhere(empty_scene):
    sphere = scenes.sphere()
    scenes.select(sphere, scenes.ring(sphere, 4))
    bpy.ops.nicmm.design_curve(spline="EXACT")
    curve = bpy.context.active_object
    other = bpy.data.scenes.new("Other")
    for collection in sphere.users_collection:
        collection.objects.unlink(sphere)
    other.collection.objects.link(sphere)
    scenes.activate(curve)
    with pytest.raises(RuntimeError, match="is not in this scene"):
        bpy.ops.nicmm.convert_curve(spline="EXACT", output="EDGES")
    assert bpy.ops.nicmm.update_curves() == {"FINISHED"}


@pytest.mark.parametrize("output", ["CURVE", "STICKY"])
def test_deleted_mesh_stays_in_the_file_as_long_as_a_curve_on_it(empty_scene, tmp_path, output):
    sphere = scenes.sphere()
    sphere.location = (1.0, 2.0, 3.0)
    scenes.select(sphere, scenes.ring(sphere, 4))
    bpy.ops.nicmm.design_curve(spline="EXACT", output=output)
    names = sphere.name, bpy.context.active_object.name
    place = bpy.context.active_object.matrix_world.copy()
    scenes.activate(sphere)
    bpy.ops.object.delete()
    path = str(tmp_path / "deleted.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    sphere, curve = (bpy.data.objects[name] for name in names)
    assert not sphere.users_scene and curve.matrix_world == place
    bpy.context.scene.collection.objects.link(sphere)
    scenes.activate(curve)
    assert bpy.ops.nicmm.update_curves() == {"FINISHED"}

    bpy.context.scene.collection.objects.unlink(sphere)
    scenes.activate(curve)
    bpy.ops.object.delete()
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    assert not bpy.data.objects


def test_broken_numbers_are_said(empty_scene):
    sphere = scenes.sphere()
    scenes.select(sphere, scenes.ring(sphere, 4))
    sphere.data.vertices[0].co.x = float("nan")
    report = refusal()
    assert "NaN" in report or "finite" in report
