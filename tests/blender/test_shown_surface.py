"""Curves lie on the surface that the viewport shows, with its modifiers, pose and frame."""

import bpy
import igl
import numpy as np
import pytest

from mathutils import Euler

from tests.blender import scenes
from tests.blender.scenes import module

pytestmark = pytest.mark.usefixtures("remembered_designs")

EXACT = 1e-6
"""Largest distance from the shown surface, in diagonals."""


def shown(mesh_object):
    """World positions and triangles of a mesh as the viewport shows it."""
    evaluated = mesh_object.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    mesh.calc_loop_triangles()
    positions = scenes.get(mesh.vertices, "co", 3).astype(float)
    faces = scenes.get(mesh.loop_triangles, "vertices", 3, np.int32).astype(np.int64)
    world = np.array(evaluated.matrix_world)
    evaluated.to_mesh_clear()
    return positions @ world[:3, :3].T + world[:3, 3], faces


def in_world(curve):
    """World positions of the points of a curve or hair curves object, after its modifiers."""
    bpy.context.view_layer.update()
    if curve.type == "CURVES":
        local = scenes.evaluated_points(curve)
    else:
        local = scenes.get(curve.data.splines[0].points, "co", 4)[:, :3].astype(float)
    world = np.array(curve.matrix_world)
    return local @ world[:3, :3].T + world[:3, 3]


def curve_deviation(curve, mesh_object):
    """Largest distance of a curve's points from the shown surface, in diagonals."""
    return point_deviation(in_world(curve), mesh_object)


def point_deviation(points, mesh_object):
    vertices, faces = shown(mesh_object)
    squared, *_ = igl.point_mesh_squared_distance(points, vertices, faces)
    return float(np.sqrt(squared.max()) / np.linalg.norm(np.ptp(vertices, axis=0)))


CHOSEN = (73, 365, 74, 366)


def faces_at(faces, vertex):
    """Index of the first triangle that has a vertex."""
    return int((faces == vertex).any(axis=1).argmax())


def draw(mesh_object, vertices=CHOSEN, spline="EXACT", **settings):
    bpy.context.view_layer.objects.active = mesh_object
    text = ", ".join(map(str, vertices))
    assert bpy.ops.nicmm.design_curve(points=text, spline=spline, **settings) == {"FINISHED"}
    return bpy.context.active_object


@pytest.fixture
def monkey(empty_scene):
    return scenes.monkey()


def subdivision(mesh_object):
    mesh_object.modifiers.new("Subdivision", "SUBSURF").levels = 1


def mirror(mesh_object):
    mesh_object.modifiers.new("Mirror", "MIRROR").use_axis = (False, False, True)


def bevel(mesh_object):
    mesh_object.modifiers.new("Bevel", "BEVEL").width = 0.01


def array(mesh_object):
    mesh_object.modifiers.new("Array", "ARRAY").count = 3


def solidify(mesh_object):
    mesh_object.modifiers.new("Solidify", "SOLIDIFY").thickness = 0.02


def shrinkwrap(mesh_object):
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=4, radius=2.0)
    modifier = mesh_object.modifiers.new("Shrinkwrap", "SHRINKWRAP")
    modifier.target, modifier.wrap_mode, modifier.offset = bpy.context.object, "OUTSIDE", 0.1


def simple_deform(mesh_object):
    mesh_object.modifiers.new("Twist", "SIMPLE_DEFORM").angle = 1.0


def multires(mesh_object):
    modifier = mesh_object.modifiers.new("Multires", "MULTIRES")
    bpy.context.view_layer.objects.active = mesh_object
    bpy.ops.object.multires_subdivide(modifier=modifier.name, mode="CATMULL_CLARK")


def nodes(mesh_object):
    """Add Geometry Nodes that subdivide and displace the mesh."""
    group = bpy.data.node_groups.new("Waves", "GeometryNodeTree")
    group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    made = {
        kind: group.nodes.new(kind)
        for kind in (
            "NodeGroupInput",
            "GeometryNodeSubdivideMesh",
            "GeometryNodeSetPosition",
            "GeometryNodeInputPosition",
            "ShaderNodeVectorMath",
            "NodeGroupOutput",
        )
    }
    first, divided, moved, place, sine, last = made.values()
    sine.operation = "SINE"
    group.links.new(first.outputs[0], divided.inputs[0])
    group.links.new(divided.outputs[0], moved.inputs["Geometry"])
    group.links.new(place.outputs[0], sine.inputs[0])
    group.links.new(sine.outputs[0], moved.inputs["Offset"])
    group.links.new(moved.outputs[0], last.inputs[0])
    mesh_object.modifiers.new("Waves", "NODES").node_group = group


def armature(mesh_object):
    """Add an armature of two bones through the head; an action bends it from frame 1 to 20."""
    bpy.ops.object.armature_add()
    rig = bpy.context.object
    bpy.ops.object.mode_set(mode="EDIT")
    bone = rig.data.edit_bones[0]
    bone.head, bone.tail = (0, 0, -1), (0, 0, 0)
    upper = rig.data.edit_bones.new("Upper")
    upper.head, upper.tail, upper.parent = (0, 0, 0), (0, 0, 1), bone
    names = bone.name, upper.name
    bpy.ops.object.mode_set(mode="OBJECT")
    height = scenes.positions(mesh_object)[:, 2]
    for name, weights in zip(names, (height < 0.1, height >= 0.1), strict=True):
        group = mesh_object.vertex_groups.new(name=name)
        group.add(np.flatnonzero(weights).tolist(), 1.0, "REPLACE")
    mesh_object.modifiers.new("Armature", "ARMATURE").object = rig
    posed = rig.pose.bones["Upper"]
    posed.rotation_mode = "XYZ"
    for frame, angle in ((1, 0.0), (20, 0.8)):
        posed.rotation_euler = (angle, 0.3 * angle, 0.0)
        posed.keyframe_insert("rotation_euler", frame=frame)
    bpy.context.scene.frame_set(20)
    return rig


def armature_and_subdivision(mesh_object):
    armature(mesh_object)
    subdivision(mesh_object)


def scaled_under_a_rotated_parent(mesh_object):
    bpy.ops.object.empty_add(rotation=(0.4, 0.2, 0.9))
    mesh_object.parent = bpy.context.object
    mesh_object.scale = (1.0, 0.3, 2.0)
    mesh_object.rotation_euler = Euler((0.5, 0.1, 0.7))
    subdivision(mesh_object)


WAYS = (
    subdivision,
    mirror,
    bevel,
    armature,
    armature_and_subdivision,
    array,
    solidify,
    shrinkwrap,
    simple_deform,
    nodes,
    multires,
    scaled_under_a_rotated_parent,
)


@pytest.mark.slow
@pytest.mark.parametrize("output", ["CURVE", "STICKY"])
@pytest.mark.parametrize("change", WAYS, ids=lambda way: way.__name__)
def test_curves_lie_on_the_shown_surface(monkey, change, output):
    change(monkey)
    before = scenes.positions(monkey), len(monkey.data.attributes)
    curve = draw(monkey, output=output)
    assert curve_deviation(curve, monkey) < EXACT
    np.testing.assert_array_equal(scenes.positions(monkey), before[0])
    assert len(monkey.data.attributes) == before[1]
    assert len(bpy.data.scenes) == 1
    assert all(modifier.show_viewport for modifier in monkey.modifiers)


@pytest.mark.slow
@pytest.mark.parametrize("change", WAYS, ids=lambda way: way.__name__)
def test_even_curves_are_near_the_shown_surface_and_evenly_spaced(monkey, change):
    change(monkey)
    curve = draw(monkey, spline="EVEN")
    points = in_world(curve)
    following = np.roll(points, -1, axis=0)
    for share in (0.0, 0.25, 0.5, 0.75):
        assert point_deviation((1.0 - share) * points + share * following, monkey) < 1e-4
    record = np.reshape(curve["nicmm_curve"]["control_positions"], (-1, 3))
    placement = np.array(monkey.matrix_world)
    controls = record @ placement[:3, :3].T + placement[:3, 3]
    places = np.linalg.norm(points[:, None] - controls[None], axis=2)
    assert places.min(axis=0).max() < 1e-5
    bounds = np.sort(places.argmin(axis=0))
    lengths = np.linalg.norm(following - points, axis=1)
    for first, last in zip(bounds, np.append(bounds[1:], bounds[0] + len(points)), strict=True):
        leg = lengths[np.arange(first, last) % len(points)]
        assert leg.min() >= 0.5 * leg.mean()


@pytest.mark.slow
@pytest.mark.parametrize("change", [subdivision, armature_and_subdivision, mirror])
def test_points_are_the_selected_vertices_where_they_are_shown(monkey, change):
    change(monkey)
    chosen = list(CHOSEN)
    curve = draw(monkey, chosen)
    vertices, _ = shown(monkey)  # these modifiers keep the first vertices
    assert scenes.distances_to(vertices[chosen], in_world(curve)).max() < 1e-6


@pytest.mark.parametrize("mode", ["EDIT", "SCULPT", "WEIGHT_PAINT"])
def test_every_mode_shows_the_same_surface(monkey, empty_scene, mode):
    subdivision(monkey)
    surface = module(empty_scene, "scene.surface")
    before = surface.read(monkey, True)
    bpy.ops.object.mode_set(mode=mode)
    now = surface.read(monkey, True)
    for name in ("local_positions", "faces", "loops", "polygons"):
        np.testing.assert_array_equal(getattr(now, name), getattr(before, name))
    np.testing.assert_array_equal(now.cage.vertices, before.cage.vertices)


def test_weights_are_those_that_modifiers_interpolate(monkey, empty_scene):
    group = monkey.vertex_groups.new(name="Wall")
    group.add(list(range(200)), 0.7, "REPLACE")
    surface = module(empty_scene, "scene.surface")
    cage = surface.group_weights(monkey, "Wall", False)
    subdivision(monkey)
    weights = surface.group_weights(monkey, "Wall", True)
    assert len(weights) > len(cage) == len(monkey.data.vertices)
    np.testing.assert_allclose(weights[: len(cage)], cage)
    between = (weights > 0.01) & (weights < 0.69)
    assert between.any()


@pytest.mark.parametrize("use_modifiers", [True, False])
@pytest.mark.parametrize("mode", ["OBJECT", "EDIT"])
def test_weights_agree_with_those_of_single_vertices(monkey, empty_scene, mode, use_modifiers):
    monkey.vertex_groups.new(name="Other").add([3], 0.5, "REPLACE")
    monkey.vertex_groups["Other"].remove([3])
    group = monkey.vertex_groups.new(name="Map")
    for vertex in range(0, len(monkey.data.vertices), 2):
        group.add([vertex], vertex / 1000.0, "REPLACE")
    subdivision(monkey)
    bpy.ops.object.mode_set(mode=mode)
    surface = module(empty_scene, "scene.surface")
    blocks = (bpy.data.meshes, bpy.data.objects, bpy.data.scenes, bpy.data.node_groups)
    before = [len(kind) for kind in blocks]
    found = surface.group_weights(monkey, "Map", use_modifiers)
    assert [len(kind) for kind in blocks] == before
    assert found.any()
    with surface.shown_mesh(monkey, use_modifiers) as (mesh, _):
        singly = [sum(each.weight for each in vertex.groups) for vertex in mesh.vertices]
    np.testing.assert_allclose(found, singly, rtol=0, atol=1e-7)
    assert found.max() > 0.4


@pytest.mark.slow
def test_a_wall_keeps_the_curve_away_on_the_shown_surface(monkey):
    group = monkey.vertex_groups.new(name="Wall")
    monkey.modifiers.new("Subdivision", "SUBSURF").levels = 2
    free = in_world(draw(monkey))
    place = free[len(free) // 8]
    near = np.linalg.norm(scenes.positions(monkey) - place, axis=1) < 0.25
    near[list(CHOSEN)] = False
    group.add(np.flatnonzero(near).tolist(), 1.0, "REPLACE")
    curve = draw(monkey, obstacle_group="Wall")
    assert curve_deviation(curve, monkey) < EXACT
    assert np.linalg.norm(in_world(curve) - place, axis=1).min() > 0.05


@pytest.mark.slow
@pytest.mark.parametrize("levels", [(1, 2), (2, 1), (1, 0)])
def test_points_survive_a_change_of_level(monkey, levels):
    modifier = monkey.modifiers.new("Subdivision", "SUBSURF")
    modifier.levels = levels[0]
    vertices, faces = shown(monkey)
    places = vertices[faces[[faces_at(faces, vertex) for vertex in CHOSEN]]].mean(axis=1)
    points = [{"name": "", "position": tuple(place)} for place in places]
    bpy.context.view_layer.objects.active = monkey
    assert bpy.ops.nicmm.edit_curve(points=points, closed=False) == {"FINISHED"}
    curve = bpy.context.active_object
    modifier.levels = levels[1]
    assert bpy.ops.nicmm.update_curves() == {"FINISHED"}
    diagonal = np.linalg.norm(np.ptp(vertices, axis=0))
    ends = in_world(curve)[[0, -1]]
    # Another level changes the shape of the surface too.
    assert scenes.distances_to(places[[0, -1]], ends).max() < 0.02 * diagonal
    assert curve_deviation(curve, monkey) < 1e-4


@pytest.mark.slow
def test_simplified_scenes_show_fewer_levels(monkey, empty_scene):
    """The levels of modifiers may be limited in the scene; points keep their vertices."""
    monkey.modifiers.new("Subdivision", "SUBSURF").levels = 2
    render = bpy.context.scene.render
    render.use_simplify, render.simplify_subdivision = True, 1
    surface = module(empty_scene, "scene.surface").read(monkey, use_modifiers=True)
    assert len(surface.faces) == len(shown(monkey)[1])
    assert (surface.cage.vertices[list(CHOSEN)] >= 0).all()
    curve = draw(monkey)
    vertices, _ = shown(monkey)
    chosen = vertices[surface.cage.vertices[list(CHOSEN)]]
    assert scenes.distances_to(chosen, in_world(curve)).max() < 1e-6


@pytest.mark.slow
def test_points_stay_in_their_half_of_a_mirror(monkey):
    mirror(monkey)
    monkey.modifiers["Mirror"].use_mirror_merge = False
    monkey.modifiers.new("Subdivision", "SUBSURF").levels = 1
    vertices, faces = shown(monkey)
    places = vertices[faces[[faces_at(faces, vertex) for vertex in CHOSEN]]].mean(axis=1)
    places *= [1, 1, -1]
    points = [{"name": "", "position": tuple(place)} for place in places]
    assert bpy.ops.nicmm.edit_curve(points=points, closed=False) == {"FINISHED"}
    curve = bpy.context.active_object
    monkey.modifiers["Subdivision"].levels = 2
    monkey.modifiers["Mirror"].use_axis = (False, True, False)  # another mirror image
    assert bpy.ops.nicmm.update_curves() == {"FINISHED"}
    expected = places * [1, 1, -1] * [1, -1, 1]
    ends = in_world(curve)[[0, -1]]
    assert scenes.distances_to(ends, expected).max() < 0.05


@pytest.mark.slow
def test_a_curve_on_the_cage_moves_to_the_shown_surface(monkey):
    curve = draw(monkey, use_modifiers=False)
    subdivision(monkey)
    bpy.context.scene.nicmm_curves.use_modifiers = True
    assert bpy.ops.nicmm.update_curves(use_panel=True) == {"FINISHED"}
    vertices, _ = shown(monkey)
    assert scenes.distances_to(vertices[list(CHOSEN)], in_world(curve)).max() < 2e-3


@pytest.mark.slow
@pytest.mark.parametrize("disable", ["object", "collection"])
def test_a_mesh_disabled_in_viewports_is_not_read_without_its_modifiers(monkey, disable):
    subdivision(monkey)
    curve = draw(monkey)
    before = in_world(curve)
    of_scene = bpy.context.scene.collection
    if disable == "object":
        monkey.hide_viewport = True
    else:
        disabled = bpy.data.collections.new("Disabled")
        of_scene.children.link(disabled)
        disabled.objects.link(monkey)
        of_scene.objects.unlink(monkey)
        disabled.hide_viewport = True
    bpy.context.view_layer.update()
    with pytest.raises(RuntimeError, match="is disabled in viewports, so its modifiers are not"):
        bpy.ops.nicmm.update_curves(curve=curve.name)
    np.testing.assert_array_equal(in_world(curve), before)


def test_modifiers_that_edit_mode_does_not_show(monkey, empty_scene):
    monkey.modifiers.new("Mirror", "MIRROR")
    subdivision(monkey)
    monkey.modifiers["Subdivision"].show_in_editmode = False
    bpy.ops.object.mode_set(mode="EDIT")
    surface = module(empty_scene, "scene.surface").read(monkey, True)
    assert len(surface.faces) < 3000  # without the subdivision
    assert (surface.cage.faces >= 0).all()


@pytest.mark.slow
def test_the_pose_is_followed(monkey):
    armature_and_subdivision(monkey)
    curve = draw(monkey)
    for frame in range(1, 21, 4):
        bpy.context.scene.frame_set(frame)
        assert bpy.ops.nicmm.update_curves() == {"FINISHED"}
        assert curve_deviation(curve, monkey) < EXACT


@pytest.mark.slow
def test_sticky_curves_follow_an_animated_pose(monkey):
    armature_and_subdivision(monkey)
    curve = draw(monkey, output="STICKY")
    for frame in range(1, 21):
        bpy.context.scene.frame_set(frame)
        assert curve_deviation(curve, monkey) < EXACT


@pytest.mark.slow
@pytest.mark.parametrize("level", [0, 2, 3])
def test_sticky_curves_follow_another_level(monkey, level):
    """A render may use more levels than the viewport."""
    armature_and_subdivision(monkey)
    curve = draw(monkey, output="STICKY")
    before = in_world(curve)
    monkey.modifiers["Subdivision"].levels = level
    for frame in (20, 5):
        bpy.context.scene.frame_set(frame)
        assert curve_deviation(curve, monkey) < EXACT
    bpy.context.scene.frame_set(20)
    # Without the modifier Suzanne is larger.
    assert scenes.distances_to(before, in_world(curve)).max() < (0.05 if level else 0.15)


@pytest.mark.slow
@pytest.mark.parametrize("change", [armature, simple_deform, shrinkwrap])
def test_cuts_are_exact_where_modifiers_only_deform(monkey, empty_scene, change):
    """The points of the curve keep their faces and barycentric coordinates on the mesh itself."""
    change(monkey)
    bpy.context.view_layer.objects.active = monkey
    curve = draw(monkey)
    cage = module(empty_scene, "scene.surface").read(monkey, False)
    (line,) = module(empty_scene, "scene.curve_record").read_curves(curve, cage)
    expected = cage.points(line.faces, line.barycentric)
    bpy.ops.nicmm.convert_curve(output="EDGES", cut_faces="TRIANGLES", simplify=0.0)
    chain = [edge for edge in monkey.data.edges if edge.use_seam]
    on = scenes.positions(monkey)[sorted({v for edge in chain for v in edge.vertices})]
    assert scenes.distances_to(expected, on).max() < 2e-3  # points near edges move onto them
    assert scenes.distances_to(on, expected).max() < 2e-3
    assert len(chain) > 20


@pytest.mark.slow
@pytest.mark.parametrize("output", ["EDGES", "REGION", "PARTS"])
def test_cuts_are_refused_where_modifiers_generate_faces(monkey, output):
    subdivision(monkey)
    count = len(monkey.data.vertices)
    with pytest.raises(RuntimeError, match="Apply them, or turn Use Modifiers off"):
        draw(monkey, output=output)
    assert len(monkey.data.vertices) == count
    draw(monkey, output=output, use_modifiers=False)


@pytest.mark.slow
def test_a_linked_mesh_is_not_written_to(monkey, tmp_path):
    subdivision(monkey)
    path = str(tmp_path / "library.blend")
    bpy.data.libraries.write(path, {monkey})
    name = monkey.name
    bpy.data.objects.remove(monkey)
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.objects = [name]
    (linked,) = wanted.objects
    bpy.context.scene.collection.objects.link(linked)
    curve = draw(linked)
    assert curve_deviation(curve, linked) < EXACT


def test_hidden_faces_are_known_in_edit_mode(monkey, empty_scene):
    subdivision(monkey)
    surface = module(empty_scene, "scene.surface")
    assert not surface.read(monkey, True).hidden.any()
    for polygon in monkey.data.polygons[:100]:
        polygon.hide = True
    assert not surface.read(monkey, True).hidden.any()
    bpy.ops.object.mode_set(mode="EDIT")
    assert surface.read(monkey, True).hidden.any()
    bpy.ops.object.mode_set(mode="OBJECT")


def without_faces(mesh_object):
    """Replace the mesh by one without faces, which modifiers make into a surface."""
    data = bpy.data.meshes.new("Edges")
    turns = np.linspace(0.0, 2 * np.pi, 12, endpoint=False)
    places = [(1.0 + 0.3 * np.cos(t), 0.0, 0.3 * np.sin(t)) for t in turns]
    data.from_pydata(places, [(i, (i + 1) % 12) for i in range(12)], [])
    mesh_object.data = data
    screw = mesh_object.modifiers.new("Screw", "SCREW")
    screw.steps = screw.render_steps = 24
    screw.use_merge_vertices = True


@pytest.mark.parametrize("output", ["CURVE", "STICKY"])
def test_a_surface_that_modifiers_make_of_edges(monkey, output):
    without_faces(monkey)
    bpy.context.view_layer.update()
    curve = draw_at(monkey, [(1.3, 0.0, 0.0), (0.0, 1.3, 0.0), (-1.3, 0.0, 0.0)], output)
    assert bpy.ops.nicmm.update_curves() == {"FINISHED"}
    assert curve.type == {"CURVE": "CURVE", "STICKY": "CURVES"}[output]


def draw_at(mesh_object, positions, output):
    """A curve through positions, drawn as with the tool."""
    scenes.activate(mesh_object)
    bpy.context.scene.nicmm_curves.output = output
    points = [{"name": "", "position": position} for position in positions]
    assert bpy.ops.nicmm.edit_curve("EXEC_DEFAULT", points=points, output=output) == {"FINISHED"}
    return bpy.context.active_object


def test_edit_mode_traces_modifiers_that_use_a_vertex_group(monkey, extension):
    group = monkey.vertex_groups.new(name="Left")
    left = np.flatnonzero(scenes.positions(monkey)[:, 0] > 0.2)
    group.add(left.tolist(), 1.0, "REPLACE")
    modifier = monkey.modifiers.new("Mask", "MASK")
    modifier.vertex_group, modifier.invert_vertex_group = "Left", True
    modifier.show_in_editmode = True
    surface = module(extension, "scene.surface")
    outside = surface.read(monkey, True).cage
    bpy.ops.object.mode_set(mode="EDIT")
    inside = surface.read(monkey, True).cage
    assert (outside.faces >= 0).all()
    np.testing.assert_array_equal(inside.faces, outside.faces)
