"""The outputs of a curve in Blender, in the installed extension."""

import bpy
import numpy as np
import pytest

import bmesh

from nicmm_core.outputs.cut import SNAP_CUT
from tests.blender import scenes
from tests.blender.scenes import evaluated_points, get, triangles

pytestmark = pytest.mark.usefixtures("remembered_designs")

ROUNDING = 2e-6
MODES = pytest.mark.parametrize("mode", ["OBJECT", "EDIT"])


@pytest.fixture
def monkey(empty_scene):
    return scenes.monkey()


def design(mode, **settings):
    """Run the operator in a mode and return to Object Mode."""
    bpy.ops.object.mode_set(mode=mode)
    bpy.ops.ed.undo_push(message="Mode")
    assert bpy.ops.nicmm.design_curve("EXEC_DEFAULT", True, **settings) == {"FINISHED"}
    if bpy.context.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")


def drawn(mesh_object):
    """A new curve object on the mesh; it is the active object."""
    assert bpy.ops.nicmm.design_curve(spline="EXACT") == {"FINISHED"}
    curve = bpy.context.active_object
    assert curve is not mesh_object
    return curve


def seams(mesh_object):
    edges = mesh_object.data.edges
    return get(edges, "vertices", 2, np.int32)[get(edges, "use_seam", dtype=bool)]


def area(mesh_object):
    place, corners = scenes.positions(mesh_object), triangles(mesh_object)
    a, b, c = place[corners].transpose(1, 0, 2)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()


def euler(mesh_object):
    data = mesh_object.data
    return len(data.vertices) - len(data.edges) + len(data.polygons)


def assert_sound(mesh_object):
    """Assert that Blender finds nothing to repair and that every edge has one or two faces."""
    assert not mesh_object.data.validate(verbose=True)
    edited = bmesh.new()
    edited.from_mesh(mesh_object.data)
    assert all(len(edge.link_faces) in (1, 2) for edge in edited.edges)
    assert min(face.calc_area() for face in edited.faces) > 0.0
    edited.free()


def distances(points, mesh_edges, place):
    """Distances from points to the nearest of some edges."""
    start, end = place[mesh_edges.T]
    along = end - start
    offset = points[:, None] - start
    share = (offset * along).sum(axis=2) / np.maximum((along**2).sum(axis=1), 1e-30)
    return np.linalg.norm(offset - np.clip(share, 0, 1)[..., None] * along, axis=2).min(axis=1)


@MODES
@pytest.mark.parametrize("cut_faces", ["POLYGONS", "TRIANGLES"])
@pytest.mark.parametrize(
    "simplify", [0.01, *(pytest.param(by, marks=pytest.mark.slow) for by in (0.0, 0.1))]
)
def test_edges_follow_the_curve(monkey, mode, cut_faces, simplify):
    before = len(monkey.data.polygons), euler(monkey), area(monkey)
    expected = scenes.points(drawn(monkey))
    bpy.context.view_layer.objects.active = monkey
    corners = scenes.positions(monkey)[triangles(monkey)]
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    design(mode, output="EDGES", cut_faces=cut_faces, simplify=simplify)
    assert_sound(monkey)
    assert euler(monkey) == before[1]
    assert area(monkey) == pytest.approx(before[2], rel=1e-5 if cut_faces == "TRIANGLES" else 1e-2)
    chain = seams(monkey)
    assert np.bincount(chain.ravel()).max() == 2 and len(np.unique(chain)) == len(chain)
    off = distances(expected, chain, scenes.positions(monkey))
    # Two barycentric coordinates of a point may snap, each by `SNAP_CUT`.
    assert off.max() < simplify * 1.5 * edges.mean() + 2.0 * SNAP_CUT * edges.max()
    selected = get(monkey.data.edges, "select", dtype=bool)
    np.testing.assert_array_equal(selected, get(monkey.data.edges, "use_seam", dtype=bool))
    sizes = get(monkey.data.polygons, "loop_total", dtype=np.int32)
    if cut_faces == "POLYGONS":
        assert len(monkey.data.polygons) < before[0] + (60 if simplify == 0.0 else 30)
    assert sizes.max() == 4 or cut_faces == "POLYGONS"


@pytest.mark.slow
def test_seam_and_sharp_are_chosen(monkey):
    design("OBJECT", output="EDGES", mark_seam=False, mark_sharp=True)
    assert len(seams(monkey)) == 0
    sharp = get(monkey.data.edges, "use_edge_sharp", dtype=bool)
    assert sharp.sum() == get(monkey.data.edges, "select", dtype=bool).sum() > 10


def test_open_curve_is_cut(monkey):
    before = euler(monkey)
    design("OBJECT", output="EDGES", closed=False)
    assert_sound(monkey)
    assert euler(monkey) == before
    chain = seams(monkey)
    assert (np.bincount(chain.ravel()) == 1).sum() == 2


def add_layers_of_all_types(mesh_object):
    """Add layers of all types whose values identify their source; return the UV maps of faces."""
    data = mesh_object.data
    generator = np.random.default_rng(0)
    n_faces = len(data.polygons)
    maps = generator.normal(size=(n_faces, 4, 2))
    place = scenes.positions(mesh_object)
    loop_vertex = get(data.loops, "vertex_index", dtype=np.int32)
    loop_face = np.repeat(np.arange(n_faces), get(data.polygons, "loop_total", dtype=np.int32))
    homogeneous = np.concatenate([place, np.ones((len(place), 1))], axis=1)
    for number, name in enumerate(("First", "Second")):
        layer = data.uv_layers.get(name) or data.uv_layers.new(name=name)
        values = np.einsum("lj,ljk->lk", homogeneous[loop_vertex], maps[loop_face] * (1 + number))
        layer.uv.foreach_set("vector", values.astype(np.float32).ravel())
    data.attributes.new("origin", "INT", "FACE").data.foreach_set("value", np.arange(n_faces))
    data.attributes.new("height", "FLOAT", "POINT").data.foreach_set(
        "value", place[:, 2].astype(np.float32)
    )
    colours = np.ones((len(loop_vertex), 4), dtype=np.float32)
    colours[:, :3] = 0.5 + 0.3 * place[loop_vertex]
    data.color_attributes.new("Colour", "FLOAT_COLOR", "CORNER").data.foreach_set(
        "color", colours.ravel()
    )
    group = mesh_object.vertex_groups.new(name="Weights")
    for vertex, point in enumerate(place):
        group.add([vertex], 0.5 + 0.3 * point[0], "REPLACE")
    for _ in range(3):
        data.materials.append(bpy.data.materials.new("M"))
    data.polygons.foreach_set("material_index", np.arange(n_faces, dtype=np.int32) % 3)
    data.attributes.new("crease_edge", "FLOAT", "EDGE").data.foreach_set(
        "value", np.full(len(data.edges), 0.25, dtype=np.float32)
    )
    mesh_object.shape_key_add(name="Basis")
    key = mesh_object.shape_key_add(name="Stretched")
    key.data.foreach_set("co", (place * [1, 1, 3]).astype(np.float32).ravel())
    return maps


@pytest.mark.slow
@MODES
@pytest.mark.parametrize("cut_faces", ["POLYGONS", "TRIANGLES"])
def test_everything_on_the_mesh_comes_along(monkey, mode, cut_faces):
    n_edges, n_vertices = len(monkey.data.edges), len(monkey.data.vertices)
    old_edges = get(monkey.data.edges, "vertices", 2, np.int32)
    maps = add_layers_of_all_types(monkey)
    design(mode, output="EDGES", cut_faces=cut_faces)
    data = monkey.data
    place = scenes.positions(monkey)
    assert len(place) > n_vertices
    homogeneous = np.concatenate([place, np.ones((len(place), 1))], axis=1)
    loop_vertex = get(data.loops, "vertex_index", dtype=np.int32)
    face_id = get(data.attributes["origin"].data, "value", dtype=np.int32)
    loop_id = np.repeat(face_id, get(data.polygons, "loop_total", dtype=np.int32))
    for number, name in enumerate(("First", "Second")):
        uv = get(data.uv_layers[name].uv, "vector", 2)
        expected = np.einsum("lj,ljk->lk", homogeneous[loop_vertex], maps[loop_id] * (1 + number))
        np.testing.assert_allclose(uv, expected, atol=1e-5)
    height = get(data.attributes["height"].data, "value")
    np.testing.assert_allclose(height, place[:, 2], atol=ROUNDING)
    colours = get(data.color_attributes["Colour"].data, "color", 4)
    np.testing.assert_allclose(colours[:, :3], 0.5 + 0.3 * place[loop_vertex], atol=ROUNDING)
    weights = [vertex.groups[0].weight for vertex in data.vertices]
    np.testing.assert_allclose(weights, 0.5 + 0.3 * place[:, 0], atol=ROUNDING)
    np.testing.assert_array_equal(get(data.polygons, "material_index", dtype=np.int32), face_id % 3)
    key = get(data.shape_keys.key_blocks["Stretched"].data, "co", 3)
    np.testing.assert_allclose(key, place * [1, 1, 3], atol=5 * ROUNDING)
    # Parts of old edges keep their crease; new edges across old faces have none.
    crease = get(data.attributes["crease_edge"].data, "value")
    assert set(np.unique(crease)) == {np.float32(0.0), np.float32(0.25)}
    assert (crease == 0.25).sum() > n_edges
    start, end = place[get(data.edges, "vertices", 2, np.int32)].transpose(1, 0, 2)
    on_old = distances(0.3 * start + 0.7 * end, old_edges, place) < 1e-5
    on_old &= distances(0.7 * start + 0.3 * end, old_edges, place) < 1e-5
    np.testing.assert_array_equal(crease == 0.25, on_old)


def test_custom_normals_come_along(monkey):
    data = monkey.data
    place = scenes.positions(monkey)
    wanted = place / np.linalg.norm(place, axis=1, keepdims=True)
    loop_vertex = get(data.loops, "vertex_index", dtype=np.int32)
    data.normals_split_custom_set(wanted[loop_vertex].tolist())
    design("OBJECT", output="EDGES")
    place = scenes.positions(monkey)
    wanted = place / np.linalg.norm(place, axis=1, keepdims=True)
    assert data.has_custom_normals
    normals = get(data.corner_normals, "vector", 3)
    loop_vertex = get(data.loops, "vertex_index", dtype=np.int32)
    cosine = (normals * wanted[loop_vertex]).sum(axis=1)
    assert cosine.min() > 0.995  # normals are interpolated linearly


@pytest.mark.slow
@MODES
def test_region_is_selected(monkey, mode):
    before = len(monkey.data.polygons)
    expected = inside_faces(monkey)
    design(mode, output="REGION")
    assert len(monkey.data.polygons) == before
    np.testing.assert_array_equal(get(monkey.data.polygons, "select", dtype=bool), expected)
    bpy.context.view_layer.objects.active = monkey
    scenes.select(monkey, [73, 365, 74, 366])
    design(mode, output="REGION", other_side=True)
    component = same_component(monkey)
    np.testing.assert_array_equal(
        get(monkey.data.polygons, "select", dtype=bool), ~expected & component
    )


def inside_faces(monkey):
    """Polygons with more than half of their area inside, computed by the core."""
    nicmm = scenes.installed_core()

    mesh = nicmm.Mesh(scenes.positions(monkey), triangles(monkey))
    curve = scenes.design(nicmm, mesh, [73, 365, 74, 366]).curves[0]
    region = nicmm.enclosed_region(mesh, nicmm.cut_mesh(mesh, curve))
    polygon = [t.polygon_index for t in monkey.data.loop_triangles]
    within = np.bincount(polygon, mesh.face_areas * region.share)
    return within > 0.5 * np.bincount(polygon, mesh.face_areas)


def same_component(monkey):
    nicmm = scenes.installed_core()

    mesh = nicmm.Mesh(scenes.positions(monkey), triangles(monkey))
    wanted = mesh.face_component[mesh.faces_at(np.array([73]))[0]]
    polygon = np.array([t.polygon_index for t in monkey.data.loop_triangles])
    found = np.zeros(len(monkey.data.polygons), dtype=bool)
    found[polygon[mesh.face_component == wanted]] = True
    return found


@pytest.mark.slow
@MODES
def test_region_that_is_cut_ends_at_the_curve(monkey, mode):
    whole = area(monkey)
    design(mode, output="REGION", region_cut=True, cut_faces="TRIANGLES")
    assert_sound(monkey)
    assert area(monkey) == pytest.approx(whole, rel=1e-5)
    selected = get(monkey.data.polygons, "select", dtype=bool)
    inside = get(monkey.data.polygons, "area")[selected].sum()
    nicmm = scenes.installed_core()

    bpy.ops.mesh.primitive_monkey_add()
    other = bpy.context.active_object
    mesh = nicmm.Mesh(scenes.positions(other), triangles(other))
    curve = scenes.design(nicmm, mesh, [73, 365, 74, 366]).curves[0]
    assert inside == pytest.approx(
        nicmm.enclosed_region(mesh, nicmm.cut_mesh(mesh, curve)).area, rel=0.02
    )


@pytest.mark.slow
@MODES
@pytest.mark.parametrize("region_cut", [False, True])
def test_region_is_a_vertex_group(monkey, mode, region_cut):
    other = monkey.vertex_groups.new(name="Before")
    other.add([5], 0.5, "REPLACE")
    design(mode, output="REGION", region_as="VERTEX_GROUP", region_cut=region_cut)
    group = monkey.vertex_groups["Region"]
    weights = {
        vertex.index: found.weight
        for vertex in monkey.data.vertices
        for found in vertex.groups
        if found.group == group.index
    }
    assert set(weights.values()) == {1.0}
    assert {73, 365, 74, 366} <= set(weights)
    assert other.weight(5) == 0.5
    assert (max(weights) >= 507) == region_cut  # new vertices along the curve


@pytest.mark.slow
@MODES
def test_region_is_a_face_set(monkey, mode):
    expected = inside_faces(monkey)
    design(mode, output="REGION", region_as="FACE_SET")
    sets = get(monkey.data.attributes[".sculpt_face_set"].data, "value", dtype=np.int32)
    np.testing.assert_array_equal(sets, np.where(expected, 2, 1))


@pytest.mark.slow
@MODES
def test_parts_stay_in_the_mesh(monkey, mode):
    before = components(monkey)
    whole = area(monkey)
    design(mode, output="PARTS", cut_faces="TRIANGLES")
    assert_sound(monkey)
    assert components(monkey) == before + 1
    assert area(monkey) == pytest.approx(whole, rel=1e-5)


@pytest.mark.slow
@MODES
def test_parts_become_objects(monkey, mode):
    before, whole = components(monkey), area(monkey)
    maps = add_layers_of_all_types(monkey)
    monkey.location = (1, 2, 3)
    design(mode, output="PARTS", parts_as="OBJECTS", cut_faces="TRIANGLES")
    (other,) = [found for found in bpy.data.objects if found is not monkey]
    assert other.type == "MESH" and other.data is not monkey.data
    assert components(other) == 1 and components(monkey) == before
    assert area(other) + area(monkey) == pytest.approx(whole, rel=1e-5)
    assert area(other) < area(monkey)
    bpy.context.view_layer.update()
    assert other.matrix_world == monkey.matrix_world
    assert list(other.users_collection) == list(monkey.users_collection)
    for part in (other, monkey):
        assert_sound(part)
        data = part.data
        assert not [name for name in data.attributes.keys() if "nicmm" in name]
        assert len(data.materials) == 3
        homogeneous = np.pad(scenes.positions(part), ((0, 0), (0, 1)), constant_values=1.0)
        loop_vertex = get(data.loops, "vertex_index", dtype=np.int32)
        face_id = get(data.attributes["origin"].data, "value", dtype=np.int32)
        loop_id = np.repeat(face_id, get(data.polygons, "loop_total", dtype=np.int32))
        uv = get(data.uv_layers["First"].uv, "vector", 2)
        expected = np.einsum("lj,ljk->lk", homogeneous[loop_vertex], maps[loop_id])
        np.testing.assert_allclose(uv, expected, atol=1e-5)


def components(mesh_object):
    nicmm = scenes.installed_core()

    mesh = nicmm.Mesh(scenes.positions(mesh_object), triangles(mesh_object))
    return int(mesh.face_component.max()) + 1


@pytest.mark.slow
def test_parts_of_a_tube_need_no_region(empty_scene):
    bpy.ops.mesh.primitive_torus_add(major_segments=32, minor_segments=12)
    torus = bpy.context.active_object
    ring = [(1.25, 0, 0), (0.9, 0, 0.25), (0.9, 0, -0.25)]
    scenes.select(torus, scenes.nearest_vertices(torus, ring))
    for settings in ({"output": "REGION"}, {"output": "PARTS", "parts_as": "OBJECTS"}):
        before = scenes.positions(torus)
        with pytest.raises(RuntimeError, match="bounds no region"):
            bpy.ops.nicmm.design_curve(**settings)
        np.testing.assert_array_equal(scenes.positions(torus), before)
        assert list(bpy.data.objects) == [torus] and len(bpy.data.meshes) == 1
    design("OBJECT", output="PARTS")
    assert components(torus) == 1
    assert euler(torus) == 0
    assert n_rim_edges(torus) >= 2 * 12


def n_rim_edges(mesh_object):
    """Number of edges with exactly one face."""
    edited = bmesh.new()
    edited.from_mesh(mesh_object.data)
    count = sum(len(edge.link_faces) == 1 for edge in edited.edges)
    edited.free()
    return count


# Converting


CONVERSIONS = (
    {"output": "CURVE"},
    {"output": "STICKY"},
    {"output": "EDGES"},
    {"output": "REGION"},
    {"output": "PARTS"},
)


@pytest.mark.slow
@pytest.mark.parametrize("settings", CONVERSIONS, ids=lambda settings: settings["output"])
def test_converting_is_designing_with_that_output(monkey, settings):
    vertices = [73, 365, 74, 366]
    curve = drawn(monkey)
    name = curve.name
    assert bpy.ops.nicmm.convert_curve(**settings) == {"FINISHED"}
    converted = summary()
    assert settings["output"] == "CURVE" or name not in bpy.data.curves
    assert not [found for found in bpy.data.curves if not found.users]

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.mesh.primitive_monkey_add()
    scenes.select(bpy.context.active_object, vertices)
    bpy.ops.nicmm.design_curve(**{"spline": "EXACT", **settings})
    designed = summary()
    assert converted.keys() == designed.keys()
    for kind, values in designed.items():
        np.testing.assert_allclose(converted[kind], values, atol=ROUNDING)


def summary():
    """The contents of the scene as arrays, by the type of object."""
    found = {}
    for candidate in bpy.data.objects:
        if candidate.type == "MESH":
            data = candidate.data
            found["MESH"] = scenes.positions(candidate)
            found["seam"] = get(data.edges, "use_seam", dtype=bool)
            found["select"] = get(data.polygons, "select", dtype=bool)
        elif candidate.type == "CURVE":
            found["CURVE"] = scenes.points(candidate)
        else:
            found["CURVES"] = evaluated_points(candidate)
    if "CURVE" in found or "CURVES" in found:
        del found["select"]
    return found


@pytest.mark.slow
@pytest.mark.parametrize("settings", CONVERSIONS, ids=lambda settings: settings["output"])
def test_converting_after_saving_and_reopening(monkey, settings, tmp_path):
    drawn(monkey)
    file = str(tmp_path / "curve.blend")
    bpy.ops.wm.save_as_mainfile(filepath=file)
    bpy.ops.nicmm.convert_curve(**settings)
    expected = summary()
    bpy.ops.wm.open_mainfile(filepath=file)
    assert bpy.context.active_object.type == "CURVE"
    bpy.ops.nicmm.convert_curve(**settings)
    found = summary()
    for kind, values in expected.items():
        np.testing.assert_array_equal(found[kind], values)


def test_curve_follows_the_mesh_that_was_moved_before_converting(monkey):
    drawn(monkey)
    place = scenes.positions(monkey) * [1.0, 2.0, 0.5]
    monkey.data.vertices.foreach_set("co", place.astype(np.float32).ravel())
    before = scenes.points(scenes.curves()[0])
    bpy.ops.nicmm.convert_curve(output="CURVE", spline="EXACT")
    after = scenes.points(bpy.context.active_object)
    np.testing.assert_allclose(after, before * [1.0, 2.0, 0.5], atol=ROUNDING)


@pytest.mark.slow
def test_original_may_stay(monkey):
    curve = drawn(monkey)
    bpy.ops.nicmm.convert_curve(output="STICKY", keep_original=True)
    assert curve.name in bpy.data.objects
    sticky_object = bpy.context.active_object
    assert sticky_object.type == "CURVES"
    bpy.ops.nicmm.convert_curve(output="CURVE")
    assert [found.type for found in bpy.data.objects].count("CURVE") == 2
    assert not bpy.data.hair_curves


def test_mesh_outputs_make_the_mesh_active(monkey):
    drawn(monkey)
    bpy.ops.nicmm.convert_curve(output="EDGES")
    assert bpy.context.active_object is monkey
    assert bpy.context.selected_objects == [monkey]


@pytest.mark.slow
@pytest.mark.parametrize(
    "settings",
    [*CONVERSIONS, {"output": "PARTS", "parts_as": "OBJECTS"}],
    ids=lambda settings: "-".join(settings.values()),
)
@MODES
def test_one_undo_takes_everything_back(monkey, settings, mode):
    name = monkey.name
    before = summary()
    bpy.ops.object.mode_set(mode=mode)
    bpy.ops.ed.undo_push(message="Mode")
    bpy.ops.nicmm.design_curve("EXEC_DEFAULT", True, **settings)
    bpy.ops.ed.undo()
    if bpy.context.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    assert [found.name for found in bpy.data.objects] == [name]
    after = summary()
    for kind, values in before.items():
        np.testing.assert_array_equal(after[kind], values)


@pytest.mark.slow
def test_undo_of_converting_brings_the_curve_back(monkey):
    drawn(monkey)
    bpy.ops.ed.undo_push(message="Drawn")
    name, before = bpy.context.active_object.name, summary()
    bpy.ops.nicmm.convert_curve("EXEC_DEFAULT", True, output="EDGES")
    assert name not in bpy.data.objects
    bpy.ops.ed.undo()
    assert name in bpy.data.objects
    for kind, values in summary().items():
        np.testing.assert_array_equal(values, before[kind])
    bpy.ops.nicmm.convert_curve(output="EDGES")


# Refusals


def refused(operator, **settings):
    """Run an operator, which must fail and leave all meshes unchanged; return its report."""
    mesh_objects = [found for found in bpy.data.objects if found.type == "MESH"]
    before = [scenes.positions(found) for found in mesh_objects]
    names = [found.name for found in bpy.data.objects]
    n_meshes = len(bpy.data.meshes)
    with pytest.raises(RuntimeError) as caught:
        operator(**settings)
    assert [found.name for found in bpy.data.objects] == names
    assert len(bpy.data.meshes) == n_meshes
    for found, place in zip(mesh_objects, before, strict=True):
        np.testing.assert_array_equal(scenes.positions(found), place)
    return str(caught.value)


CHANGING = ({"output": "EDGES"}, {"output": "REGION"}, {"output": "PARTS"})


@pytest.mark.slow
@pytest.mark.parametrize("settings", CHANGING, ids=lambda settings: settings["output"])
def test_shared_mesh_is_not_changed(monkey, settings):
    other = monkey.copy()
    bpy.context.collection.objects.link(other)
    report = refused(bpy.ops.nicmm.design_curve, **settings)
    assert "shared by 2 users" in report and "Make Single User" in report
    assert bpy.ops.nicmm.design_curve(output="STICKY") == {"FINISHED"}


@pytest.mark.slow
@pytest.mark.parametrize("settings", CHANGING, ids=lambda settings: settings["output"])
def test_linked_mesh_is_not_changed(monkey, settings, tmp_path):
    library = str(tmp_path / "library.blend")
    name = monkey.data.name
    bpy.ops.wm.save_as_mainfile(filepath=library)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(library, link=True) as (_, wanted):
        wanted.meshes = [name]
    linked = bpy.data.objects.new("Linked", bpy.data.meshes[name])
    bpy.context.collection.objects.link(linked)
    bpy.context.view_layer.objects.active = linked
    bpy.context.view_layer.update()
    report = refused(bpy.ops.nicmm.design_curve, **settings)
    assert "is linked from" in report and "Make Local" in report
    assert bpy.ops.nicmm.design_curve(output="CURVE") == {"FINISHED"}


@pytest.mark.slow
def test_multiresolution_is_not_cut(monkey):
    monkey.modifiers.new("Multires", "MULTIRES")
    assert "Multiresolution modifier" in refused(bpy.ops.nicmm.design_curve, output="EDGES")
    assert bpy.ops.nicmm.design_curve(output="REGION") == {"FINISHED"}


@pytest.mark.slow
def test_changed_mesh_is_reported(monkey):
    drawn(monkey)
    bpy.ops.nicmm.convert_curve(output="EDGES", keep_original=True)
    bpy.context.view_layer.objects.active = scenes.curves()[0]
    report = refused(bpy.ops.nicmm.convert_curve, output="CURVE")
    assert "mesh has changed" in report and "draw the curve again" in report


@pytest.mark.slow
def test_missing_mesh_is_reported(monkey):
    curve = drawn(monkey)
    bpy.data.objects.remove(monkey)
    bpy.context.view_layer.objects.active = curve
    assert "is not in this scene" in refused(bpy.ops.nicmm.convert_curve, output="CURVE")


def test_only_designed_curves_are_converted(empty_scene):
    bpy.ops.curve.primitive_bezier_circle_add()
    assert not bpy.ops.nicmm.convert_curve.poll()
    with pytest.raises(RuntimeError, match="Make a designed curve active"):
        bpy.ops.nicmm.convert_curve()


def test_convert_stands_in_menus(extension):
    for menu in ("VIEW3D_MT_object_convert", "VIEW3D_MT_object_context_menu"):
        draws = getattr(bpy.types, menu).draw._draw_funcs
        assert f"{extension.name}.nicmm_blender.interface.menus" in [d.__module__ for d in draws]


@pytest.mark.slow
def test_a_converted_curve_looks_like_the_original(empty_scene):
    sphere = scenes.sphere()
    scenes.select(sphere, scenes.ring(sphere, 4))
    bpy.ops.nicmm.design_curve(spline="EXACT", radius=0.05, offset=0.1)
    original = bpy.context.active_object
    original.name = "Collar"
    original.data.materials.append(bpy.data.materials.new("Leather"))
    for output in ("STICKY", "CURVE"):
        bpy.ops.nicmm.convert_curve(output=output)
        converted = bpy.context.active_object
        assert converted.name == "Collar"
        assert [each.name for each in converted.data.materials] == ["Leather"]
        values = converted.nicmm_settings
        assert (values.spline, values.radius, values.offset) == (
            "EXACT",
            pytest.approx(0.05),
            pytest.approx(0.1),
        )
    bpy.ops.nicmm.convert_curve(output="CURVE", radius=0.02)
    assert bpy.context.active_object.nicmm_settings.radius == pytest.approx(0.02)
    bpy.context.active_object.nicmm_settings.radius = 0.0
    bpy.ops.nicmm.convert_curve(output="CURVE")
    assert bpy.context.active_object.nicmm_settings.radius == 0.0
