"""How objects show a curve: even, exact and Bézier splines, radius and offset."""

import bpy
import igl
import numpy as np
import pytest

from mathutils import Euler, Matrix

from tests.blender import scenes
from tests.blender.test_shown_surface import CHOSEN, curve_deviation, in_world, shown

pytestmark = pytest.mark.usefixtures("remembered_designs")

SINGLE = 1e-6
"""Rounding of single precision, in diagonals."""

CLEAN = 1.05e-4
"""Largest distance of a clean curve from the exact curve, in diagonals.

It is slightly above the tolerance, since the check samples the curves.
"""


def draw(mesh_object, **settings):
    bpy.context.view_layer.objects.active = mesh_object
    text = ", ".join(map(str, CHOSEN))
    assert bpy.ops.nicmm.design_curve(points=text, **settings) == {"FINISHED"}
    return bpy.context.active_object


@pytest.mark.parametrize("spline", ["EVEN", "BEZIER", "EXACT"])
def test_a_mesh_of_separate_triangles(empty_scene, spline):
    """Imported files often have faces without common vertices."""
    ball = scenes.sphere()
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.edge_split()
    bpy.ops.object.mode_set(mode="OBJECT")
    assert len(ball.data.vertices) == 3 * len(ball.data.polygons)
    chosen = ", ".join(map(str, scenes.ring(ball, 4)))
    assert bpy.ops.nicmm.design_curve(points=chosen, spline=spline) == {"FINISHED"}
    assert np.linalg.norm(outline(bpy.context.active_object), axis=1).min() > 0.97


def on_segments(points, line):
    """Distances from points to a closed polyline."""
    start, step = line, np.roll(line, -1, axis=0) - line
    to = points[:, None] - start[None]
    squared = np.maximum((step * step).sum(axis=1), 1e-30)
    share = np.clip((to * step).sum(axis=2) / squared, 0.0, 1.0)
    return np.linalg.norm(to - share[..., None] * step, axis=2).min(axis=1)


def outline(curve, steps=24):
    """World positions of dense samples along the first spline of a curve object."""
    spline = curve.data.splines[0]
    if spline.type == "POLY":
        return in_world(curve)
    knots, left, right = (
        scenes.get(spline.bezier_points, name, 3).astype(float)
        for name in ("co", "handle_left", "handle_right")
    )
    t = np.linspace(0.0, 1.0, steps, endpoint=False)[:, None, None]
    first, second = knots, right
    third, last = np.roll(left, -1, axis=0), np.roll(knots, -1, axis=0)
    points = (
        (1 - t) ** 3 * first
        + 3 * t * (1 - t) ** 2 * second
        + 3 * t**2 * (1 - t) * third
        + t**3 * last
    )
    local = points.transpose(1, 0, 2).reshape(-1, 3)
    world = np.array(curve.matrix_world)
    return local @ world[:3, :3].T + world[:3, 3]


@pytest.fixture
def monkey(empty_scene):
    made = scenes.monkey()
    made.modifiers.new("Subdivision", "SUBSURF").levels = 2
    return made


def diagonal(mesh_object):
    return float(np.linalg.norm(np.ptp(shown(mesh_object)[0], axis=0)))


@pytest.mark.slow
@pytest.mark.parametrize("spline", ["EVEN", "BEZIER"])
@pytest.mark.parametrize("scale", [(1, 1, 1), (1.0, 0.3, 2.0)])
def test_clean_splines_are_near_the_exact_one(monkey, spline, scale):
    monkey.scale = scale
    monkey.rotation_euler = Euler((0.5, 0.1, 0.7))
    exact = in_world(draw(monkey, spline="EXACT"))
    clean = draw(monkey, spline=spline)
    bpy.context.view_layer.update()
    limit = CLEAN * diagonal(monkey)
    assert on_segments(outline(clean), exact).max() < limit
    assert on_segments(exact, outline(clean)).max() < limit
    vertices, _ = shown(monkey)
    points = clean.data.splines[0]
    knots = points.bezier_points if spline == "BEZIER" else points.points
    local = scenes.get(knots, "co", 3 if spline == "BEZIER" else 4)[:, :3].astype(float)
    world = np.array(clean.matrix_world)
    at = local @ world[:3, :3].T + world[:3, 3]
    assert scenes.distances_to(vertices[list(CHOSEN)], at).max() < SINGLE * diagonal(monkey)
    assert len(knots) < len(exact)


@pytest.mark.slow
def test_even_points_are_on_the_surface_and_evenly_spaced(monkey):
    curve = draw(monkey)
    assert curve_deviation(curve, monkey) < SINGLE
    points = in_world(curve)
    vertices, _ = shown(monkey)
    controls = [int(np.linalg.norm(points - vertices[v], axis=1).argmin()) for v in CHOSEN]
    lengths = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
    bounds = sorted(controls)
    for first, last in zip(bounds, [*bounds[1:], bounds[0] + len(points)], strict=True):
        leg = lengths[np.arange(first, last) % len(points)]
        assert leg.min() >= 0.5 * leg.mean()


@pytest.mark.slow
def test_the_tube_has_the_radius_in_the_scene_whatever_the_scale(monkey):
    """All rings of the tube are circles with the given radius, even on a sheared object."""
    bpy.ops.object.empty_add(rotation=(0.4, 0.2, 0.9))
    monkey.parent = bpy.context.object
    monkey.scale = (1.0, 0.3, 2.0)
    monkey.rotation_euler = Euler((0.5, 0.1, 0.7))
    bpy.context.view_layer.update()
    curve = draw(monkey, radius=0.02)
    line, tube = in_world(curve), shown_tube(curve)
    assert most_are(on_segments(tube, line), 0.02)
    sticky = draw(monkey, radius=0.02, output="STICKY", tube=True)
    tube = shown_tube(sticky)
    assert most_are(on_segments(tube, line), 0.02)


def most_are(distances, radius):
    """Whether nine of ten distances are close to a radius.

    On the inside of sharp bends the tube overlaps itself, and on the outside it has corners.
    """
    return np.abs(np.percentile(distances, [5.0, 50.0, 95.0]) / radius - 1.0).max() < 0.05


def shown_tube(curve):
    """World positions of the vertices of the mesh that an object shows."""
    evaluated = curve.evaluated_get(bpy.context.evaluated_depsgraph_get())
    if curve.type == "CURVES":
        geometry = evaluated.evaluated_geometry()  # keeps a reference: it owns the mesh
        local = scenes.get(geometry.mesh.vertices, "co", 3).astype(float)
    else:
        mesh = evaluated.to_mesh()
        local = scenes.get(mesh.vertices, "co", 3).astype(float)
        evaluated.to_mesh_clear()
    world = np.array(curve.matrix_world)
    return local @ world[:3, :3].T + world[:3, 3]


@pytest.mark.slow
@pytest.mark.parametrize("scale", [1.0, 3.0])
def test_radius_zero_is_a_share_of_the_size(monkey, scale):
    monkey.scale = (scale,) * 3
    bpy.context.view_layer.update()
    curve = draw(monkey, thickness=0.01)
    assert curve.data.bevel_depth * curve.matrix_world.to_scale().x == pytest.approx(
        0.01 * diagonal(monkey), rel=1e-4
    )
    assert draw(monkey, radius=0.5).data.bevel_depth * scale == pytest.approx(0.5, rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("output", ["CURVE", "STICKY"])
@pytest.mark.parametrize("spline", ["EVEN", "EXACT"])
def test_offset_lifts_the_curve_off_the_skin(monkey, output, spline):
    monkey.scale = (2.0, 2.0, 2.0)
    bpy.context.view_layer.update()
    curve = draw(monkey, output=output, spline=spline, offset=0.05)
    vertices, faces = shown(monkey)
    squared, *_ = igl.point_mesh_squared_distance(in_world(curve), vertices, faces)
    assert np.sqrt(squared).max() < 0.0501
    assert np.median(np.sqrt(squared)) == pytest.approx(0.05, abs=0.002)
    centre = vertices.mean(axis=0)
    base = in_world(draw(monkey, output=output, spline=spline))
    outside = np.linalg.norm(in_world(curve) - centre, axis=1).mean()
    assert outside > np.linalg.norm(base - centre, axis=1).mean()


@pytest.mark.parametrize("output", ["CURVE", "STICKY"])
@pytest.mark.parametrize("scale", [(1, 1, 1), (-1, 1, 1), (-1, 2, 1), (1, -1, -1.5)])
def test_offset_is_outwards_also_on_mirrored_objects(empty_scene, scale, output):
    sphere = scenes.sphere()
    sphere.scale = scale
    bpy.context.view_layer.update()
    scenes.select(sphere, scenes.ring(sphere, 4))
    bpy.ops.nicmm.design_curve(offset=0.05, output=output)
    lengths = np.linalg.norm(in_world(bpy.context.active_object) / np.abs(scale), axis=1)
    assert lengths.min() > 1.01


def test_offset_is_outwards_without_the_parent(empty_scene):
    key = scenes.module(empty_scene, "scene.curve_record").RECORD_KEY
    sphere = scenes.sphere()
    sphere.scale = (-1, 1, 1)
    bpy.context.view_layer.update()
    scenes.select(sphere, scenes.ring(sphere, 4))
    bpy.ops.nicmm.design_curve(output="STICKY")
    curve = bpy.context.active_object
    curve.parent, curve.matrix_parent_inverse = None, Matrix()
    curve[key]["drawn"]["offset"] = 0.05
    bpy.context.view_layer.update()
    assert bpy.ops.nicmm.update_curves() == {"FINISHED"}
    assert np.linalg.norm(in_world(curve), axis=1).min() > 1.01


@pytest.mark.slow
def test_radii_tilts_and_materials_survive_an_update(monkey):
    curve = draw(monkey, closed=False)
    curve.data.materials.append(bpy.data.materials.new("Red"))
    curve.data.splines[0].use_smooth = False
    points = curve.data.splines[0].points
    taper = np.linspace(1.0, 0.1, len(points), dtype=np.float32)
    points.foreach_set("radius", taper)
    points.foreach_set("tilt", 2.0 * taper)
    for vertex in monkey.data.vertices:
        vertex.co.x *= 1.2
    monkey.data.update()
    assert bpy.ops.nicmm.update_curves() == {"FINISHED"}
    points = curve.data.splines[0].points
    radii, tilts = scenes.get(points, "radius"), scenes.get(points, "tilt")
    assert (radii[0], radii[-1]) == (pytest.approx(1.0), pytest.approx(0.1))
    assert (np.diff(radii) < 0.0).all()
    np.testing.assert_allclose(tilts, 2.0 * radii, rtol=1e-5)
    assert [found.name for found in curve.data.materials] == ["Red"]
    assert not curve.data.splines[0].use_smooth


@pytest.mark.parametrize("output", ["CURVE", "STICKY", "PARALLEL"])
def test_materials_of_the_object_are_kept(empty_scene, output):
    sphere = scenes.sphere()
    scenes.select(sphere, scenes.ring(sphere, 4))
    bpy.ops.nicmm.design_curve()
    curve = bpy.context.active_object
    for name, link in (("Of Data", "DATA"), ("Of Object", "OBJECT")):
        curve.data.materials.append(None)
        slot = curve.material_slots[-1]
        slot.link, slot.material = link, bpy.data.materials.new(name)
    assert bpy.ops.nicmm.convert_curve(output=output) == {"FINISHED"}
    slots = bpy.context.active_object.material_slots
    found = [(slot.link, slot.material.name) for slot in slots]
    assert found == [("DATA", "Of Data"), ("OBJECT", "Of Object")]


@pytest.mark.slow
@pytest.mark.parametrize("spline", ["EVEN", "EXACT", "BEZIER"])
def test_an_update_keeps_spline_and_offset(monkey, spline):
    curve = draw(monkey, spline=spline, offset=0.03)
    before = outline(curve)
    assert bpy.ops.nicmm.update_curves() == {"FINISHED"}
    assert on_segments(outline(curve), before).max() < 3e-3  # the update converges a little further
    assert curve.data.splines[0].type == ("BEZIER" if spline == "BEZIER" else "POLY")


@pytest.mark.slow
def test_a_converted_curve_is_cut_exactly(empty_scene):
    """The record contains the exact curve, whatever spline is shown."""
    monkey = scenes.monkey()
    exact = in_world(draw(monkey, spline="EXACT"))
    draw(monkey, spline="BEZIER", offset=0.1)
    bpy.ops.nicmm.convert_curve(output="CURVE", spline="EXACT", offset=0.0)
    np.testing.assert_allclose(in_world(bpy.context.active_object), exact, atol=1e-6)
