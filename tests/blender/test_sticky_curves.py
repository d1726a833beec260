"""Sticky curves follow the mesh, as strands or as a tube around the strands."""

import bpy
import numpy as np
import pytest

from tests.blender import scenes
from tests.blender.scenes import evaluated_points, get, module

pytestmark = pytest.mark.usefixtures("remembered_designs")

ROUNDING = 2e-6
SIDES = 12
CLOSED = pytest.mark.parametrize("closed", [True, False], ids=["closed", "open"])


@pytest.fixture
def monkey(empty_scene):
    return scenes.monkey()


def sticky(mesh_object, **settings):
    """A sticky curve, created as in a script."""
    bpy.context.view_layer.objects.active = mesh_object
    assert bpy.ops.nicmm.design_curve(output="STICKY", **settings) == {"FINISHED"}
    return bpy.context.active_object


def drawn_with(mesh_object, **settings):
    bpy.context.view_layer.objects.active = mesh_object
    bpy.ops.nicmm.design_curve(**settings)
    return bpy.context.active_object


def on_deformed_mesh(mesh_object, curves_object):
    """Positions of the stored barycentric coordinates on the mesh after its modifiers."""
    bpy.context.view_layer.update()
    deformed = mesh_object.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    place = get(deformed.vertices, "co", 3).astype(float)
    attributes = curves_object.data.attributes
    corners = np.stack(
        [get(attributes[f"vertex_{k}"].data, "value", dtype=np.int32) for k in (1, 2, 3)], axis=1
    )
    weights = get(attributes["barycentric"].data, "vector", 3).astype(float)
    return np.einsum("nj,njk->nk", weights, place[corners])


@pytest.mark.slow
@pytest.mark.parametrize("closed", [True, False])
def test_sticky_curve_is_the_curve(monkey, closed):
    expected = scenes.points(drawn_with(monkey, closed=closed))
    curves = sticky(monkey, closed=closed)
    assert curves.parent is monkey
    np.testing.assert_allclose(evaluated_points(curves), expected, atol=ROUNDING)
    data = curves.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    assert get(data.attributes["curve_type"].data, "value", dtype=np.int32).tolist() == [1]
    assert [bool(v) for v in get(data.attributes["cyclic"].data, "value", dtype=bool)] == [closed]
    faces = get(curves.data.attributes["face"].data, "value", dtype=np.int32)
    corners = get(curves.data.attributes["vertex_1"].data, "value", dtype=np.int32)
    assert all(
        int(vertex) in monkey.data.polygons[int(face)].vertices
        for face, vertex in zip(faces, corners, strict=True)
    )


@pytest.mark.slow
def test_sticky_curve_follows_a_cast_and_an_armature(monkey):
    monkey.location = (0.3, -1.0, 2.0)
    monkey.rotation_euler = (0.3, 0.5, -1.0)
    curves = sticky(monkey)
    undeformed = evaluated_points(curves)

    bpy.ops.object.armature_add(location=monkey.location)
    armature = bpy.context.active_object
    bpy.ops.object.mode_set(mode="EDIT")
    first = armature.data.edit_bones[0]
    second = armature.data.edit_bones.new("Second")
    second.head, second.tail = first.tail, (1.0, 0.0, 1.0)
    names = [first.name, "Second"]
    bpy.ops.object.mode_set(mode="OBJECT")
    place = scenes.positions(monkey)
    for name, share in zip(names, (place[:, 0] + 1.5, 1.5 - place[:, 0]), strict=True):
        group = monkey.vertex_groups.new(name=name)
        for vertex, weight in enumerate(np.clip(share / 3.0, 0, 1)):
            group.add([vertex], float(weight), "REPLACE")
    monkey.modifiers.new("Armature", "ARMATURE").object = armature
    armature.pose.bones[names[0]].rotation_quaternion = (0.9, 0.3, 0.3, 0.0)
    armature.pose.bones[names[1]].rotation_quaternion = (0.8, -0.3, 0.0, 0.5)
    armature.pose.bones[names[1]].location = (0.2, 0.1, 0.4)
    bent = evaluated_points(curves)
    assert np.linalg.norm(bent - undeformed, axis=1).max() > 0.1
    assert np.abs(bent - on_deformed_mesh(monkey, curves)).max() < 1e-6

    cast = monkey.modifiers.new("Cast", "CAST")
    cast.factor = 0.7
    cast_points = evaluated_points(curves)
    assert np.linalg.norm(cast_points - bent, axis=1).max() > 0.1
    assert np.abs(cast_points - on_deformed_mesh(monkey, curves)).max() < 1e-6


# The tube


def shown_mesh(curves_object):
    """The mesh that Blender shows for a hair curves object, or None if it shows strands."""
    bpy.context.view_layer.update()
    shown = [
        instance.object.data
        for instance in bpy.context.evaluated_depsgraph_get().object_instances
        if instance.parent is not None and instance.parent.original == curves_object
    ]
    return shown[0] if shown else None


def rings(curves_object):
    """Positions of the tube's vertices around each point of the curve, (n, SIDES, 3)."""
    mesh = shown_mesh(curves_object)
    return get(mesh.vertices, "co", 3).astype(float).reshape(-1, SIDES, 3)


@pytest.mark.slow
@CLOSED
def test_tube_is_as_far_from_the_curve_as_the_strands_are_thick(monkey, closed):
    expected = scenes.points(drawn_with(monkey, closed=closed))
    curves = sticky(monkey, closed=closed, tube=True, thickness=0.01)
    radius = get(curves.data.attributes["radius"].data, "value")
    np.testing.assert_allclose(radius, 0.01 * np.linalg.norm(np.ptp(vertices(monkey), axis=0)))
    around = rings(curves)
    assert len(around) == len(expected)
    np.testing.assert_allclose(around.mean(axis=1), expected, atol=ROUNDING)
    apart = np.linalg.norm(around - expected[:, None], axis=2)
    np.testing.assert_allclose(apart, np.repeat(radius[:, None], SIDES, axis=1), atol=ROUNDING)

    mesh = shown_mesh(curves)
    of_edges = np.bincount(get(mesh.loops, "edge_index", dtype=np.int32))
    assert (of_edges == 2).all(), "a solid"
    euler = len(mesh.vertices) - len(mesh.edges) + len(mesh.polygons)
    assert euler == (0 if closed else 2)
    flat = [polygon for polygon in mesh.polygons if not polygon.use_smooth]
    assert [len(polygon.vertices) for polygon in flat] == ([] if closed else [SIDES, SIDES])


def vertices(mesh_object):
    return get(mesh_object.data.vertices, "co", 3)


@pytest.mark.slow
@CLOSED
def test_tube_without_thickness_is_a_line_through_all_points(monkey, closed):
    curves = sticky(monkey, closed=closed, tube=True, thickness=0.0)
    line = shown_mesh(curves)
    count = len(curves.data.points)
    assert (len(line.vertices), len(line.polygons)) == (count, 0)
    assert len(line.edges) == (count if closed else count - 1)
    written = get(curves.data.points, "position", 3)
    np.testing.assert_allclose(get(line.vertices, "co", 3), written, atol=ROUNDING)


def test_tube_follows_the_mesh(monkey):
    curves = sticky(monkey, tube=True)
    monkey.modifiers.new("Cast", "CAST").factor = 0.7
    middle = rings(curves).mean(axis=1)
    assert np.linalg.norm(middle - get(curves.data.points, "position", 3), axis=1).max() > 0.05
    np.testing.assert_allclose(middle, on_deformed_mesh(monkey, curves), atol=ROUNDING)


@pytest.mark.slow
def test_tube_stays_when_the_curve_is_edited_and_updated(monkey):
    curves = sticky(monkey, tube=True)
    before = len(curves.data.points)
    assert bpy.ops.nicmm.edit_curve(closed=False) == {"FINISHED"}
    assert bpy.context.active_object == curves and len(curves.data.points) != before
    np.testing.assert_allclose(
        rings(curves).mean(axis=1), get(curves.data.points, "position", 3), atol=ROUNDING
    )
    monkey.data.transform(np.diag([1.0, 1.5, 0.7, 1.0]).tolist())
    assert bpy.ops.nicmm.update_curves() == {"FINISHED"}
    np.testing.assert_allclose(
        rings(curves).mean(axis=1), get(curves.data.points, "position", 3), atol=ROUNDING
    )
    assert np.ptp(rings(curves), axis=(0, 1))[1] > 1.2


def test_tube_has_the_material_of_the_curve(monkey):
    if bpy.app.version < (4, 5, 0):
        pytest.skip("Curve to Mesh drops materials in Blender 4.3")
    curves = sticky(monkey, tube=True)
    curves.data.materials.append(bpy.data.materials.new("Rubber"))
    assert [found.name for found in shown_mesh(curves).materials] == ["Rubber"]


# The default of the tube


def test_blender_draws_all_points_since_5(extension):
    found = module(extension, "outputs.sticky_curves").are_drawn_with_all_points()
    assert found == (bpy.app.version >= (5, 0, 0))
    of_panel = bpy.types.Scene.bl_rna.properties["nicmm_curves"].fixed_type.properties
    assert of_panel["tube"].default != found


@pytest.fixture(params=[True, False], ids=["all points", "few points"])
def all_points(request, extension, monkeypatch):
    """Simulate a Blender that draws all points of hair curves, and one that does not."""
    sticky_curves = module(extension, "outputs.sticky_curves")
    monkeypatch.setattr(sticky_curves, "are_drawn_with_all_points", lambda: request.param)
    return request.param


@pytest.fixture
def window(extension, monkeypatch):
    """Make operators begin with `invoke`, which Blender does not call without a window."""
    design = module(extension, "operators.design_curve").NICMM_OT_design_curve
    convert = module(extension, "operators.convert_curve").NICMM_OT_convert_curve
    for operator in (design, convert):
        monkeypatch.setattr(operator, "execute", through_invoke(operator, operator.execute))


def through_invoke(operator, execute):
    begun = []

    def begin(self, context):
        if begun:
            return execute(self, context)
        begun.append(self)
        try:
            return operator.invoke(self, context, None)
        finally:
            begun.clear()

    return begin


def design(**settings):
    return bpy.ops.nicmm.design_curve(output="STICKY", **settings)


def convert(**settings):
    bpy.ops.nicmm.design_curve()
    return bpy.ops.nicmm.convert_curve(output="STICKY", **settings)


OPERATORS = pytest.mark.parametrize("operator", [design, convert])


@pytest.mark.slow
@OPERATORS
def test_window_begins_with_a_tube_where_few_points_are_drawn(monkey, window, all_points, operator):
    bpy.context.scene.nicmm_curves.tube = not all_points  # its default when Blender starts
    assert operator() == {"FINISHED"}
    assert (shown_mesh(bpy.context.active_object) is None) == all_points


@pytest.mark.slow
@OPERATORS
def test_scripts_get_strands(monkey, all_points, operator):
    assert operator() == {"FINISHED"}
    assert shown_mesh(bpy.context.active_object) is None


@pytest.mark.slow
@OPERATORS
@pytest.mark.parametrize("tube", [True, False])
def test_what_the_caller_asks_for_counts(monkey, window, all_points, operator, tube):
    assert operator(tube=tube) == {"FINISHED"}
    assert (shown_mesh(bpy.context.active_object) is not None) == tube


@pytest.mark.slow
def test_editing_tool_makes_a_tube(monkey):
    points = [{"name": "", "position": vertices(monkey)[v].tolist()} for v in (73, 365, 74, 366)]
    bpy.ops.nicmm.edit_curve(points=points, output="STICKY", tube=True)
    assert len(rings(bpy.context.active_object))
    bpy.context.view_layer.objects.active = monkey
    bpy.ops.nicmm.edit_curve(points=points, output="STICKY")
    assert shown_mesh(bpy.context.active_object) is None


# Node groups of other files


@pytest.mark.slow
def test_nodes_that_somebody_put_into_the_group_stay(monkey, extension):
    nodes = module(extension, "outputs.sticky_nodes")
    group = nodes._new_group()
    output = next(node for node in group.nodes if node.bl_idname == "NodeGroupOutput")
    raise_ = group.nodes.new("GeometryNodeTransform")
    raise_.inputs["Translation"].default_value = (0.0, 0.0, 5.0)
    group.links.new(output.inputs[0].links[0].from_socket, raise_.inputs["Geometry"])
    group.links.new(raise_.outputs[0], output.inputs[0])
    curves = sticky(monkey, tube=True)
    assert curves.modifiers[0].node_group == group
    expected = get(curves.data.points, "position", 3) + [0.0, 0.0, 5.0]
    np.testing.assert_allclose(rings(curves).mean(axis=1), expected, atol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["GeometryNodeTree", "ShaderNodeTree"])
def test_group_of_that_name_which_is_none_of_ours_is_left_alone(monkey, extension, kind):
    name = module(extension, "outputs.sticky_nodes").GROUP_NAME
    other = bpy.data.node_groups.new(name, kind)
    curves = sticky(monkey, tube=True)
    assert len(rings(curves)) and curves.modifiers[0].node_group != other
    assert not other.nodes


def test_group_that_has_lost_an_input_is_left_alone(monkey, extension):
    nodes = module(extension, "outputs.sticky_nodes")
    group = nodes._new_group()
    group.interface.remove(group.interface.items_tree[nodes.TUBE])
    curves = sticky(monkey, tube=True)
    assert len(rings(curves)) and curves.modifiers[0].node_group != group


@pytest.mark.slow
def test_linked_group_is_left_alone(monkey, extension, tmp_path):
    nodes = module(extension, "outputs.sticky_nodes")
    file = str(tmp_path / "library.blend")
    bpy.data.libraries.write(file, {nodes._new_group()})
    bpy.data.node_groups.remove(bpy.data.node_groups[nodes.GROUP_NAME])
    with bpy.data.libraries.load(file, link=True) as (_, wanted):
        wanted.node_groups = [nodes.GROUP_NAME]
    curves = sticky(monkey, tube=True)
    assert len(rings(curves)) and curves.modifiers[0].node_group.library is None
