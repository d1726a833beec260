"""Files saved by each release: their curves can still be converted, edited and updated."""

from pathlib import Path

import bpy
import numpy as np
import pytest

from tests.blender import scenes
from tests.blender.scenes import module

pytestmark = pytest.mark.usefixtures("remembered_designs")

KEPT = Path(__file__).parent / "kept"
FILES = sorted(KEPT.glob("*.blend"))
CURVES = ("Closed", "Open", "Maps", "Variational", "Sticky", "Tube", "Placed")
ROUNDING = 2e-6


@pytest.fixture(params=FILES, ids=lambda path: path.stem)
def kept(request, extension):
    bpy.ops.wm.open_mainfile(filepath=str(request.param))
    return extension


def drawn(curve):
    """Positions of the points of a curve or hair curves object, in its local space."""
    if curve.type == "CURVE":
        return scenes.points(curve)
    return scenes.get(curve.data.points, "position", 3).astype(float)


def controls(extension, curve):
    surface = module(extension, "scene.surface").read(bpy.data.objects["Body"], False)
    points, positions = module(extension, "scene.curve_record").read_control_points(curve, surface)
    assert (points.faces >= 0).all()
    return positions


def test_there_are_some():
    assert "1.0.0" in [path.stem for path in FILES]


@pytest.mark.parametrize("name", CURVES)
def test_a_curve_is_recalled_as_it_was_drawn(kept, name):
    record = module(kept, "scene.curve_record")
    body, curve = bpy.data.objects["Body"], bpy.data.objects[name]
    assert record.has_record(curve) and record.mesh_of(curve) == body
    surface = module(kept, "scene.surface").read(body, False)
    (recalled,) = record.read_curves(curve, surface)
    np.testing.assert_allclose(drawn(curve), recalled.points, atol=ROUNDING)
    settings = record.settings_of(curve)
    assert settings.closed == recalled.closed == (name not in ("Open", "Tube"))
    assert record.is_current(curve, record.digest(body, surface, settings))
    at_controls = recalled.points[recalled.control_index]
    np.testing.assert_allclose(controls(kept, curve), at_controls, atol=ROUNDING)


def test_settings_of_curves(kept):
    record = module(kept, "scene.curve_record")
    settings = {name: record.settings_of(bpy.data.objects[name]) for name in CURVES}
    assert settings["Open"].smoothness == 2.0
    methods = {name: found.method for name, found in settings.items()}
    assert methods.pop("Variational") == "VARIATIONAL"
    assert set(methods.values()) == {"ELASTIC"}
    assert (settings["Maps"].obstacle_group, settings["Maps"].alignment_group) == ("Wall", "Lane")
    assert settings["Maps"].clearance == pytest.approx(0.05)
    panel = bpy.context.scene.nicmm_curves
    assert (panel.smoothness, panel.obstacle_group) == (3.0, "Wall")


@pytest.mark.slow
def test_curves_are_updated_on_the_mesh_as_it_is_now(kept):
    body = bpy.data.objects["Body"]
    scenes.activate(body)
    before = {name: drawn(bpy.data.objects[name]) for name in CURVES}
    place = scenes.positions(body)
    place[:, 2] += 0.2 * place[:, 0] ** 2
    body.data.vertices.foreach_set("co", place.astype(np.float32).ravel())
    body.data.update()
    assert bpy.ops.nicmm.update_curves() == {"FINISHED"}
    for name in CURVES:
        curve = bpy.data.objects[name]
        now = drawn(curve)
        assert abs(now[:, 2].max() - before[name][:, 2].max()) > 0.01
        assert scenes.distances_to(controls(kept, curve), now).max() < ROUNDING


@pytest.mark.slow
@pytest.mark.parametrize("name", CURVES)
def test_a_curve_is_edited_in_place(kept, name):
    curve = bpy.data.objects[name]
    scenes.activate(curve)
    before, at = drawn(curve), controls(kept, curve)
    assert bpy.ops.nicmm.edit_curve(smoothness=0.1) == {"FINISHED"}
    assert bpy.context.active_object == curve
    assert module(kept, "scene.curve_record").settings_of(curve).smoothness == pytest.approx(0.1)
    assert scenes.distances_to(at, drawn(curve)).max() < ROUNDING
    assert len(drawn(curve)) != len(before) or not np.allclose(drawn(curve), before)


@pytest.mark.slow
@pytest.mark.parametrize("name", CURVES)
def test_points_of_a_curve_are_changed(kept, name):
    curve = bpy.data.objects[name]
    assert bpy.ops.nicmm.activate_curve(curve=name) == {"FINISHED"}
    assert bpy.context.active_object == curve
    before = controls(kept, curve)
    for setting in ("smoothness", "closed", "spline", "radius", "offset"):
        getattr(curve.nicmm_settings, setting)
    assert bpy.ops.nicmm.remove_point(index=1) == {"FINISHED"}
    np.testing.assert_allclose(controls(kept, curve), np.delete(before, 1, axis=0), atol=ROUNDING)
    assert bpy.ops.nicmm.insert_point(index=1, position=before[1]) == {"FINISHED"}
    np.testing.assert_allclose(controls(kept, curve), before, atol=ROUNDING)
    assert scenes.distances_to(before, drawn(curve)).max() < ROUNDING


@pytest.mark.parametrize(("name", "output"), [("Closed", "STICKY"), ("Sticky", "CURVE")])
def test_a_curve_is_converted(kept, name, output):
    curve = bpy.data.objects[name]
    scenes.activate(curve)
    before = drawn(curve)
    assert bpy.ops.nicmm.convert_curve(output=output, keep_original=True, spline="EXACT") == {
        "FINISHED"
    }
    np.testing.assert_allclose(drawn(bpy.context.active_object), before, atol=ROUNDING)


@pytest.mark.parametrize("name", ["Sticky", "Tube"])
def test_sticky_curves_follow_the_mesh(kept, name):
    body, curve = bpy.data.objects["Body"], bpy.data.objects[name]
    place = scenes.positions(body)
    body.data.vertices.foreach_set("co", (place * [1.0, 1.0, 2.0]).astype(np.float32).ravel())
    body.data.update()
    bpy.context.view_layer.update()
    if name == "Sticky":
        at = scenes.evaluated_points(curve)
        np.testing.assert_allclose(at, drawn(curve) * [1.0, 1.0, 2.0], atol=1e-5)
    else:
        evaluated = curve.evaluated_get(bpy.context.evaluated_depsgraph_get())
        assert evaluated.evaluated_geometry().mesh is not None


def test_outputs_that_changed_their_mesh(kept):
    edges = bpy.data.objects["Edges"].data.edges
    assert sum(edge.use_seam for edge in edges) > 20
    assert sum(edge.use_edge_sharp for edge in edges) > 20
    assert "Region" in bpy.data.objects["Group"].vertex_groups
    assert ".sculpt_face_set" in bpy.data.objects["Face Set"].data.attributes
    assert "Objects.001" in bpy.data.objects
    loose = bpy.data.objects["Loose"]
    assert not any(edge.is_loose for edge in loose.data.edges)
    assert len(loose.data.vertices) > len(bpy.data.objects["Body"].data.vertices)


@pytest.mark.parametrize(
    ("version", "message"),
    [(99, "newer version of NICMM Curves"), (5, "before 1.0.0, which was never released")],
)
def test_a_record_of_another_version_says_so(kept, version, message):
    curve = bpy.data.objects["Closed"]
    record = curve["nicmm_curve"].to_dict()
    curve["nicmm_curve"] = {**record, "version": version}
    scenes.activate(curve)
    with pytest.raises(RuntimeError, match=message):
        bpy.ops.nicmm.convert_curve(output="STICKY")
    assert bpy.data.objects["Closed"] == curve
