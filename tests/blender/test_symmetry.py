"""Symmetric curves in Blender: joined to their mirror image or a pair, edited, kept, refused."""

import itertools
from importlib import import_module

import bpy
import igl
import numpy as np
import pytest

from mathutils import Euler

from tests.blender import scenes
from tests.blender.scenes import module
from tests.blender.test_curve_list import run_timer
from tests.blender.test_point_operators import call, content, controls, refusal, undo_and_redo
from tests.blender.test_view import looking

pytestmark = pytest.mark.usefixtures("remembered_designs")

ROUNDING = 2e-6
SYMMETRIC = 1e-6
"""Greatest asymmetry on a symmetric mesh, in diagonals; the vertices are in single precision."""

THREE = [(0.3, -0.8, 0.5), (0.8, -0.5, 0.1), (0.4, -0.7, -0.6)]
"""Places near a unit sphere with x > 0."""


RING = {
    "JOINED": [(1.0, 0.7, 0.1), (0.9, -0.6, 0.2)],
    "PAIR": [(0.5, 1.0, 0.25), (1.25, 0.0, 0.1), (0.5, -1.0, 0.25)],
}
"""Places on a torus with x > 0."""


@pytest.fixture
def sphere(empty_scene):
    """A unit sphere that is symmetric in x, y and z."""
    made = octahedral_sphere()
    bpy.ops.ed.undo_push(message="Sphere")
    return made


def octahedral_sphere(pieces=12):
    """A sphere of triangles whose mirror images in x, y and z are triangles as well."""
    steps = range(pieces)
    upward = [(a, b, 1) for a in steps for b in steps if a + b < pieces]
    downward = [(a, b, 0) for a in steps for b in steps if 0 < min(a, b) and a + b <= pieces]
    corners, faces = [], []
    for signs in itertools.product((1, -1), repeat=3):
        for a, b, step in (*upward, *((a, b, -1) for a, b, _ in downward)):
            three = [(a, b), (a + step, b), (a, b + step)]
            places = [np.array([x, y, pieces - x - y]) * signs for x, y in three]
            faces.append(range(len(corners), len(corners) + 3))
            corners += places[:: int(np.prod(signs)) * step]
    distinct, number = np.unique(np.array(corners), axis=0, return_inverse=True)
    # Rounded so that the signs do not matter in single precision.
    onto = np.round(distinct / np.linalg.norm(distinct, axis=1)[:, None] * 2**14) / 2**14
    mesh = bpy.data.meshes.new("Sphere")
    mesh.from_pydata(onto, [], number.reshape(-1)[np.array(faces)].tolist())
    made = bpy.data.objects.new("Sphere", mesh)
    bpy.context.collection.objects.link(made)
    scenes.activate(made)
    return made


@pytest.fixture
def joined(sphere):
    """A closed curve through three points and their mirror images in X, active."""
    return draw(sphere)


@pytest.fixture
def pair(sphere):
    """A closed curve through three points with its mirror image in X, active."""
    return draw(sphere, mirror_as="PAIR")


def on(mesh_object, places):
    """The points of the mesh nearest to places; for a place with x = 0 the nearest such vertex."""
    vertices = scenes.positions(mesh_object)
    in_plane = vertices[vertices[:, 0] == 0.0]
    return [
        list(mesh_object.closest_point_on_mesh(place)[1])
        if place[0]
        else in_plane[np.linalg.norm(in_plane - place, axis=1).argmin()].tolist()
        for place in places
    ]


def text(places):
    return ", ".join(" ".join(map(repr, place)) for place in places)


def draw(mesh_object, places=THREE, **settings):
    scenes.activate(mesh_object)
    settings = {"points": text(on(mesh_object, places)), "mirror_axis": "X", **settings}
    call("design_curve", **settings)
    return bpy.context.active_object


def recorded_curves(curve):
    """The curves of the record, as curves of the core, with the surface and the mirror."""
    record = module_of("scene.curve_record")
    mesh_object = record.mesh_of(curve)
    surface = record.surface_of(curve, mesh_object)
    settings = record.settings_of(curve)
    mirror = module_of("scene.mirror_plane").mirror_of(mesh_object, surface, settings)
    return record.read_curves(curve, surface), surface, mirror


def module_of(name):
    return import_module(f"bl_ext.user_default.nicmm_curves.nicmm_blender.{name}")


def asymmetry(curve):
    """Greatest distance of the curves of an object to their mirror images, in diagonals."""
    curves, surface, mirror = recorded_curves(curve)
    reflection = import_module(f"{scenes.installed_core().__name__}.symmetry.reflection")
    diagonal = np.linalg.norm(np.ptp(surface.core_positions, axis=0))
    if mirror.joined:
        return reflection.asymmetry(curves[0], mirror.plane) / diagonal
    image = mirror.plane.reflected(curves[0].points)
    away = max(off_line(image, curves[1].points), off_line(curves[1].points, image))
    return away / diagonal


def off_line(points, line):
    """Greatest distance of points from a closed polyline."""
    number = np.arange(len(line))
    segments = np.stack([number, (number + 1) % len(line)], axis=1)
    return np.sqrt(igl.point_mesh_squared_distance(points, line, segments)[0].max())


def passes(curve, places):
    """Greatest distance of places in local space from the curves of the record."""
    curves, surface, _ = recorded_curves(curve)
    line = np.concatenate([surface.points(each.faces, each.barycentric) for each in curves])
    return scenes.distances_to(np.asarray(places), line).max()


def flipped(places, axis=0):
    return np.asarray(places) * np.where(np.arange(3) == axis, -1.0, 1.0)


# What is drawn.


@pytest.mark.parametrize("spline", ["EVEN", "EXACT", "BEZIER"])
def test_joined(sphere, spline):
    curve = draw(sphere, spline=spline)
    assert len(curve.data.splines) == 1 and curve.data.splines[0].use_cyclic_u
    assert asymmetry(curve) < SYMMETRIC
    places = on(sphere, THREE)
    np.testing.assert_allclose(controls(curve), places, atol=ROUNDING)
    assert passes(curve, [*places, *flipped(places)]) < ROUNDING
    assert list(curve["nicmm_curve"]["control_counts"]) == [6]


@pytest.mark.slow
@pytest.mark.parametrize("spline", ["EVEN", "EXACT", "BEZIER"])
def test_pair(sphere, spline):
    curve = draw(sphere, spline=spline, mirror_as="PAIR")
    assert [spline.use_cyclic_u for spline in curve.data.splines] == [True, True]
    assert asymmetry(curve) < SYMMETRIC
    places = on(sphere, THREE)
    np.testing.assert_allclose(controls(curve), places, atol=ROUNDING)
    assert passes(curve, [*places, *flipped(places)]) < ROUNDING
    assert list(curve["nicmm_curve"]["control_counts"]) == [3, 3]


@pytest.mark.slow
@pytest.mark.parametrize("how", ["JOINED", "PAIR"])
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("scale", [(1.0, 1.0, 1.0), (2.0, 0.7, 1.3)])
def test_planes_of_a_rotated_and_scaled_object(sphere, how, axis, scale):
    sphere.location, sphere.scale = (3.0, -1.0, 0.5), scale
    sphere.rotation_euler = Euler((0.4, 1.1, -0.7))
    bpy.context.view_layer.update()
    places = np.abs(THREE)
    curve = draw(sphere, places, mirror_axis="XYZ"[axis], mirror_as=how)
    assert asymmetry(curve) < SYMMETRIC
    places = on(sphere, places)
    assert passes(curve, [*places, *flipped(places, axis)]) < ROUNDING


@pytest.mark.slow
@pytest.mark.parametrize("on_plane", [(), (0,), (2,), (0, 2)])
def test_corners_and_points_on_the_plane(sphere, on_plane):
    """Which points have images decides which of them are sharp."""
    places = np.array(THREE)
    places[list(on_plane), 0] = 0.0
    curve = draw(sphere, places, corners="0, 1", spline="BEZIER")
    assert list(curve["nicmm_curve"]["corner_points"]) == [1, 1, 0]
    assert list(curve["nicmm_curve"]["control_counts"]) == [6 - len(on_plane)]
    points = curve.data.splines[0].bezier_points
    sharp = [point.co[:] for point in points if point.handle_left_type == "FREE"]
    expected = on(sphere, places[:2])
    expected += [place for place in flipped(expected).tolist() if place[0]]
    assert len(sharp) == len(expected)
    assert scenes.distances_to(np.array(expected), np.array(sharp)).max() < ROUNDING
    assert asymmetry(curve) < SYMMETRIC


@pytest.mark.slow
def test_corners_of_a_pair(sphere):
    curve = draw(sphere, corners="1", spline="BEZIER", mirror_as="PAIR")
    kinds = [
        [point.handle_left_type for point in spline.bezier_points].count("FREE")
        for spline in curve.data.splines
    ]
    assert kinds == [1, 1]


def test_the_shortest_order(sphere):
    places = [THREE[0], THREE[2], THREE[1]]
    curve = draw(sphere, places, order="SHORTEST")
    np.testing.assert_allclose(controls(curve), on(sphere, THREE), atol=ROUNDING)


def test_selected_vertices(sphere):
    """Of vertices selected on one side."""
    vertices = scenes.nearest_vertices(sphere, THREE)
    scenes.select(sphere, vertices)
    call("design_curve", mirror_axis="X")
    curve = bpy.context.active_object
    assert len(controls(curve)) == 3 and asymmetry(curve) < SYMMETRIC


@pytest.mark.slow
@pytest.mark.parametrize("how", ["JOINED", "PAIR"])
def test_alternatives_are_symmetric(empty_scene, how):
    bpy.ops.mesh.primitive_torus_add(major_segments=24, minor_segments=12)
    torus = bpy.context.active_object
    draw(torus, RING[how], alternatives=3, mirror_as=how)
    drawn = scenes.curves()
    assert len(drawn) > 1
    for curve in drawn:
        assert len(curve.data.splines) == (1 if how == "JOINED" else 2)
        assert asymmetry(curve) < SYMMETRIC


@pytest.mark.slow
def test_other_methods_have_no_mirror(sphere):
    curve = draw(sphere, method="VARIATIONAL")
    asked = curve["nicmm_curve"]["asked"]
    assert asked["mirror_axis"] == "NONE"
    assert list(curve["nicmm_curve"]["control_counts"]) == [3]


# The Mirror modifier.


@pytest.fixture
def half(empty_scene):
    """Half of a sphere, with x > 0, that a Mirror modifier completes."""
    made = octahedral_sphere()
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.bisect(plane_co=(0, 0, 0), plane_no=(1, 0, 0), clear_inner=True)
    bpy.ops.object.mode_set(mode="OBJECT")
    made.modifiers.new("Mirror", "MIRROR")
    return made


@pytest.mark.slow
@pytest.mark.parametrize("how", ["JOINED", "PAIR"])
def test_the_modifier_has_the_plane(half, how):
    curve = draw(half, mirror_axis="MODIFIER", mirror_as=how)
    assert asymmetry(curve) < SYMMETRIC
    assert passes(curve, flipped(on(half, THREE))) < ROUNDING


@pytest.mark.slow
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_the_modifier_has_a_mirror_object(half, axis):
    """The plane is that of the other object; it need not pass through the origin of the mesh."""
    half.location, half.rotation_euler = (1.0, 2.0, 3.0), Euler((0.3, 0.2, 0.1))
    empty = bpy.data.objects.new("Plane", None)
    bpy.context.collection.objects.link(empty)
    # One axis of the empty, which is scaled, is the x axis of the mesh, 0.2 from its boundary.
    turned = {0: (0, 0, 0), 1: (0, 0, np.pi / 2), 2: (0, np.pi / 2, 0)}[axis]
    empty.scale = (1.0, 2.0, 0.5)
    bpy.context.view_layer.update()
    empty.matrix_world = half.matrix_world @ Euler(turned).to_matrix().to_4x4()
    for vertex in half.data.vertices:
        vertex.co.x -= 0.2
    modifier = half.modifiers["Mirror"]
    modifier.mirror_object = empty
    modifier.use_axis = [number == axis for number in range(3)]
    modifier.use_bisect_axis = modifier.use_axis
    modifier.use_bisect_flip_axis = [axis == 2] * 3
    bpy.context.view_layer.update()
    curve = draw(half, mirror_axis="MODIFIER")
    assert asymmetry(curve) < SYMMETRIC
    assert passes(curve, flipped(on(half, THREE))) < 10 * ROUNDING
    before = curve.data["nicmm_designed_on"]
    empty.location.x += 0.05
    bpy.context.view_layer.update()
    assert bpy.ops.nicmm.update_curves() == {"FINISHED"}
    assert curve.data["nicmm_designed_on"] != before
    assert asymmetry(curve) < SYMMETRIC


def test_refusals_of_the_modifier(half):
    modifier = half.modifiers["Mirror"]
    modifier.use_axis = (False, False, False)
    bpy.context.view_layer.update()
    given = {"points": "0, 1, 2", "mirror_axis": "MODIFIER"}
    assert "has no axis enabled" in refusal("design_curve", **given)
    modifier.show_viewport = False
    assert "has no Mirror modifier" in refusal("design_curve", **given)
    half.modifiers.clear()
    assert "has no Mirror modifier" in refusal("design_curve", **given)


def test_the_cage_has_no_other_half(half):
    given = {"points": text(on(half, THREE)), "mirror_axis": "MODIFIER", "use_modifiers": False}
    message = refusal("design_curve", **given)
    assert "the mirror image of point" in message.lower() and "choose another plane" in message


# Editing.


@pytest.mark.slow
def test_points_and_images_move_together(joined, sphere):
    place = on(sphere, [(0.5, -0.8, 0.3)])
    call("move_point", index=1, position=place[0])
    assert passes(joined, [*place, *flipped(place)]) < ROUNDING
    assert asymmetry(joined) < SYMMETRIC
    place = on(sphere, [(0.9, -0.3, 0.2)])
    call("move_point", index=1, position=flipped(place)[0].tolist(), image=True)
    np.testing.assert_allclose(controls(joined)[1], place[0], atol=ROUNDING)
    assert asymmetry(joined) < SYMMETRIC


@pytest.mark.slow
def test_points_of_a_pair_move_with_their_images(pair, sphere):
    place = on(sphere, [(0.9, -0.3, 0.2)])
    call("move_point", index=1, position=flipped(place)[0].tolist(), image=True)
    np.testing.assert_allclose(controls(pair)[1], place[0], atol=ROUNDING)
    assert asymmetry(pair) < SYMMETRIC
    call("move_point", index=1, position=on(sphere, [(0.8, -0.5, 0.1)])[0])
    assert asymmetry(pair) < SYMMETRIC
    call("insert_point", index=1, position=flipped(on(sphere, [(0.6, -0.7, 0.4)]))[0], image=True)
    assert (controls(pair)[:, 0] > 0.0).all() and len(controls(pair)) == 4
    assert list(pair["nicmm_curve"]["control_counts"]) == [4, 4]
    call("remove_point", index=0)
    assert list(pair["nicmm_curve"]["control_counts"]) == [3, 3]
    assert asymmetry(pair) < SYMMETRIC


@pytest.mark.slow
def test_points_of_the_other_side_are_mirrored(joined, sphere):
    place = on(sphere, [(-0.2, -0.7, -0.8)])
    call("add_point", position=place[0])
    np.testing.assert_allclose(controls(joined)[3], flipped(place)[0], atol=ROUNDING)
    call("insert_point", index=0, position=on(sphere, [(-0.2, -0.6, 0.9)])[0])
    assert len(controls(joined)) == 5 and (controls(joined)[:, 0] > 0.0).all()
    assert asymmetry(joined) < SYMMETRIC


@pytest.mark.slow
def test_drawing_point_by_point(sphere):
    """One point and its image are an open curve, two points and theirs a closed one."""
    bpy.context.scene.nicmm_curves.mirror_axis = "X"
    places = on(sphere, THREE)
    counts, closed = [2, 4, 6], [False, True, True]
    for number, place in enumerate(places):
        call("add_point", position=place)
        curve = bpy.context.active_object
        record = curve["nicmm_curve"]
        assert list(record["control_counts"]) == [counts[number]]
        assert list(record["closed"]) == [closed[number]]
        assert len(controls(curve)) == number + 1
        assert asymmetry(curve) < SYMMETRIC
    for number in (2, 1, 0):
        call("remove_point", index=number)
    assert len(controls(curve)) == 0 and not curve.data.splines


@pytest.mark.parametrize("is_closed", [True, False])
def test_points_on_the_plane(sphere, is_closed):
    """The first point on the plane is no curve yet."""
    panel = bpy.context.scene.nicmm_curves
    panel.mirror_axis, panel.closed = "X", is_closed
    top, front = on(sphere, [(0.0, -0.6, 0.8), (0.0, -0.8, -0.6)])
    side = on(sphere, [THREE[1]])[0]
    if is_closed:
        call("add_point", position=top)
        curve = bpy.context.active_object
        assert list(curve["nicmm_curve"]["counts"]) == []
        call("add_point", position=front)
        assert list(curve["nicmm_curve"]["counts"]) == []
        call("insert_point", index=1, position=side)
        assert list(curve["nicmm_curve"]["control_counts"]) == [4]
    else:
        call("add_point", position=side)
        call("add_point", position=front)
        curve = bpy.context.active_object
        assert list(curve["nicmm_curve"]["control_counts"]) == [3]
        message = refusal("add_point", position=on(sphere, [THREE[2]])[0])
        assert "Point 2 is on the mirror" in message
        assert "Point 1 is on the mirror" in refusal("move_point", index=0, position=top)
    assert asymmetry(curve) < SYMMETRIC


@pytest.mark.slow
def test_each_change_is_one_undo_step(pair, sphere):
    states = [content()]
    for name, arguments in (
        ("move_point", {"index": 0, "position": on(sphere, [(0.4, -0.8, 0.5)])[0]}),
        ("toggle_corner", {"index": 1}),
        ("remove_point", {"index": 2}),
    ):
        call(name, **arguments)
        states.append(content())
    undo_and_redo(states)


@pytest.mark.slow
def test_via_points(joined, sphere):
    """Also on the leg that crosses the plane, and given on the other side."""
    call("add_via_point", leg=0, position=on(sphere, [(-0.7, -0.7, 0.4)])[0])
    call("add_via_point", leg=2, position=on(sphere, [(0.2, -0.8, -0.7)])[0])
    record = joined["nicmm_curve"]
    assert list(record["via_legs"]) == [0, 2]
    assert (np.array(record["via_positions"]).reshape(-1, 3)[:, 0] > 0.0).all()
    assert asymmetry(joined) < SYMMETRIC
    assert "There is no leg 3; the curve has 3" in refusal(
        "add_via_point", leg=3, position=on(sphere, [THREE[0]])[0]
    )
    call("insert_point", index=3, position=on(sphere, [(0.3, -0.75, -0.65)])[0])
    assert list(joined["nicmm_curve"]["via_legs"]) == [0, 3]
    call("remove_point", index=0)
    assert list(joined["nicmm_curve"]["via_legs"]) == [2]
    call("remove_point", index=2)
    assert list(joined["nicmm_curve"]["via_legs"]) == [1]
    call("move_via_point", index=0, position=on(sphere, [(-0.25, -0.8, -0.65)])[0])
    assert np.array(joined["nicmm_curve"]["via_positions"])[0] > 0.0


def test_via_points_in_scripts(sphere):
    via = "0: " + text(on(sphere, [(0.7, -0.7, 0.4)]))
    curve = draw(sphere, via_points=via)
    assert list(curve["nicmm_curve"]["via_legs"]) == [0]
    assert asymmetry(curve) < SYMMETRIC


# Settings.


@pytest.mark.slow
def test_settings_take_effect_immediately(joined):
    values = joined.nicmm_settings
    assert (values.mirror_axis, values.mirror_as) == ("X", "JOINED")
    values.mirror_as = "PAIR"
    assert len(joined.data.splines) == 2 and asymmetry(joined) < SYMMETRIC
    values.mirror_axis = "Y"
    assert asymmetry(joined) < SYMMETRIC
    values.smoothness = 2.0
    assert len(joined.data.splines) == 2 and asymmetry(joined) < SYMMETRIC
    values.spline = "BEZIER"
    assert [spline.type for spline in joined.data.splines] == ["BEZIER", "BEZIER"]
    values.mirror_axis = "NONE"
    assert len(joined.data.splines) == 1
    assert list(joined["nicmm_curve"]["control_counts"]) == [3]
    values.mirror_axis, values.mirror_as = "X", "JOINED"
    assert asymmetry(joined) < SYMMETRIC


@pytest.mark.slow
def test_points_on_both_sides(sphere, empty_scene):
    curve = draw(sphere, [(0.5, -0.8, 0.4), (-0.6, -0.7, 0.0), (0.3, -0.8, -0.5)], mirror_as="PAIR")
    assert asymmetry(curve) < SYMMETRIC
    curve.nicmm_settings.mirror_as = "JOINED"
    assert curve.nicmm_settings.mirror_as == "PAIR"
    problem = module(empty_scene, "operators.curve_settings").problem_of(curve)
    assert problem.startswith("Point 1 and point 2 are on different sides of the mirror")
    assert "keep the points of one side" in problem


@pytest.mark.slow
def test_edit_curve_in_scripts(sphere):
    points = [{"name": "", "position": tuple(place)} for place in on(sphere, THREE)]
    call("edit_curve", points=points, mirror_axis="X", mirror_as="PAIR")
    curve = bpy.context.active_object
    assert len(curve.data.splines) == 2 and asymmetry(curve) < SYMMETRIC
    call("edit_curve", smoothness=1.0)
    assert len(curve.data.splines) == 2
    call("edit_curve", mirror_as="JOINED", corners="1")
    assert list(curve["nicmm_curve"]["control_counts"]) == [6]
    assert asymmetry(curve) < SYMMETRIC


def test_command_line(sphere, empty_scene, tmp_path):
    before, after = tmp_path / "in.blend", tmp_path / "out.blend"
    given = text(on(sphere, THREE))
    bpy.ops.wm.save_as_mainfile(filepath=str(before))
    main = import_module(f"{empty_scene.name}.nicmm_blender.command_line").main
    files = ["--file", str(before), "--output-file", str(after)]
    assert main([*files, "--points", given, "--mirror-axis", "x", "--mirror-as", "pair"]) == 0
    bpy.ops.wm.open_mainfile(filepath=str(after))
    (curve,) = scenes.curves()
    assert len(curve.data.splines) == 2 and asymmetry(curve) < SYMMETRIC


# Courses.


@pytest.mark.slow
@pytest.mark.parametrize("how", ["JOINED", "PAIR"])
def test_next_course(empty_scene, how):
    bpy.ops.mesh.primitive_torus_add(major_segments=24, minor_segments=12)
    torus = bpy.context.active_object
    curve = draw(torus, RING[how], mirror_as=how)
    before = scenes.points(curve)
    call("next_course")
    assert scenes.distances_to(before, scenes.points(curve)).max() > 0.1
    assert len(curve.data.splines) == (1 if how == "JOINED" else 2)
    assert asymmetry(curve) < SYMMETRIC
    if how == "JOINED":
        assert "has no other courses of its own" in refusal("next_course", leg=0)
    else:
        call("next_course", leg=2)
        assert len(curve.data.splines) == 2 and asymmetry(curve) < SYMMETRIC


# Outputs.


@pytest.mark.parametrize("how", ["JOINED", "PAIR"])
def test_sticky_curves(sphere, how):
    curve = draw(sphere, output="STICKY", mirror_as=how)
    assert len(curve.data.curves) == (1 if how == "JOINED" else 2)
    points = scenes.evaluated_points(curve)
    places = on(sphere, THREE)
    both = np.concatenate([places, flipped(places)])
    assert scenes.distances_to(both, points).max() < ROUNDING
    call("move_point", index=0, position=on(sphere, [(0.4, -0.8, 0.5)])[0])
    assert asymmetry(curve) < SYMMETRIC


@pytest.mark.parametrize("output", ["EDGES", "REGION", "PARTS"])
def test_cuts(sphere, output):
    draw(sphere, output=output, region_cut=True)
    if output == "REGION":
        chosen = [face for face in sphere.data.polygons if face.select]
        right, left = (
            sum(face.area for face in chosen if sign * face.center.x > 0.0) for sign in (1, -1)
        )
        assert right > 0.3 and left == pytest.approx(right, rel=1e-4)
    else:
        assert len(sphere.data.vertices) > 578


def test_a_pair_cannot_be_cut(sphere, pair):
    scenes.activate(sphere)
    given = {"points": text(on(sphere, THREE)), "mirror_axis": "X", "mirror_as": "PAIR"}
    message = "The mesh cannot be cut along a pair"
    assert message in refusal("design_curve", **given, output="EDGES")
    scenes.activate(pair)
    assert message in refusal("convert_curve", output="REGION")


@pytest.mark.slow
@pytest.mark.parametrize("how", ["JOINED", "PAIR"])
def test_conversions_keep_the_mirror(sphere, how):
    curve = draw(sphere, mirror_as=how, corners="1")
    before = controls(curve)
    call("convert_curve", output="STICKY")
    call("convert_curve", output="CURVE", spline="BEZIER")
    curve = bpy.context.active_object
    np.testing.assert_array_equal(controls(curve), before)
    assert list(curve["nicmm_curve"]["corner_points"]) == [0, 1, 0]
    assert curve["nicmm_curve"]["asked"]["mirror_as"] == how
    assert asymmetry(curve) < SYMMETRIC
    call("move_point", index=0, position=on(sphere, [(0.4, -0.8, 0.5)])[0])
    assert asymmetry(curve) < SYMMETRIC


# Updates.


@pytest.mark.slow
@pytest.mark.parametrize("how", ["JOINED", "PAIR"])
def test_updates(sphere, how):
    curve = draw(sphere, mirror_as=how)
    for vertex in sphere.data.vertices:
        vertex.co.z += 0.3 * vertex.co.y
    sphere.data.update()
    assert bpy.ops.nicmm.update_curves() == {"FINISHED"}
    assert asymmetry(curve) < SYMMETRIC
    assert len(curve.data.splines) == (1 if how == "JOINED" else 2)
    sphere.modifiers.new("Subdivision", "SUBSURF").levels = 1
    assert bpy.ops.nicmm.update_curves() == {"FINISHED"}
    assert asymmetry(curve) < SYMMETRIC


@pytest.mark.slow
@pytest.mark.parametrize("how", ["JOINED", "PAIR"])
def test_live(sphere, empty_scene, how):
    curve = draw(sphere, mirror_as=how)
    bpy.context.scene.nicmm_live_update = True
    live = module(empty_scene, "operators.live_update")
    run_timer(live)
    before = scenes.points(curve)
    for vertex in sphere.data.vertices:
        vertex.co.z += 0.3 * vertex.co.y
    sphere.data.update()
    bpy.context.view_layer.update()
    assert run_timer(live) > 0
    assert not live.messages(sphere)
    assert scenes.distances_to(before, scenes.points(curve)).max() > 0.01
    assert asymmetry(curve) < SYMMETRIC
    assert run_timer(live) == 0


@pytest.mark.slow
def test_live_follows_the_mirror_object(half, empty_scene):
    empty = bpy.data.objects.new("Plane", None)
    bpy.context.collection.objects.link(empty)
    for vertex in half.data.vertices:
        vertex.co.x -= 0.2
    half.modifiers["Mirror"].mirror_object = empty
    half.modifiers["Mirror"].use_bisect_axis[0] = True
    bpy.context.view_layer.update()
    curve = draw(half, mirror_axis="MODIFIER")
    bpy.context.scene.nicmm_live_update = True
    live = module(empty_scene, "operators.live_update")
    run_timer(live)
    empty.location.x = 0.05
    bpy.context.view_layer.update()
    assert run_timer(live) > 0
    assert not live.messages(half)
    assert asymmetry(curve) < SYMMETRIC


# Reports.


@pytest.mark.slow
def test_asymmetry_is_reported(sphere, empty_scene):
    """On a mesh that is only nearly symmetric."""
    generator = np.random.default_rng(0)
    for vertex in sphere.data.vertices:
        vertex.co += type(vertex.co)(generator.normal(0.0, 4e-3, 3))
    sphere.data.update()
    text_of = module(empty_scene, "operators.asymmetry_report").asymmetry_text
    record = module(empty_scene, "scene.curve_record")
    surface = record.read(sphere, True)
    core = empty_scene.core
    mesh = core.Mesh(surface.core_positions, surface.faces)
    plane = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    points = scenes.nearest_vertices(sphere, THREE)
    design = core.design_curve(mesh, points, mirror=plane)
    assert design.asymmetry > 1e-4
    units = bpy.context.scene.unit_settings
    units.system = "NONE"
    assert text_of(bpy.context.scene, surface, design) == f"; asymmetry {design.asymmetry:.2g}"
    units.system = "METRIC"
    words = text_of(bpy.context.scene, surface, design)
    number, unit = words.removeprefix("; asymmetry ").split()
    assert float(number) * {"mm": 1e-3, "cm": 1e-2}[unit] == pytest.approx(
        design.asymmetry, rel=0.05
    )
    assert text_of(bpy.context.scene, surface, core.design_curve(mesh, points)) == ""


# Records.


@pytest.mark.slow
@pytest.mark.parametrize("how", ["JOINED", "PAIR"])
def test_files_keep_the_mirror(sphere, how, tmp_path):
    curve = draw(sphere, mirror_as=how)
    path, name = str(tmp_path / "symmetric.blend"), curve.name
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    curve = bpy.data.objects[name]
    scenes.activate(curve)
    call("toggle_corner", index=1)
    assert asymmetry(curve) < SYMMETRIC


@pytest.mark.parametrize(
    ("name", "value"), [("mirror_axis", "W"), ("mirror_as", "TRIPLE"), ("mirror_axis", 3)]
)
def test_damaged_settings_are_refused(joined, name, value):
    joined["nicmm_curve"]["asked"][name] = value
    assert f"its setting {name} is" in refusal("toggle_corner", index=0)


def test_a_record_that_does_not_fit_its_mirror_is_refused(joined):
    joined["nicmm_curve"]["asked"]["mirror_as"] = "PAIR"
    assert "does not fit its control points and its mirror" in refusal("toggle_corner", index=0)


# The tool.


def test_images_in_the_tool(joined, empty_scene):
    edited_curve = module(empty_scene, "outputs.edited_curve")
    opened = edited_curve.open_curve(bpy.context, joined)
    assert opened.images.owners.tolist() == [0, 1, 2]
    np.testing.assert_allclose(opened.image_positions(), flipped(opened.positions()), atol=ROUNDING)
    half = module(empty_scene, "scene.mirror_images").half_of(
        opened.surface, opened.mirror, opened.points.places
    )
    # Legs of the whole curve: two of the half, one across the plane, two back, one across.
    assert [half.leg_of(leg) for leg in range(6)] == [0, 1, 2, 1, 0, -1]
    assert half.path() == (4, False)


@pytest.mark.parametrize(
    ("on_plane", "legs"),
    [
        ((True, False), [0, 1, 2, 1, 0]),
        ((False, True), [0, 1, 1, 0, -1]),
        ((True, True), [0, 1, 1, 0]),
    ],
)
def test_legs_with_points_on_the_plane(empty_scene, on_plane, legs):
    half = module(empty_scene, "scene.mirror_images").Half(3, 6 - sum(on_plane), *on_plane)
    assert [half.leg_of(leg) for leg in range(half.total)] == legs


def opened_and_view(extension, curve=None):
    edited_curve = module(extension, "outputs.edited_curve")
    opened = edited_curve.open_curve(bpy.context, curve)
    return opened, looking(extension, opened)


@pytest.mark.parametrize("pixels", [4.0, -7.0, 9.0, -20.0])
def test_points_snap_to_the_plane(joined, empty_scene, pixels):
    opened, view = opened_and_view(empty_scene, joined)
    snap = module(empty_scene, "tool.mirror_snap")
    on_plane = view.project(np.array([[0.0, -0.95, 0.3]]))[0]
    place = view.surface_point_at(on_plane + [pixels, 0.0])
    found = snap.snapped(view, opened, place, 1.0)
    position = opened.surface.points(found.faces, found.barycentric)[0]
    if abs(pixels) < snap.REACH:
        assert abs(position[0]) < 1e-9
        assert (
            np.linalg.norm(position - opened.surface.points(place.faces, place.barycentric)) < 0.1
        )
    else:
        assert found is place


@pytest.mark.slow
def test_which_points_may_be_on_the_plane(sphere, empty_scene):
    snap = module(empty_scene, "tool.mirror_snap")
    panel = bpy.context.scene.nicmm_curves
    scenes.activate(sphere)
    for axis, closed, wanted in (("X", True, True), ("X", False, False), ("NONE", True, False)):
        panel.mirror_axis, panel.closed = axis, closed
        assert snap.may_end_on_plane(opened_and_view(empty_scene)[0]) == wanted
    for closed, ends in ((True, {0, 2}), (False, {2})):
        opened, _ = opened_and_view(empty_scene, draw(sphere, closed=closed))
        assert snap.ends(opened, 3) == ends
        assert snap.may_end_on_plane(opened) and snap.may_be_inserted_on_plane(opened, 3)
        assert snap.may_be_inserted_on_plane(opened, 0) == closed
        assert not snap.may_be_inserted_on_plane(opened, 1)
    opened, _ = opened_and_view(empty_scene, draw(sphere, mirror_as="PAIR"))
    assert not snap.may_end_on_plane(opened)


@pytest.mark.parametrize("how", ["JOINED", "PAIR"])
def test_clicks_on_the_curve_and_its_image(sphere, empty_scene, how):
    """They lead to the same leg of the points of one side, and snap to the plane between them."""
    curve = draw(sphere, mirror_as=how)
    opened, view = opened_and_view(empty_scene, curve)
    picking = module(empty_scene, "tool.picking")
    core = import_module(f"{scenes.installed_core().__name__}.geometry.curve")
    for leg in (0, 1):
        segment = int(core.points_of_leg(opened.curve, leg)[5])
        place = opened.lines()[0][segment]
        for each, wanted in zip((place, flipped(place)), ("", "image"), strict=True):
            found = [
                (line, view.nearest_on_line(view.project(each[None])[0], line, 3.0))
                for line in opened.lines()
            ]
            number = next(k for k, (_, hit) in enumerate(found) if hit is not None)
            hit = picking._on_line(
                opened, opened.curves[number], view, curve.name, 1.0, *found[number][1]
            )
            assert hit.index == leg + 1
            assert hit.is_image == (how == "PAIR" and wanted == "image")
            np.testing.assert_allclose(hit.position, each, atol=0.01)
    if how == "JOINED":
        segments = core.points_of_leg(opened.curve, 2)
        heights = np.abs(opened.lines()[0][segments][:, 0])
        hit = picking._on_line(
            opened, opened.curve, view, curve.name, 1.0, int(segments[heights.argmin()]), 0.0
        )
        assert hit.index == 3 and abs(hit.position[0]) < 1e-9


def test_a_dragged_pair_follows(pair, sphere, empty_scene):
    """Each move gives both curves, and so does the design that is taken in the end."""
    edited_curve = module(empty_scene, "outputs.edited_curve")
    opened = edited_curve.open_curve(bpy.context, pair)
    (request,) = edited_curve.request(opened, opened.points)
    live = module(empty_scene, "tool.live_curve").LiveCurve(request)
    place = edited_curve.surface_points_at(opened, np.array(on(sphere, [(0.4, -0.8, 0.45)])), "p")
    live.move(edited_curve.with_point(opened.points, 0, place, replaced=True))
    for _ in range(80):
        assert len(live.curves) == 2 and not live.problem
        image = flipped(live.curves[0].points)
        assert off_line(image, live.curves[1].points) < 1e-5
        live.step()
    design = live.design
    assert [curve.closed for curve in design.curves] == [True, True]
    live.set_result(design)
    assert len(live.request.start.curves) == 1 and len(live.curves) == 2
