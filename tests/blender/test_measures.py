"""Measures of curves in Blender, and elements that points snap to."""

import bpy
import numpy as np
import pytest

from tests.blender import scenes
from tests.blender.test_view import looking

pytestmark = pytest.mark.usefixtures("remembered_designs")


@pytest.fixture
def equator(empty_scene):
    """A designed curve along the equator of a unit sphere."""
    ball = scenes.sphere(5)
    scenes.select(ball, scenes.ring(ball, 6))
    assert bpy.ops.nicmm.design_curve(order="GIVEN") == {"FINISHED"}
    return bpy.context.active_object


@pytest.mark.slow
def test_measures_are_in_scene_units(extension, equator):
    measures = scenes.module(extension, "operators.measures")
    [found] = measures.now(equator).values
    assert found["length"] == pytest.approx(2.0 * np.pi, rel=5e-3)
    assert found["area"] == pytest.approx(2.0 * np.pi, rel=2e-2)
    assert sum(found["leg_lengths"]) == pytest.approx(found["length"])
    equator.parent.scale = (3.0, 3.0, 3.0)
    bpy.context.view_layer.update()
    [larger] = measures.now(equator).values
    assert larger["length"] == pytest.approx(3.0 * found["length"], rel=1e-5)
    assert larger["area"] == pytest.approx(9.0 * found["area"], rel=1e-5)


@pytest.mark.slow
def test_slopes_are_those_in_the_scene(extension, equator):
    measures = scenes.module(extension, "operators.measures")
    assert measures.now(equator).values[0]["greatest_slope"] < 0.1
    equator.parent.rotation_euler = (np.pi / 2.0, 0.0, 0.0)
    bpy.context.view_layer.update()
    assert measures.now(equator).values[0]["greatest_slope"] > 1.4


@pytest.mark.slow
def test_measures_are_computed_again_only_after_changes(extension, equator):
    measures = scenes.module(extension, "operators.measures")
    first = measures.now(equator)
    assert measures.now(equator) is first and measures.of(equator) is first
    vertices = scenes.positions(equator.parent)
    [vertex] = scenes.nearest_vertices(equator.parent, [(np.cos(0.4), 0.0, np.sin(0.4))])
    bpy.ops.nicmm.move_point("EXEC_DEFAULT", curve=equator.name, index=0, position=vertices[vertex])
    assert measures.of(equator) is None  # it is computed soon
    assert measures.now(equator).values[0]["length"] > first.values[0]["length"]


@pytest.mark.slow
def test_the_comb_of_a_circle_points_outwards(extension, empty_scene):
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=40, y_subdivisions=40, size=2.0)
    angles = 2.0 * np.pi * np.arange(6) / 6.0
    places = 0.5 * np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=1)
    points = [{"name": "", "position": place} for place in places]
    assert bpy.ops.nicmm.edit_curve(points=points) == {"FINISHED"}
    measures = scenes.module(extension, "operators.measures")
    [comb] = measures.now(bpy.context.active_object).combs
    base, tip = comb.transpose(1, 0, 2)
    assert (np.linalg.norm(tip, axis=1) > np.linalg.norm(base, axis=1)).all()
    size = (0.1 * 2.0 * np.sqrt(2.0)) ** 2
    lengths = np.linalg.norm(tip - base, axis=1)
    np.testing.assert_allclose(np.median(lengths), size / 0.5, rtol=0.05)


@pytest.mark.parametrize(
    ("system", "expected"), [("METRIC", "1.5 m"), ("IMPERIAL", "4.9"), ("NONE", "1.5")]
)
def test_texts_have_the_units_of_the_scene(extension, empty_scene, system, expected):
    bpy.context.scene.unit_settings.system = system
    measures = scenes.module(extension, "operators.measures")
    assert expected in measures.text_of(bpy.context.scene, 1.5)
    assert measures.text_of(bpy.context.scene, np.inf) == "∞"


@pytest.fixture
def cube(extension, empty_scene):
    """A cube of quads, seen from the front, and its opened surface."""
    bpy.ops.mesh.primitive_cube_add(size=2.0)
    edited = scenes.module(extension, "outputs.edited_curve")
    opened = edited.open_new(bpy.context)
    return opened, looking(extension, opened)


@pytest.mark.parametrize(
    ("elements", "near", "expected"),
    [
        ({"VERTEX"}, (0.96, 0.0, 0.96), (1.0, -1.0, 1.0)),
        ({"EDGE_MIDPOINT"}, (0.96, 0.0, 0.04), (1.0, -1.0, 0.0)),
        ({"EDGE"}, (0.97, 0.0, 0.4), (1.0, -1.0, 0.4)),
        ({"FACE"}, (0.04, 0.0, -0.03), (0.0, -1.0, 0.0)),
        ({"VERTEX", "EDGE"}, (0.97, 0.0, 0.95), (1.0, -1.0, 1.0)),
        ({"VERTEX"}, (0.5, 0.0, 0.5), (0.5, -1.0, 0.5)),
        ({"EDGE"}, (0.2, 0.0, 0.22), (0.2, -1.0, 0.22)),  # a diagonal is not an edge
    ],
)
def test_points_snap_to_elements_of_polygons(extension, cube, elements, near, expected):
    opened, view = cube
    snap = scenes.module(extension, "tool.element_snap")
    tools = bpy.context.tool_settings
    tools.snap_elements, tools.use_snap = elements, True
    pixel = view.project(np.array([[near[0], -1.0, near[2]]]))[0]
    place = view.surface_point_at(pixel)
    for inverted in (False, True):
        found = snap.snapped(bpy.context, view, pixel, place, inverted).place
        [position] = opened.surface.points(found.faces, found.barycentric)
        wanted = (near[0], -1.0, near[2]) if inverted else expected
        np.testing.assert_allclose(position, wanted, atol=2e-3 if inverted else 5e-3)
    tools.use_snap = False


def test_a_damaged_record_has_a_message_in_the_panel(extension, equator):
    key = scenes.module(extension, "scene.curve_record").RECORD_KEY
    equator[key]["counts"] = [-3]
    panel = scenes.module(extension, "interface.panels").NICMM_PT_measures
    assert panel.poll(bpy.context)
    assert scenes.module(extension, "operators.measures").now(equator).problem


def test_a_hidden_curve_is_not_edited(extension, equator):
    edited_curve = scenes.module(extension, "outputs.edited_curve")
    assert edited_curve.active(bpy.context) is equator
    equator.hide_set(True)
    assert edited_curve.active(bpy.context) is None
