"""The editing session without a window: points, settings, undo, failures, the view."""

from importlib import import_module
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from tests.blender import scenes

ANGLES = np.array([0.2, 1.4, 2.6, 3.7, 5.1])


@pytest.fixture
def parts(empty_scene):
    """Modules of the extension, by their names."""
    rooms = {
        "scene": ("curve_record", "mesh_data", "designers"),
        "tool": ("edit_session", "edit_view", "edited_curve"),
    }
    found = {
        name: import_module(f"{empty_scene.name}.nicmm_blender.{room}.{name}")
        for room, names in rooms.items()
        for name in names
    }
    return SimpleNamespace(core=empty_scene.core, **found)


def start(parts, mesh_object, **asked):
    """A session on a mesh without points."""
    bpy.context.view_layer.objects.active = mesh_object
    opened = parts.edited_curve.open_session(bpy.context, None, parts.curve_record.Asked(**asked))
    return opened.session


def at(session, position):
    """Face and barycentrics of the point nearest to a position in the object's local space."""
    nearest = import_module(type(session.points).__module__).nearest_points
    solved = np.array([position], dtype=float) @ session.surface.linear.T
    points, _ = nearest(session.designer.mesh, solved)
    return int(points.faces[0]), points.barycentric[0]


def ring(heights=(0.1, -0.2, 0.1, 0.2, -0.1)):
    heights = np.asarray(heights)
    angles = ANGLES[: len(heights)]
    return np.stack([np.cos(angles), np.sin(angles), heights], axis=1)


def filled(parts, mesh_object, positions=None, **asked):
    """A session with points and a converged curve."""
    session = start(parts, mesh_object, **asked)
    for position in ring() if positions is None else positions:
        session.add(*at(session, position))
    session.converge()
    return session


def assert_passes(session):
    """The curve has converged, passes all points in order and is closed if it should be."""
    assert session.state.converged and not session.problem
    curve = session.curve
    assert curve.closed == session.closed
    assert (np.diff(curve.control_index) > 0).all()
    passed = session.polyline()[curve.control_index]
    np.testing.assert_allclose(passed, session.positions(), atol=1e-9)


@pytest.mark.slow
def test_curve_grows_with_the_points(parts):
    session = start(parts, scenes.sphere())
    assert session.untouched
    for number, position in enumerate(ring()):
        assert session.add(*at(session, position)) == number
        session.converge()
        if number == 0:
            assert session.curve is None
            assert "two points" in session.what_is_missing()
        else:
            assert_passes(session)
            assert session.curve.closed == (number >= 2)
            assert not session.what_is_missing()
    assert not session.untouched


def test_open_curve(parts):
    session = filled(parts, scenes.sphere(), closed=False)
    assert_passes(session)
    assert not session.curve.closed
    session.ask_for(closed=True)
    session.converge()
    assert_passes(session)
    assert session.curve.closed


@pytest.mark.parametrize("leg", range(5))
def test_insert_on_the_curve(parts, leg):
    """The point comes between those of its leg, and the curve stays unchanged."""
    session = filled(parts, scenes.sphere())
    before = session.polyline()
    bounds = [*session.curve.control_index, len(session.curve.faces)]
    segment = (bounds[leg] + bounds[leg + 1]) // 2
    number = session.insert(segment, 0.25)
    assert number == leg + 1
    assert session.idle
    assert_passes(session)
    expected = 0.75 * before[segment] + 0.25 * before[segment + 1]
    np.testing.assert_allclose(session.positions()[number], expected, atol=1e-9)
    # Its nodes are spaced again, with one more leg.
    assert scenes.distances_to(session.polyline(), before).max() < 0.01


@pytest.mark.slow
def test_inserted_point_is_dragged_from_there(parts):
    session = filled(parts, scenes.sphere())
    number = session.insert(30, 0.5)
    session.grab()
    for height in np.linspace(0.0, 0.3, 8):
        place = session.positions()[number] + [0, 0, height / 4]
        session.move(number, *at(session, place))
        assert not session.waiting
    session.drop()
    session.converge()
    assert_passes(session)


@pytest.mark.parametrize(
    "number", [0, *(pytest.param(n, marks=pytest.mark.slow) for n in range(1, 5))]
)
@pytest.mark.parametrize("closed", [True, False])
def test_remove(parts, number, closed):
    session = filled(parts, scenes.sphere(), closed=closed)
    left = np.delete(session.positions(), number, axis=0)
    session.remove(number)
    session.converge()
    np.testing.assert_array_equal(session.positions(), left)
    assert_passes(session)


@pytest.mark.slow
def test_remove_all(parts):
    session = filled(parts, scenes.sphere(), ring()[:3])
    for count in (2, 1, 0):
        session.remove(0)
        session.converge()
        assert len(session.points) == count
        assert (session.curve is None) == (count < 2)
        assert not session.problem


def test_every_frame_of_a_drag_is_bounded(parts, monkeypatch):
    """A move takes a few iterations of the core and never a design from scratch."""
    session = filled(parts, scenes.sphere(4))
    asked, spent = [], []
    design = session.designer.design

    def counted(*arguments, **named):
        found = design(*arguments, **named)
        asked.append(named)
        spent.append(found.iterations)
        return found

    monkeypatch.setattr(session.designer, "design", counted)
    session.grab()
    for height in np.linspace(-0.2, 0.5, 15):
        session.move(1, *at(session, [*ring()[1, :2], height]))
        assert len(spent) == 1 and spent.pop() <= 3
    session.drop()
    session.converge()
    assert all(named["start"] is not None for named in asked)
    assert_passes(session)


def test_after_a_jump_the_curve_is_designed_from_scratch(parts):
    """The last curve stays until then; relaxed over the fold it would have a loop."""
    session = filled(parts, scenes.sphere(4))
    before = session.curve
    session.grab()
    session.move(1, *at(session, [*ring()[1, :2], 1.0]))
    assert session.waiting and not session.state.converged
    assert session.curve is before
    session.drop()
    session.converge()
    assert_passes(session)
    expected = parts.core.design_curve(session.designer.mesh, session.points).curves[0]
    np.testing.assert_array_equal(session.curve.points, expected.points)


@pytest.mark.slow
def test_undo_and_redo(parts):
    """Each change is one step, and so is a drag with all its moves; undo restores equal curves."""
    session = filled(parts, scenes.sphere())
    states = [session.state]

    def after():
        session.converge()
        states.append(session.state)

    session.grab()
    for height in (0.0, 0.1, 0.2):
        session.move(1, *at(session, [*ring()[1, :2], height]))
    session.drop()
    after()
    session.insert(40, 0.5)
    after()
    session.remove(3)
    after()
    session.ask_for(closed=False)
    after()
    session.smoother(3)
    after()
    for state in states[-2::-1]:
        assert session.undo()
        session.converge()
        assert session.state == state or session.state.found is state.found
        assert_passes(session)
    for state in states[1:]:
        assert session.redo()
        session.converge()
        assert session.state.found is state.found
        assert session.asked == state.asked
    assert not session.redo()
    while session.undo():
        pass
    assert not len(session.points) and session.untouched
    session.add(*at(session, ring()[0]))
    assert not session.redo()


def test_a_click_that_moves_nothing_is_no_step(parts):
    session = filled(parts, scenes.sphere())
    before = session.state
    session.grab()
    session.drop()
    session.undo()
    assert len(session.points) == len(before.points) - 1


@pytest.mark.slow
def test_drag_goes_on_after_undo(parts):
    session = filled(parts, scenes.sphere())
    session.remove(4)
    session.converge()
    session.undo()
    session.grab()
    session.move(2, *at(session, [*ring()[2, :2], 0.2]))
    assert not session.waiting
    session.converge()
    assert_passes(session)


def test_what_cannot_be_met_keeps_the_last_curve(parts):
    """The same point twice, and a point on another part of the mesh; moving it away helps."""
    bpy.ops.mesh.primitive_ico_sphere_add(location=(4, 0, 0), subdivisions=2)
    sphere = scenes.sphere()
    bpy.ops.object.select_all(action="SELECT")
    bpy.ops.object.join()
    session = filled(parts, sphere)
    good = session.curve
    session.grab()
    session.move(1, *at(session, (4, 0, 1)))
    session.converge()
    assert session.curve is good
    assert "Point 1 and point 2 lie on different components" in session.problem
    assert session.what_is_missing() == session.problem
    session.move(1, *at(session, [*ring()[1, :2], 0.1]))
    session.drop()
    session.converge()
    assert_passes(session)
    good = session.curve
    session.add(*at(session, session.positions()[0]))
    session.converge()
    assert session.curve is good
    assert "are the same point" in session.problem
    session.undo()
    assert session.curve is good and not session.problem


def test_walls_and_missing_groups_are_named(parts):
    sphere = scenes.sphere()
    group = sphere.vertex_groups.new(name="Wall")
    heights = scenes.positions(sphere)[:, 2]
    group.add(np.flatnonzero(np.abs(heights) < 0.4).tolist(), 1.0, "REPLACE")
    session = filled(parts, sphere)
    good = session.curve
    session.ask_for(obstacle_group="Wall")
    session.converge()
    assert session.curve is good
    assert 'obstacles: the vertex group "Wall"' in session.problem
    session.ask_for(obstacle_group="Gone")
    session.converge()
    assert 'no vertex group "Gone"' in session.problem
    session.ask_for(obstacle_group="")
    session.converge()
    assert_passes(session)


@pytest.mark.slow
def test_groups_reach_the_curve(parts):
    sphere = scenes.sphere(4)
    island = sphere.vertex_groups.new(name="Island")
    middle = ring()[:2].mean(axis=0)
    middle /= np.linalg.norm(middle)
    away = np.linalg.norm(scenes.positions(sphere) - middle, axis=1)
    island.add(np.flatnonzero(away < 0.25).tolist(), 1.0, "REPLACE")
    session = filled(parts, sphere)
    plain = session.curve
    session.ask_for(obstacle_group="Island", clearance=0.1)
    session.converge()
    assert_passes(session)
    nearest = np.linalg.norm(session.polyline() - middle, axis=1).min()
    assert nearest > 0.25
    assert np.linalg.norm(plain.points - middle, axis=1).min() < 0.2
    session.ask_for(obstacle_group="", alignment_group="Island")
    session.converge()
    assert_passes(session)
    assert np.linalg.norm(session.polyline() - middle, axis=1).min() < 0.2


@pytest.mark.slow
def test_smoothness_has_limits(parts):
    session = filled(parts, scenes.sphere(), ring()[:3])
    session.smoother(1)
    assert session.asked.smoothness == pytest.approx(1.25)
    session.smoother(100)
    assert session.asked.smoothness == 100.0
    session.converge()
    steps = len(session._done)
    session.smoother(1)
    assert len(session._done) == steps
    session.smoother(-100)
    assert session.asked.smoothness == 0.01


@pytest.mark.slow
def test_lengths_are_those_of_the_scaled_object(parts):
    sphere = scenes.sphere()
    sphere.scale = (1, 1, 3)
    bpy.context.view_layer.update()
    session = filled(parts, sphere)
    assert_passes(session)
    mesh = parts.core.Mesh(scenes.positions(sphere) * (1, 1, 3), scenes.triangles(sphere))
    expected = parts.core.design_curve(mesh, session.points).curves[0]
    assert session.curve.length == pytest.approx(expected.length, rel=5e-3)


# The view: from pixels to points of the mesh and back.


def looking(parts, session, eye, perspective):
    """A view of 800 × 600 pixels from a point of the y axis towards the origin."""
    near, far, half = 0.1, 100.0, 0.5
    forward = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, eye], [0, 0, 0, 1.0]])
    ratio = 600 / 800
    if perspective:
        depth = [-(far + near) / (far - near), -2 * far * near / (far - near)]
        projection = np.array(
            [[1 / half, 0, 0, 0], [0, 1 / half / ratio, 0, 0], [0, 0, *depth], [0, 0, -1, 0]]
        )
    else:
        projection = np.diag([0.5, 0.5 / ratio, -2 / (far - near), 1.0])
        projection[2, 3] = -(far + near) / (far - near)
    size = np.array([800.0, 600.0])
    surface, mesh = session.surface, session.designer.mesh
    return parts.edit_view.View(projection @ forward, size, surface, mesh)


@pytest.mark.parametrize("perspective", [True, False])
@pytest.mark.parametrize("scale", [(1, 1, 1), (1, 1, 2)])
def test_pixels_and_places(parts, perspective, scale):
    sphere = scenes.sphere(4)
    sphere.scale = scale
    bpy.context.view_layer.update()
    session = filled(parts, sphere)
    view = looking(parts, session, -5.0, perspective)
    for pixel in ([400.0, 300.0], [450.0, 330.0], [370.0, 280.0]):
        face, barycentric = view.place_at(pixel)
        place = session.surface.points(np.array([face]), barycentric[None])
        np.testing.assert_allclose(view.project(place)[0], pixel, atol=1e-3)
        assert place[0, 1] < 0  # the side that looks at the eye
        assert view.visible(place).all()
        assert not view.visible(place * [1, -1, 1]).any()
    assert view.place_at([10.0, 10.0]) is None
    behind = np.array([[0.0, -6.0, 0.0]])
    assert np.isnan(view.project(behind)).all() == perspective


def test_only_what_is_visible_is_picked(parts):
    session = filled(parts, scenes.sphere(4))
    view = looking(parts, session, -5.0, True)
    positions = session.positions()
    visible = view.visible(positions)
    np.testing.assert_array_equal(visible, positions[:, 1] < -1 / 5)
    assert visible.any() and not visible.all()
    pixels = view.project(positions)
    for number, pixel in enumerate(pixels):
        found = view.nearest_point(pixel + [3.0, 0.0], positions, 10.0)
        assert found == (number if visible[number] else None)
    line = session.polyline()
    segment, share = 20, 0.5
    while not view.visible(line[[segment]])[0]:
        segment += 20
    pixel = view.project(0.5 * line[[segment]] + 0.5 * line[[segment + 1]])[0]
    found = view.nearest_on_line(pixel, line, 5.0)
    place = line[found[0]] * (1 - found[1]) + line[found[0] + 1] * found[1]
    expected = (1 - share) * line[segment] + share * line[segment + 1]
    np.testing.assert_allclose(place, expected, atol=1e-3)
    assert view.nearest_on_line(pixel + [0, 200.0], line, 5.0) is None
