"""Symmetric curves and curves that avoid others on one mesh: which avoid which, and junctions."""

import bpy
import numpy as np
import pytest

import nicmm_core as nicmm
from tests.blender import scenes
from tests.blender.scenes import module
from tests.blender.test_avoid_others import CLEARANCE, LEAST, distance, is_current
from tests.blender.test_point_operators import call, controls, refusal
from tests.blender.test_symmetry import (
    ROUNDING,
    octahedral_sphere,
    on,
    recorded_curves,
    text,
)
from tests.blender.test_symmetry import draw as draw_mirrored
from tests.oracles.curve_pairs import contacts

pytestmark = pytest.mark.usefixtures("remembered_designs")

SIDE = [(0.85, 0.0, 0.5), (0.85, 0.5, 0.0), (0.85, 0.0, -0.5), (0.85, -0.5, 0.0)]
"""Places near a unit sphere with x > 0, around the x axis."""

OVER = [(0.7, -0.75, 0.25), (0.7, 0.75, 0.25), (0.1, 0.0, 1.0)]
"""Places above these; free, a curve through them would cross the curve through `SIDE`."""

ALONE = [(0.35, -0.5, 0.9), (0.35, 0.4, 0.9), (0.85, 0.1, 0.45)]
"""Places with x > 0."""

AVOIDING = {"avoid_others": True, "clearance": CLEARANCE}


@pytest.fixture
def sphere(empty_scene):
    """A unit sphere that is symmetric in x, y and z."""
    made = octahedral_sphere()
    bpy.ops.ed.undo_push(message="Sphere")
    return made


def draw(sphere, places, name, mirror_as="", **settings):
    """A designed curve through places, joined or in a pair, or without a mirror."""
    mirror = {"mirror_axis": "X", "mirror_as": mirror_as} if mirror_as else {"mirror_axis": "NONE"}
    made = draw_mirrored(sphere, places, **mirror, **settings)
    made.name = name
    bpy.ops.ed.undo_push(message="Name")
    return made


def across(places):
    """The mirror images of places in X."""
    return [(-x, y, z) for x, y, z in places]


def mesh_of(sphere):
    return nicmm.Mesh(scenes.positions(sphere), scenes.triangles(sphere))


def curves_of(name):
    return recorded_curves(bpy.data.objects[name])[0]


def assert_apart(sphere, one, other, clearance=CLEARANCE):
    """Assert that no curve of one object meets or comes too close to one of another object."""
    for curve in curves_of(one):
        for avoided in curves_of(other):
            assert not contacts(mesh_of(sphere), curve, avoided)
            assert distance(curve, avoided) >= LEAST * clearance


def least(one, other):
    return min(distance(a, b) for a in curves_of(one) for b in curves_of(other))


# A curve that avoids symmetric ones


@pytest.mark.slow
@pytest.mark.parametrize("side", [OVER, across(OVER)])
def test_all_curves_of_a_pair_are_avoided(empty_scene, sphere, side):
    """Also the mirror image, and both are followed."""
    draw(sphere, SIDE, "First", "PAIR")
    draw(sphere, side, "Free")
    assert least("Free", "First") < LEAST * CLEARANCE
    bpy.data.objects.remove(bpy.data.objects["Free"])
    draw(sphere, side, "Second", **AVOIDING)
    assert_apart(sphere, "Second", "First")
    before = curves_of("Second")[0].points
    call("move_point", curve="First", index=1, position=on(sphere, [(0.85, 0.55, 0.05)])[0])
    assert not np.array_equal(curves_of("Second")[0].points, before)
    assert_apart(sphere, "Second", "First")
    assert is_current(empty_scene, "Second")


@pytest.mark.slow
def test_a_joined_curve_is_avoided(empty_scene, sphere):
    draw(sphere, [(0.3, -0.9, 0.0), (0.9, 0.0, 0.1), (0.3, 0.9, 0.0)], "First", "JOINED")
    draw(
        sphere, across([(0.5, -0.7, 0.4), (0.5, 0.7, 0.4), (0.8, 0.0, 0.25)]), "Second", **AVOIDING
    )
    assert_apart(sphere, "Second", "First")
    call("move_point", curve="First", index=1, position=on(sphere, [(0.9, 0.0, 0.12)])[0])
    assert_apart(sphere, "Second", "First")
    assert is_current(empty_scene, "Second")


# Symmetric curves that avoid others


def test_a_joined_curve_cannot_avoid_others(sphere):
    places = text(on(sphere, SIDE))
    joined = {"mirror_axis": "X", "mirror_as": "JOINED"}
    message = refusal("design_curve", points=places, avoid_others=True, **joined)
    assert "joined to its mirror image cannot avoid other curves" in message
    assert not scenes.curves()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mirror", "avoids", "name", "value"),
    [("JOINED", False, "avoid_others", True), ("PAIR", True, "mirror_as", "JOINED")],
)
def test_the_settings_do_not_change_to_both(empty_scene, sphere, mirror, avoids, name, value):
    drawn = draw(sphere, SIDE, "First", mirror, avoid_others=avoids)
    before = [curve.points for curve in curves_of("First")]
    setattr(drawn.nicmm_settings, name, value)
    assert getattr(drawn.nicmm_settings, name) != value
    problem = module(empty_scene, "operators.curve_settings").problem_of(drawn)
    assert "Turn Avoid Other Curves off" in problem
    for points, curve in zip(before, curves_of("First"), strict=True):
        np.testing.assert_array_equal(points, curve.points)


@pytest.mark.slow
@pytest.mark.parametrize("how", ["PAIR", "JOINED"])
def test_a_pair_avoids_symmetric_curves(sphere, how):
    """The mirror image of what avoids a symmetric curve avoids it, too."""
    places = SIDE
    if how == "JOINED":
        places = [(0.3, -0.9, 0.0), (0.9, 0.0, 0.1), (0.3, 0.9, 0.0)]
    draw(sphere, places, "First", how)
    draw(sphere, OVER, "Second", "PAIR", **AVOIDING)
    assert len(curves_of("Second")) == 2
    assert_apart(sphere, "Second", "First")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("clearance", "height", "reason"),
    [(0.0, 0.0, "crosses"), (0.1, 0.0, "crosses"), (0.1, 0.08, "comes closer to")],
)
def test_the_mirror_image_may_not_meet_another_curve(sphere, clearance, height, reason):
    """Other than the drawn curve, it is only checked."""
    ends = [(-0.8, -0.5, 0.45 - height), (-0.8, 0.5, 0.45 - height)]
    draw(sphere, ends, "First", closed=False)
    settings = {"avoid_others": True, "clearance": clearance, "mirror_axis": "X"}
    places = text(on(sphere, ALONE))
    message = refusal("design_curve", points=places, mirror_as="PAIR", **settings)
    assert f'The mirror image of the curve {reason} "First"' in message
    assert len(scenes.curves()) == 1


@pytest.mark.slow
def test_a_pair_whose_image_would_meet_another_curve_keeps_its_shape(sphere):
    draw(sphere, [(-0.8, -0.3, -0.1), (-0.8, 0.3, -0.1)], "First", closed=False)
    draw(sphere, ALONE, "Second", "PAIR", **AVOIDING)
    before = [curve.points for curve in curves_of("Second")]
    position = on(sphere, [(0.9, 0.1, -0.3)])[0]
    message = refusal("move_point", curve="Second", index=2, position=position)
    assert 'The mirror image of the curve crosses "First"' in message
    for points, curve in zip(before, curves_of("Second"), strict=True):
        np.testing.assert_array_equal(points, curve.points)


# Junctions


@pytest.mark.slow
@pytest.mark.parametrize("part", [0, 1])
def test_a_junction_follows_a_curve_of_a_pair(empty_scene, sphere, part):
    draw(sphere, SIDE, "First", "PAIR")
    curve = curves_of("First")[part]
    index = curve.control_index
    start = curve.points[(index[0] + index[1]) // 2]
    other = (-1.0 if part else 1.0) * 0.3, 0.0, 0.95
    draw(sphere, [tuple(start), other], "Second", closed=False, **AVOIDING)
    (stored,) = bpy.data.objects["Second"]["nicmm_curve"]["junctions"]
    assert (stored["point"], stored["part"]) == (0, part)
    before = controls(bpy.data.objects["Second"])[0]
    call("move_point", curve="First", index=1, position=on(sphere, [(0.85, 0.58, 0.05)])[0])
    after = controls(bpy.data.objects["Second"])[0]
    assert np.linalg.norm(after - before) > 0.01
    (stored,) = bpy.data.objects["Second"]["nicmm_curve"]["junctions"]
    assert (stored["point"], stored["part"]) == (0, part)
    (second,), firsts = curves_of("Second"), curves_of("First")
    end = second.points[second.control_index[:1]]
    np.testing.assert_allclose(end[0], after, atol=ROUNDING)
    assert not contacts(mesh_of(sphere), second, firsts[part], junctions=end)
    assert not contacts(mesh_of(sphere), second, firsts[1 - part])
    assert is_current(empty_scene, "Second")


@pytest.mark.slow
def test_a_pair_may_end_on_a_pair(sphere):
    """The mirror image of a junction is a junction of the mirror images."""
    draw(sphere, SIDE, "First", "PAIR")
    curve = curves_of("First")[0]
    vertex = curve.points[curve.control_index[1]]
    draw(sphere, [tuple(vertex), (0.3, 0.0, 0.95)], "Second", "PAIR", closed=False, **AVOIDING)
    for one, other in zip(curves_of("Second"), curves_of("First"), strict=True):
        end = one.points[one.control_index[:1]]
        assert not contacts(mesh_of(sphere), one, other, junctions=end)
        np.testing.assert_allclose(end[0], other.points[other.control_index[1]], atol=ROUNDING)


@pytest.mark.slow
def test_marks_of_the_tool(empty_scene, sphere):
    """A diamond, as a corner a star, and a hollow square for its image."""
    overlay = module(empty_scene, "tool.overlay")
    edited_curve = module(empty_scene, "outputs.edited_curve")
    draw(sphere, SIDE, "First", "PAIR")
    curve = curves_of("First")[0]
    vertex = tuple(curve.points[curve.control_index[1]])
    places = [vertex, (0.4, 0.3, 0.9), (0.3, 0.0, 0.95)]
    second = draw(sphere, places, "Second", "PAIR", closed=False, **AVOIDING)

    def shapes():
        opened = edited_curve.open_curve(bpy.context, second)
        return [mark.shapes for mark in overlay._marks(opened, None, overlay.Colours(bpy.context))]

    def expect(*names):
        found = shapes()
        assert len(found) == len(names)
        for shape, name in zip(found, names, strict=True):
            assert shape is getattr(overlay, name)

    hollow = ["_HOLLOW_DISCS", "_HOLLOW_DISCS"]
    expect("_DIAMONDS", "_DISCS", "_DISCS", "_HOLLOW_DISCS", *hollow)
    call("toggle_corner", curve="Second", index=0)
    expect("_STARS", "_DISCS", "_DISCS", "_HOLLOW_SQUARES", *hollow)
