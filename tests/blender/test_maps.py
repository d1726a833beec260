"""Maps that are created and painted from the panel, in the installed extension."""

from importlib import import_module

import bpy
import numpy as np
import pytest

from tests.blender import scenes

ROLES = pytest.mark.parametrize(
    ("role", "field"), [("OBSTACLES", "obstacle_group"), ("ALIGNMENT", "alignment_group")]
)


@pytest.fixture
def cube(empty_scene):
    """A cube with sharp edges; each side consists of 64 quads."""
    bpy.ops.mesh.primitive_cube_add()
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.subdivide(number_cuts=7)
    bpy.ops.mesh.select_all(action="DESELECT")
    bpy.ops.object.mode_set(mode="OBJECT")
    return bpy.context.active_object


def weights(mesh_object, name):
    index = mesh_object.vertex_groups[name].index
    found = np.zeros(len(mesh_object.data.vertices))
    for vertex in mesh_object.data.vertices:
        for membership in vertex.groups:
            if membership.group == index:
                found[vertex.index] = membership.weight
    return found


def on_edges_of_the_cube(mesh_object):
    return (np.isclose(np.abs(scenes.positions(mesh_object)), 1.0).sum(axis=1) >= 2).astype(float)


def test_maps_of_a_hidden_mesh_are_refused(cube):
    cube.vertex_groups.new(name="Wall")
    bpy.context.scene.nicmm_curves.obstacle_group = "Wall"
    cube.hide_viewport = True
    bpy.context.view_layer.objects.active = cube
    for run in (bpy.ops.nicmm.new_map, bpy.ops.nicmm.paint_map):
        with pytest.raises(RuntimeError, match="is hidden. Show it"):
            run()
    assert cube.vertex_groups.keys() == ["Wall"]


@ROLES
@pytest.mark.parametrize("mode", ["OBJECT", "EDIT", "WEIGHT_PAINT"])
def test_empty_map_is_chosen_and_shown(cube, role, field, mode):
    bpy.ops.object.mode_set(mode=mode)
    assert bpy.ops.nicmm.new_map(role=role, source="PAINT") == {"FINISHED"}
    name = getattr(bpy.context.scene.nicmm_curves, field)
    assert cube.vertex_groups.active.name == name == role.title()
    assert not weights(cube, name).any()
    assert bpy.context.mode == "PAINT_WEIGHT"


@pytest.mark.parametrize("mode", ["OBJECT", "EDIT"])
def test_map_of_the_selection(cube, mode):
    chosen = [3, 40, 41]
    scenes.select(cube, chosen)
    bpy.ops.object.mode_set(mode=mode)
    bpy.ops.nicmm.new_map(role="OBSTACLES", source="SELECTION", strength=0.75, show=False)
    assert cube.mode == mode
    bpy.ops.object.mode_set(mode="OBJECT")
    expected = np.zeros(len(cube.data.vertices))
    expected[chosen] = 0.75
    np.testing.assert_array_equal(weights(cube, "Obstacles"), expected)


def test_maps_of_edges(cube):
    expected = on_edges_of_the_cube(cube)
    assert 0 < expected.sum() < len(expected) / 2
    bpy.ops.nicmm.new_map(role="ALIGNMENT", source="SHARP_EDGES", show=False)
    np.testing.assert_array_equal(weights(cube, "Alignment"), expected)
    bpy.ops.nicmm.new_map(role="ALIGNMENT", source="SHARP_EDGES", angle=1.7, show=False)
    assert bpy.context.scene.nicmm_curves.alignment_group == "Alignment.001"
    assert not weights(cube, "Alignment.001").any()
    for source, attribute in (("SEAMS", "use_seam"), ("MARKED_SHARP", "use_edge_sharp")):
        with pytest.raises(RuntimeError, match="No edge of .* is"):
            bpy.ops.nicmm.new_map(role="OBSTACLES", source=source)
        edge = cube.data.edges[17]
        ends = set(edge.vertices)
        setattr(edge, attribute, True)
        bpy.ops.nicmm.new_map(role="OBSTACLES", source=source, show=False)
        found = weights(cube, bpy.context.scene.nicmm_curves.obstacle_group)
        assert set(np.flatnonzero(found)) == ends


def test_map_of_curvature_is_that_of_the_core(empty_scene):
    core = empty_scene.core
    bpy.ops.mesh.primitive_monkey_add()
    monkey = bpy.context.active_object
    expected = core.curvature_map(core.Mesh(scenes.positions(monkey), scenes.triangles(monkey)))
    bpy.ops.nicmm.new_map(role="ALIGNMENT", source="CURVATURE", show=False)
    found = weights(monkey, "Alignment")
    np.testing.assert_allclose(found, expected, atol=1e-6)
    assert found.max() == 1.0 and (found == 0.0).any()


def test_empty_map_is_reported(empty_scene, capfd):
    scenes.sphere()
    bpy.ops.nicmm.new_map(role="ALIGNMENT", source="SHARP_EDGES", angle=1.5)
    assert "are zero" in capfd.readouterr().out


@ROLES
def test_painting_is_switched_on_and_off(cube, role, field):
    with pytest.raises(RuntimeError, match="No vertex group is chosen"):
        bpy.ops.nicmm.paint_map(role=role)
    cube.vertex_groups.new(name="Other")
    wanted = cube.vertex_groups.new(name="縁")
    cube.vertex_groups.active_index = 0
    setattr(bpy.context.scene.nicmm_curves, field, "縁")
    bpy.ops.nicmm.paint_map(role=role)
    assert bpy.context.mode == "PAINT_WEIGHT" and cube.vertex_groups.active == wanted
    bpy.ops.nicmm.paint_map(role=role)
    assert bpy.context.mode == "OBJECT"
    setattr(bpy.context.scene.nicmm_curves, field, "Gone")
    with pytest.raises(RuntimeError, match='no vertex group "Gone"'):
        bpy.ops.nicmm.paint_map(role=role)


@pytest.mark.slow
@pytest.mark.parametrize("show", [True, False])
def test_a_map_is_for_the_active_curve(empty_scene, show):
    sphere = scenes.sphere()
    scenes.select(sphere, scenes.ring(sphere, 4))
    bpy.ops.nicmm.design_curve()
    curve = bpy.context.active_object
    bpy.ops.nicmm.new_map(role="OBSTACLES", source="PAINT", show=show)
    assert bpy.context.mode == ("PAINT_WEIGHT" if show else "OBJECT")
    assert bpy.context.active_object == (sphere if show else curve)
    assert curve.nicmm_settings.obstacle_group == "Obstacles"
    assert bpy.context.scene.nicmm_curves.obstacle_group == ""
    if show:
        bpy.ops.nicmm.paint_map(role="OBSTACLES")
    assert bpy.context.mode == "OBJECT"
    assert bpy.context.active_object == curve


def test_a_map_that_the_curve_cannot_use_is_reported(empty_scene, capfd):
    sphere = scenes.sphere()
    scenes.select(sphere, scenes.ring(sphere, 4))
    bpy.ops.nicmm.design_curve()
    curve = bpy.context.active_object
    around = np.abs(scenes.positions(sphere)[:, 2]) < 0.5
    scenes.select(sphere, np.flatnonzero(around).tolist())
    scenes.activate(curve)
    bpy.ops.nicmm.new_map(role="OBSTACLES", source="SELECTION", show=False)
    assert curve.nicmm_settings.obstacle_group == ""
    assert f'"{curve.name}" does not use it' in capfd.readouterr().out


@pytest.mark.slow
def test_a_map_of_a_curve_without_a_parent_is_on_its_mesh(empty_scene):
    sphere = scenes.sphere()
    scenes.select(sphere, scenes.ring(sphere, 4))
    bpy.ops.nicmm.design_curve()
    other = scenes.sphere()
    curve = scenes.curves()[0]
    curve.parent = other
    scenes.activate(curve)
    assert bpy.ops.nicmm.new_map(role="ALIGNMENT", source="PAINT") == {"FINISHED"}
    assert "Alignment" in sphere.vertex_groups and not other.vertex_groups


def test_map_of_a_linked_mesh_is_refused(empty_scene, tmp_path):
    sphere = scenes.sphere()
    path = str(tmp_path / "library.blend")
    bpy.data.libraries.write(path, {sphere.data})
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.meshes = [sphere.data.name]
    sphere.data = wanted.meshes[0]
    with pytest.raises(RuntimeError, match=r"linked from .*Make it local"):
        bpy.ops.nicmm.new_map(role="OBSTACLES", source="PAINT")
    assert bpy.context.mode == "OBJECT"


def test_undo_takes_a_map_away(cube):
    bpy.ops.ed.undo_push(message="Cube")
    name = cube.name
    bpy.ops.nicmm.new_map("EXEC_DEFAULT", True, role="ALIGNMENT", source="SHARP_EDGES")
    bpy.ops.ed.undo()
    assert not bpy.data.objects[name].vertex_groups
    assert bpy.context.mode == "OBJECT"


def test_rows_and_menus_follow_the_sources(extension):
    maps = import_module(f"{extension.name}.nicmm_blender.operators.maps")
    map_rows = import_module(f"{extension.name}.nicmm_blender.interface.map_rows")
    for menu in map_rows.MENUS.values():
        assert hasattr(bpy.types, menu.__name__)
    kinds = bpy.ops.nicmm.new_map.get_rna_type().properties
    assert [item.identifier for item in kinds["source"].enum_items] == [s[0] for s in maps.SOURCES]
    assert set(maps.FIELDS) == {item.identifier for item in kinds["role"].enum_items}
