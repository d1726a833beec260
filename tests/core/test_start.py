"""Tests of `Designer.design(start=…)`, where the start is an earlier curve."""

from dataclasses import replace

import igl
import numpy as np
import pytest
from scipy.spatial import cKDTree

import nicmm_core as nicmm
from nicmm_core import shapes, start_search, surface_designer
from nicmm_core.geometry.curve import curve_on_mesh, points_of_leg
from nicmm_core.geometry.surface_points import nearest_points
from nicmm_core.new_legs import Leg, widened
from nicmm_core.progress import CancelledError
from tests.core.checks import (
    apart,
    assert_valid_curve,
    assert_valid_design,
    circle,
)
from tests.oracles.named_curves import nearest_vertices

pytestmark = pytest.mark.usefixtures("one_attempt_each")

ANGLES = np.array([0.0, 1.3, 2.5, 3.6, 5.0])
HEIGHTS = np.array([0.1, -0.2, 0.15, 0.0, -0.1])
CHOSEN = [12, 80, 41, 150]
MOST_CALLS = 40


def on_ball(ball, raised=0.0, index=1):
    """Points inside faces near the equator; one of them is raised."""
    heights = HEIGHTS.copy()
    heights[index] += raised
    positions = circle(ANGLES) + np.outer(heights, [0.0, 0.0, 1.0])
    positions /= np.linalg.norm(positions, axis=1, keepdims=True)
    return nearest_points(ball, positions)[0]


def beside(mesh, vertex, taken):
    """A neighbour of a vertex that is not among the taken vertices."""
    return next(v for v in igl.adjacency_list(mesh.faces)[vertex] if v not in taken)


def converged(designer, points, start, iterations=3, **arguments):
    """Repeat a design until it has converged; return the last one and the number of calls."""
    for calls in range(1, MOST_CALLS):
        start = designer.design(points, start=start, max_iterations=iterations, **arguments)
        if start.status is not nicmm.Status.ITERATION_LIMIT:
            return start, calls
    raise AssertionError(f"not converged after {MOST_CALLS} calls")


@pytest.fixture
def from_nothing(monkeypatch):
    """List with one entry per design that was made from scratch, without a start."""
    found = []
    designed = surface_designer.SurfaceDesigner._designed

    def counted(*arguments):
        found.append(arguments)
        return designed(*arguments)

    monkeypatch.setattr(surface_designer.SurfaceDesigner, "_designed", counted)
    return found


def far_apart(positions, candidates, count):
    """Farthest-point selection among the candidates, which makes legs long."""
    chosen = [int(candidates[0])]
    while len(chosen) < count:
        away = np.linalg.norm(positions[candidates, None] - positions[chosen], axis=2)
        chosen.append(int(candidates[away.min(axis=1).argmax()]))
    return chosen


@pytest.mark.slow
@pytest.mark.parametrize("order", ["given", "shortest"])
def test_a_designer_remembers_no_answer(body, order):
    """Without a start the answer is that of `design_curve`, whatever was requested before."""
    designer = nicmm.Designer(body)
    first = designer.design(CHOSEN, order=order)
    moved = [beside(body, CHOSEN[0], CHOSEN), *CHOSEN[1:]]
    designer.design(moved, order=order, start=first)
    designer.design(CHOSEN, order=order, smoothness=0.1, closed=False)
    again = designer.design(CHOSEN, order=order)
    anew = nicmm.design_curve(body, CHOSEN, order=order)
    for other in (first, again):
        np.testing.assert_array_equal(other.curves[0].points, anew.curves[0].points)


def test_equal_starts_give_equal_curves(ball):
    """On the same Designer, and on another one for a mesh with the same arrays."""
    designer = nicmm.Designer(ball)
    other = nicmm.Designer(nicmm.Mesh(ball.vertices, ball.faces))
    start = designer.design(on_ball(ball))
    one, two, three = (
        each.design(on_ball(ball, 0.1), start=start) for each in (designer, designer, other)
    )
    np.testing.assert_array_equal(one.curves[0].points, two.curves[0].points)
    np.testing.assert_array_equal(one.curves[0].points, three.curves[0].points)


def test_nothing_is_done_where_nothing_differs(ball):
    designer = nicmm.Designer(ball)
    design = designer.design(on_ball(ball))
    again = designer.design(on_ball(ball), start=design)
    assert again.curves[0] is design.curves[0]


@pytest.mark.slow
@pytest.mark.parametrize("closed", [True, False])
def test_dragged_points_on_every_surface(surface, closed, from_nothing):
    designer = nicmm.Designer(surface)
    rim = np.zeros(len(surface.vertices), dtype=bool)
    for loop in igl.boundary_loop_all(surface.faces):
        rim[loop] = True
    inner = np.flatnonzero(surface.referenced & ~rim)
    chosen = far_apart(surface.vertices, inner, 4)
    design = designer.design(chosen, closed=closed, order="shortest")
    for place in range(4):
        chosen[place] = beside(surface, chosen[place], {*chosen, *np.flatnonzero(rim)})
        design = designer.design(chosen, closed=closed, order="shortest", start=design)
        assert_valid_design(surface, design, closed=closed)
        passed = design.curves[0].points[design.curves[0].control_index]
        gap = np.linalg.norm(passed[:, None] - surface.vertices[chosen], axis=2)
        assert gap.min(axis=0).max() <= 1e-12 * surface.diagonal
    assert len(from_nothing) == 1


@pytest.mark.slow
@pytest.mark.parametrize("closed", [True, False])
def test_every_frame_is_a_curve_by_bounded_work(ball, closed):
    designer = nicmm.Designer(ball)
    design = designer.design(on_ball(ball), closed=closed)
    for step in range(1, 9):
        points = on_ball(ball, 0.04 * step)
        design = designer.design(points, closed=closed, start=design, max_iterations=3)
        assert_valid_curve(ball, design.curves[0], points.positions(ball), closed)
        assert design.iterations <= 3
    assert converged(designer, points, design, closed=closed)[0].status is nicmm.Status.CONVERGED


def test_it_converges_to_the_curve_from_nothing(ball):
    designer, far = nicmm.Designer(ball), on_ball(ball, 0.15)
    start = designer.design(on_ball(ball))
    one = designer.design(far, start=start, max_iterations=1)
    assert one.status is nicmm.Status.ITERATION_LIMIT and one.iterations == 1
    last, calls = converged(designer, far, one, iterations=1)
    assert calls > 1
    anew = nicmm.design_curve(ball, far).curves[0]
    assert last.curves[0].length == pytest.approx(anew.length, rel=2e-3)


def test_iterations_from_nothing_are_bounded_too(body):
    design = nicmm.Designer(body).design(CHOSEN, order="shortest", max_iterations=1)
    assert design.status is nicmm.Status.ITERATION_LIMIT and design.iterations == 1
    assert_valid_curve(body, design.curves[0])


def test_back_again_is_the_first_curve(ball):
    designer = nicmm.Designer(ball)
    first = designer.design(CHOSEN, order="shortest")
    away = [beside(ball, CHOSEN[0], CHOSEN), *CHOSEN[1:]]
    moved = designer.design(away, order="shortest", start=first)
    back = designer.design(CHOSEN, order="shortest", start=moved)
    gap = apart(first.curves[0].points, back.curves[0].points)
    assert gap < 0.2 * apart(first.curves[0].points, moved.curves[0].points)
    assert back.energy["smooth"] == pytest.approx(first.energy["smooth"], rel=0.02)


def test_a_great_circle_from_points_beside_it(ball):
    equator = circle(np.radians([0.0, 130.0, 230.0]))
    designer = nicmm.Designer(ball)
    start = designer.design(nearest_vertices(ball, equator + [0.0, 0.0, 0.1]))
    on_surface = igl.point_mesh_squared_distance(equator, ball.vertices, ball.faces)[2]
    moved = designer.design(on_surface, start=start)
    assert np.abs(moved.curves[0].points[:, 2]).max() < 5e-3


def test_smoothness_and_maps_may_differ(ball, from_nothing):
    designer = nicmm.Designer(ball)
    start = designer.design(on_ball(ball))
    tight = designer.design(on_ball(ball), smoothness=0.1, start=start)
    assert tight.curves[0].length < start.curves[0].length
    pole = (np.linalg.norm(ball.vertices - [0.0, 0.0, 1.0], axis=1) < 0.3).astype(float)
    for name in ("alignment", "obstacles"):
        far = designer.design(on_ball(ball), start=start, **{name: pole})
        assert apart(far.curves[0].points, start.curves[0].points) < 5e-3
        assert_valid_curve(ball, far.curves[0], on_ball(ball).positions(ball))
    assert len(from_nothing) == 1


@pytest.mark.slow
@pytest.mark.parametrize("as_curve", [False, True])
@pytest.mark.parametrize("closed", [True, False])
def test_control_points_go(ball, closed, as_curve):
    """Also an end point of an open curve may be removed, which shortens the curve."""
    designer, points = nicmm.Designer(ball), on_ball(ball)
    design = designer.design(points, closed=closed)
    start = design.curves[0] if as_curve else design
    for gone in range(5):
        left = points[np.delete(np.arange(5), gone)]
        now = designer.design(left, closed=closed, start=start)
        assert_valid_curve(ball, now.curves[0], left.positions(ball), closed)
        if not closed and gone in (0, 4):
            assert now.curves[0].length < 0.9 * design.curves[0].length


@pytest.mark.slow
@pytest.mark.parametrize("order", ["given", "shortest"])
@pytest.mark.parametrize("closed", [True, False])
def test_control_points_come(ball, closed, order):
    """A point may be added on the curve, which then stays in place, or beside it."""
    designer, points = nicmm.Designer(ball), on_ball(ball)
    start = designer.design(points, closed=closed)
    curve = start.curves[0]
    for leg in range(5 if closed else 4):
        bounds = [*curve.control_index, len(curve.faces)]
        at = (bounds[leg] + bounds[leg + 1]) // 2
        faces = np.insert(points.faces, leg + 1, curve.faces[at])
        weights = np.insert(points.barycentric, leg + 1, curve.barycentric[at], axis=0)
        more = nicmm.SurfacePoints(faces, weights)
        now = designer.design(more, closed=closed, order=order, start=start)
        assert_valid_curve(ball, now.curves[0], more.positions(ball), closed)
        assert apart(now.curves[0].points, curve.points) < 0.02
        position = more.positions(ball)
        position[leg + 1] += [0.0, 0.0, 0.1]
        raised = nearest_points(ball, position / np.linalg.norm(position, axis=1)[:, None])[0]
        beside_it = nicmm.SurfacePoints(
            np.where(np.arange(6) == leg + 1, raised.faces, faces),
            np.where(np.arange(6)[:, None] == leg + 1, raised.barycentric, weights),
        )
        now = designer.design(beside_it, closed=closed, order=order, start=start)
        assert_valid_curve(ball, now.curves[0], beside_it.positions(ball), closed)


def test_several_come_and_go_at_once(ball):
    designer, points = nicmm.Designer(ball), on_ball(ball)
    start = designer.design(points)
    curve = start.curves[0]
    new = [int(curve.control_index[0]) + 20, int(curve.control_index[0]) + 40]
    faces = np.concatenate([points.faces[:1], curve.faces[new], points.faces[[2, 3, 4]]])
    weights = [points.barycentric[:1], curve.barycentric[new], points.barycentric[[2, 3, 4]]]
    asked = nicmm.SurfacePoints(faces, np.concatenate(weights))
    now = designer.design(asked, start=start)
    assert_valid_curve(ball, now.curves[0], asked.positions(ball))


def test_a_curve_of_an_earlier_session(ball):
    """The start may be from another Designer, as after reopening a file; points may move too."""
    points = on_ball(ball)
    curve = nicmm.design_curve(ball, points).curves[0]
    designer = nicmm.Designer(ball)
    again = designer.design(points, start=curve).curves[0]
    assert again.length == pytest.approx(curve.length, rel=1e-3)
    moved = on_ball(ball, 0.02)
    design, _ = converged(designer, moved, curve)
    assert_valid_curve(ball, design.curves[0], moved.positions(ball))


@pytest.mark.slow
def test_a_given_order_begins_at_its_first_point(ball):
    """Whatever point the start begins at, even if the first point has moved or is gone."""
    designer, points = nicmm.Designer(ball), on_ball(ball)[np.array([3, 4, 0, 1, 2])]
    for given in (points, points[np.arange(5)[::-1]]):
        shortest = designer.design(given, order="shortest")
        visited = shortest.resumable.visited
        if (np.diff(np.roll(visited, -int(visited.argmin()))) > 0).all():
            break
    assert visited[0] != 0
    now = designer.design(given, start=shortest)
    assert_valid_curve(ball, now.curves[0], given.positions(ball))
    now = designer.design(given, start=now)
    assert_valid_curve(ball, now.curves[0], given.positions(ball))
    moved = nearest_points(ball, given.positions(ball)[:1] + [0.0, 0.0, 0.1])[0]
    for count in (4, 5):
        faces = np.concatenate([moved.faces, given.faces[1:count]])
        weights = np.concatenate([moved.barycentric, given.barycentric[1:count]])
        asked = nicmm.SurfacePoints(faces, weights)
        after = designer.design(asked, start=now)
        assert_valid_curve(ball, after.curves[0], asked.positions(ball))


@pytest.mark.parametrize("kept", [slice(1, 4), slice(0, 3), slice(2, 5)])
def test_an_open_curve_ends_at_the_control_points_that_it_names(ball, kept):
    points = on_ball(ball)
    curve = nicmm.design_curve(ball, points, closed=False).curves[0]
    shorter = replace(curve, control_index=curve.control_index[kept])
    left = points[np.arange(5)[kept]]
    now = nicmm.Designer(ball).design(left, closed=False, start=shorter)
    assert_valid_curve(ball, now.curves[0], left.positions(ball), closed=False)


def test_points_of_a_shortest_curve_in_the_order_visited(body):
    """As in an editor: the points are in visiting order, but those of the start are not."""
    designer = nicmm.Designer(body)
    start = designer.design(CHOSEN, order="shortest")
    curve = start.curves[0]
    visited = nicmm.SurfacePoints(
        curve.faces[curve.control_index], curve.barycentric[curve.control_index]
    )
    now = designer.design(visited, start=start)
    assert_valid_curve(body, now.curves[0], visited.positions(body))
    assert apart(now.curves[0].points, curve.points) < 0.01 * body.diagonal


def test_a_bare_curve_may_be_named_in_any_order(body):
    designer = nicmm.Designer(body)
    curve = designer.design(CHOSEN, order="shortest").curves[0]
    now = designer.design(CHOSEN[::-1], order="shortest", start=curve)
    assert apart(now.curves[0].points, curve.points) < 0.01 * body.diagonal


@pytest.mark.slow
def test_other_methods_can_be_gone_on_from(ball):
    designer = nicmm.Designer(ball)
    level_set = designer.design(on_ball(ball), method="variational")
    now = designer.design(on_ball(ball, 0.05), start=level_set)
    assert_valid_curve(ball, now.curves[0], on_ball(ball, 0.05).positions(ball))


@pytest.mark.slow
def test_beside_obstacles(ball):
    """A start beside obstacles is accepted; one that enters an obstacle is refused."""
    points, designer = on_ball(ball), nicmm.Designer(ball)
    north = (ball.vertices[:, 2] > 0.5).astype(float)
    start = designer.design(points)
    now = designer.design(points, obstacles=north, start=start)
    assert_valid_curve(ball, now.curves[0], points.positions(ball))
    without = designer.design(points, start=now)
    assert apart(without.curves[0].points, start.curves[0].points) < 1e-3
    between = circle([0.65])[0]  # between the first two points
    island = (np.linalg.norm(ball.vertices - between, axis=1) < 0.3).astype(float)
    with pytest.raises(nicmm.CurveError, match="an obstacle of weight 1"):
        designer.design(points, obstacles=island, start=start)
    assert designer.design(points, obstacles=island).curves[0].length > 1.01 * now.curves[0].length


@pytest.mark.slow
def test_moves_by_less_than_a_tenth_are_followed_on_limbs():
    """On any part of the surface, with few exceptions."""
    asked = refused = 0
    for seed in range(4):
        mesh = shapes.creature(seed, resolution=32, faces=1000, subdivisions=1)
        generator = np.random.default_rng(seed)
        designer = nicmm.Designer(mesh)
        chosen = generator.choice(len(mesh.vertices), 4, replace=False)
        start = designer.design(chosen, order="shortest")
        length = start.curves[0].length
        for _ in range(8):
            moved, place = chosen.copy(), generator.integers(4)
            away = np.linalg.norm(mesh.vertices - mesh.vertices[chosen[place]], axis=1)
            near = np.setdiff1d(np.flatnonzero(away < 0.06 * length), chosen)
            moved[place] = generator.choice(near)
            asked += 1
            try:
                now = designer.design(moved, order="shortest", start=start)
            except nicmm.CurveError:
                refused += 1
            else:
                assert_valid_design(mesh, now)
    assert refused <= 0.15 * asked


class TestRefusals:
    """A start that cannot be used raises a typed error that says why."""

    def refused(self, mesh, points, match, error=nicmm.CurveError, **arguments):
        with pytest.raises(error, match=match):
            nicmm.Designer(mesh).design(points, **arguments)

    def test_another_mesh(self, ball, small_ball, ring):
        points = on_ball(ball)
        start = nicmm.design_curve(ball, points)
        on_ring = nearest_vertices(ring, 1.4 * circle(ANGLES))
        for given in (start, start.curves[0]):
            self.refused(small_ball, [3, 60, 100], "not on this mesh", start=given)
            self.refused(ring, on_ring, "mesh", start=given)
            larger = nicmm.Mesh(1.01 * ball.vertices, ball.faces)
            self.refused(larger, points, "another mesh", start=given)

    def test_a_jump(self, ball):
        start = nicmm.design_curve(ball, on_ball(ball))
        self.refused(
            ball, on_ball(ball, 0.8), r"control_points\[1\] is .* away from its", start=start
        )
        more = nicmm.SurfacePoints(
            np.append(on_ball(ball).faces, on_ball(ball, 3.0).faces[1]),
            np.append(on_ball(ball).barycentric, on_ball(ball, 3.0).barycentric[1:2], axis=0),
        )
        self.refused(ball, more, r"control_points\[5\]", start=start)

    def test_another_kind_or_order(self, ball):
        start = nicmm.design_curve(ball, on_ball(ball))
        self.refused(ball, on_ball(ball), "closed curve and an open one", start=start, closed=False)
        other_order = on_ball(ball)[np.array([0, 2, 1, 3])]
        self.refused(ball, other_order, "another order", start=start)
        elsewhere = [int(v) for v in nearest_vertices(ball, circle(ANGLES[:3] + 0.3))]
        self.refused(ball, elsewhere, "none of them is where it was", start=start)

    @pytest.mark.slow
    def test_what_is_no_curve(self, ball):
        points = on_ball(ball)
        start = nicmm.design_curve(ball, points).curves[0]
        for index in ([0, -1, 5], [0], [], [5, 5, 9], [9, 3, 20]):
            lost = replace(start, control_index=np.array(index, dtype=int))
            self.refused(ball, points, "control_index", start=lost)
        twice = np.concatenate([np.arange(len(start.faces))] * 2)
        wound = curve_on_mesh(
            ball, True, start.faces[twice], start.barycentric[twice], start.control_index
        )
        self.refused(ball, points, "crosses or touches itself", start=wound)
        cancelled = nicmm.design_curve(ball, points, progress=lambda *_: False)
        if not cancelled.curves:
            self.refused(ball, points, "has 0 curves", start=cancelled)

    @pytest.mark.slow
    @pytest.mark.parametrize("name", ["faces", "barycentric", "points", "control_index", "closed"])
    def test_fields_of_any_kind(self, small_ball, name):
        """Whatever a field contains, the curve is a usable start or raises a typed error."""
        chosen = [3, 60, 100]
        start = nicmm.design_curve(small_ball, chosen).curves[0]
        whole = getattr(start, name)
        others = [None, "x", [], 0, 2.5, np.nan, [1, [2]], ["a"], object(), {}, [10**30]]
        if isinstance(whole, np.ndarray):
            others += [whole[:-1], whole[None], whole.T, whole + 0.5, -whole, 7 * whole, 1j * whole]
            others += [whole * np.nan, whole.astype(object), whole[::-1], whole + 10**6]
        for other in others:
            try:
                changed = replace(start, **{name: other})
                now = nicmm.Designer(small_ball).design(chosen, start=changed)
            except nicmm.CurveError as error:
                assert "start" in str(error) or "curve" in str(error)
            else:
                assert_valid_curve(small_ball, now.curves[0], small_ball.vertices[chosen])

    @pytest.mark.parametrize("bad", [0, -1, 2.5, True, "3"])
    def test_iterations(self, ball, bad):
        self.refused(ball, CHOSEN, "max_iterations is", nicmm.ArgumentError, max_iterations=bad)

    @pytest.mark.slow
    @pytest.mark.parametrize("method", ["variational", "nicmm"])
    def test_methods_that_start_from_nothing(self, ball, method):
        start = nicmm.design_curve(ball, CHOSEN, order="shortest")
        for arguments in ({"start": start}, {"max_iterations": 3}):
            self.refused(
                ball, CHOSEN, "needs the method", nicmm.ArgumentError, method=method, **arguments
            )

    def test_things_that_are_no_start(self, ball):
        for bad in ("curve", 3, [1, 2], object()):
            self.refused(ball, CHOSEN, "start is a", nicmm.ArgumentError, start=bad)


@pytest.mark.slow
def test_iterations_are_few_from_afar_and_fewer_from_a_start():
    """The counts are medians over random points on generated creatures and include every attempt.

    Without a start they also depend on the initial curve; that bound only detects regressions.
    """
    from_afar, dragged = [], []
    for seed in range(12):
        mesh = shapes.creature(seed, resolution=32, faces=1000)
        generator = np.random.default_rng(seed)
        for closed in (True, False):
            chosen = generator.choice(len(mesh.vertices), 4, replace=False).tolist()
            designer = nicmm.Designer(mesh)
            design = designer.design(chosen, closed=closed, order="shortest")
            from_afar.append(design.iterations)
            for _ in range(3):
                chosen[0] = beside(mesh, chosen[0], chosen)
                design = designer.design(chosen, closed=closed, order="shortest", start=design)
                assert_valid_design(mesh, design, closed=closed)
                dragged.append(design.iterations)
    assert np.median(from_afar) <= 10
    assert np.median(dragged) <= 3


class TestPaintedBesideACurve:
    """If only the weights of a map change, only the curve near them moves."""

    FAR = 0.3
    """Distance from the dab, relative to the diagonal; larger than the reach of a change."""

    @pytest.fixture
    def designer(self, ball):
        return nicmm.Designer(ball)

    @pytest.fixture
    def before(self, ball, designer):
        return designer.design(on_ball(ball))

    @pytest.fixture
    def dab(self, ball):
        """A place beside the middle of the first leg, and weights around it."""
        middle = circle(np.array([0.65]))[0] + [0.0, 0.0, 0.12]
        place = middle / np.linalg.norm(middle)
        away = np.linalg.norm(ball.vertices - place, axis=1)
        return place, np.clip(1.0 - (away / 0.15) ** 2, 0.0, None)

    def moved(self, ball, before, after, place):
        """Greatest distances between two curves, far from the dab and near it, in diagonals."""
        points = before.curves[0].points
        away = distances_to_polyline(points, after.curves[0].points) / ball.diagonal
        far = np.linalg.norm(points - place, axis=1) > self.FAR * ball.diagonal
        assert far.any() and not far.all()
        return away[far].max(), away[~far].max()

    @pytest.mark.parametrize("kind", ["alignment", "obstacles"])
    def test_the_rest_stays(self, ball, designer, before, dab, kind):
        place, weights = dab
        points = on_ball(ball)
        after = designer.design(points, start=before, **{kind: weights})
        assert after.status is nicmm.Status.CONVERGED
        assert_valid_design(ball, after, points.positions(ball))
        far, near = self.moved(ball, before, after, place)
        assert far < 1e-3 < 1e-2 < near
        whole = designer.design(points, **{kind: weights})
        _, difference = self.moved(ball, whole, after, place)
        assert difference < 0.6 * near

    @pytest.mark.slow
    def test_the_numbers_of_the_points_do_not_matter(self, ball, designer, dab):
        """As in Blender, where an update gives the points in the order visited."""
        place, weights = dab
        first = on_ball(ball)[np.array([2, 0, 4, 1, 3])]
        start = designer.design(first, order="shortest")
        index = start.curves[0].control_index
        curve = start.curves[0]
        points = nicmm.SurfacePoints(curve.faces[index], curve.barycentric[index])
        after = designer.design(points, start=start, alignment=weights)
        far, near = self.moved(ball, start, after, place)
        assert far < 1e-3 < 1e-2 < near

    def test_it_also_stays_while_iterations_are_few(self, ball, designer, before, dab):
        place, weights = dab
        after, calls = converged(designer, on_ball(ball), before, 1, alignment=weights)
        assert calls > 1
        far, near = self.moved(ball, before, after, place)
        assert far < 1e-3 < 1e-2 < near

    def test_alternatives_of_the_start_do_not_matter(self, ball, designer, before, dab):
        place, weights = dab
        points = on_ball(ball)
        start = designer.design(points, alternatives=1)
        after = designer.design(points, start=start, alignment=weights)
        far, near = self.moved(ball, start, after, place)
        assert far < 1e-3 < 1e-2 < near

    def test_without_the_dab_the_curve_is_the_first_one(self, ball, designer, before, dab):
        place, weights = dab
        points = on_ball(ball)
        after = designer.design(points, start=before, alignment=weights)
        back = designer.design(points, start=after)
        assert max(self.moved(ball, before, back, place)) < 3e-3

    def test_a_moved_point_moves_the_whole_curve_too(self, ball, designer, before, dab):
        place, weights = dab
        points = on_ball(ball, raised=0.05)
        after = designer.design(points, start=before, alignment=weights)
        assert_valid_design(ball, after, points.positions(ball))
        whole = designer.design(points, alignment=weights)
        assert max(self.moved(ball, whole, after, place)) < 5e-3


def distances_to_polyline(points, line):
    """Distance of each point to a closed polyline."""
    start, step = line, np.roll(line, -1, axis=0) - line
    share = np.einsum("psd,sd->ps", points[:, None] - start, step) / (step**2).sum(axis=1)
    nearest = start + share.clip(0.0, 1.0)[..., None] * step
    return np.linalg.norm(points[:, None] - nearest, axis=2).min(axis=1)


def limbs_with_points():
    """A body with limbs, and five points far apart on it."""
    mesh = shapes.creature(3, resolution=48, faces=2_000)
    return mesh, far_apart(mesh.vertices, np.flatnonzero(mesh.referenced), 5)


def legs_apart(one, other, leg):
    """Greatest distance of a leg of one curve from another curve."""
    own = one.points[points_of_leg(one, leg)]
    return cKDTree(other.points).query(own)[0].max()


class TestNewLegs:
    """Control points that have joined or left a start."""

    def test_a_point_on_the_curve_searches_for_nothing(self, ball, monkeypatch):
        designer, points = nicmm.Designer(ball), on_ball(ball)
        start = designer.design(points)
        curve = start.curves[0]
        at = int(curve.control_index[2]) + 10
        faces = np.insert(points.faces, 3, curve.faces[at])
        weights = np.insert(points.barycentric, 3, curve.barycentric[at], axis=0)
        monkeypatch.setattr(start_search.StartSearch, "with_new_legs", None)
        now = designer.design(nicmm.SurfacePoints(faces, weights), start=start)
        assert apart(now.curves[0].points, curve.points) < 0.02

    @pytest.mark.parametrize("end", [0, -1])
    def test_an_open_curve_goes_on_along_a_great_circle(self, ball, end):
        """A point beyond an end extends the curve, which has no bending on a great circle."""
        angles = np.radians([0.0, 50.0, 100.0, 140.0])
        given = nearest_points(ball, circle(angles))[0]
        order = np.arange(4) if end else np.arange(4)[::-1]
        fewer = order[order != 3]
        designer = nicmm.Designer(ball)
        start = designer.design(given[fewer], closed=False)
        far = nearest_points(ball, circle(np.radians([110.0])))[0]
        faces, weights = given[fewer].faces, given[fewer].barycentric
        at = 3 if end else 0
        longer = nicmm.SurfacePoints(
            np.insert(faces, at, far.faces), np.insert(weights, at, far.barycentric, axis=0)
        )
        now = designer.design(longer, closed=False, start=start).curves[0]
        assert_valid_curve(ball, now, longer.positions(ball), closed=False)
        assert np.abs(now.points[:, 2]).max() < 5e-3
        assert now.length == pytest.approx(np.radians(110.0), rel=5e-3)

    @pytest.mark.slow
    def test_a_point_behind_a_limb_makes_no_detour(self):
        """The nearest position in space may be far away along the surface."""
        mesh, chosen = limbs_with_points()
        designer = nicmm.Designer(mesh)
        start = designer.design(chosen[:4], order="shortest")
        curve = start.curves[0]
        candidates = np.flatnonzero(
            cKDTree(curve.points).query(mesh.vertices)[0] < 0.09 * curve.length
        )
        visited = [chosen[number] for number in start.resumable.visited]
        for vertex in candidates[:: len(candidates) // 12].tolist():
            if vertex in visited:
                continue
            asked = [*visited, vertex]
            try:
                now = designer.design(asked, start=start)
            except nicmm.CurveError as error:
                assert "away from its" in str(error) or "detour" in str(error)
                continue
            anew = designer.design(asked)
            assert_valid_design(mesh, now)
            assert now.curves[0].length < 1.5 * anew.curves[0].length

    @pytest.mark.slow
    def test_the_other_legs_keep_their_courses(self, ball):
        """They only move a little near the ends of the new leg."""
        designer, points = nicmm.Designer(ball), on_ball(ball)
        start = designer.design(points)
        raised = circle([(ANGLES[1] + ANGLES[2]) / 2]) + [[0.0, 0.0, 0.4]]
        place = nearest_points(ball, raised)[0]
        asked = nicmm.SurfacePoints(
            np.insert(points.faces, 2, place.faces),
            np.insert(points.barycentric, 2, place.barycentric, axis=0),
        )
        now = designer.design(asked, start=start).curves[0]
        assert_valid_curve(ball, now, asked.positions(ball))
        assert legs_apart(now, start.curves[0], 4) < 0.1
        assert legs_apart(now, start.curves[0], 1) > 0.2

    def test_with_few_iterations_nothing_is_searched_for(self, ball, monkeypatch):
        designer, points = nicmm.Designer(ball), on_ball(ball)
        start = designer.design(points)
        monkeypatch.setattr(start_search.StartSearch, "with_new_legs", None)
        raised = nearest_points(ball, circle([4.3]) + [[0.0, 0.0, 0.3]])[0]
        asked = nicmm.SurfacePoints(
            np.insert(points.faces, 4, raised.faces),
            np.insert(points.barycentric, 4, raised.barycentric, axis=0),
        )
        now = designer.design(asked, start=start, max_iterations=3)
        assert_valid_curve(ball, now.curves[0], asked.positions(ball))

    def test_a_cancelled_search_returns_the_moved_curve(self, ball, monkeypatch):
        designer, points = nicmm.Designer(ball), on_ball(ball)
        start = designer.design(points)

        def cancelled(*_):
            raise CancelledError
            yield

        monkeypatch.setattr(start_search.StartSearch, "with_new_legs", cancelled)
        raised = nearest_points(ball, circle([4.3]) + [[0.0, 0.0, 0.3]])[0]
        asked = nicmm.SurfacePoints(
            np.insert(points.faces, 4, raised.faces),
            np.insert(points.barycentric, 4, raised.barycentric, axis=0),
        )
        now = designer.design(asked, start=start)
        assert now.status is nicmm.Status.CANCELLED
        assert_valid_curve(ball, now.curves[0], asked.positions(ball))

    @pytest.mark.parametrize("closed", [True, False])
    def test_widened_legs_cover_the_same_points(self, closed):
        """New legs are joined with both neighbours; nothing is left if no leg would stay."""
        ends = np.arange(8)
        legs = [
            Leg(np.array([i, (i + 1) % 8]), np.array([10 * i, 10 * i + 10]), i in (0, 4))
            for i in ends[: None if closed else -1].tolist()
        ]
        wide = widened(legs, closed)
        assert [leg.is_new for leg in wide].count(True) == 2
        kept = [leg.points.tolist() for leg in wide if not leg.is_new]
        assert kept == [[2, 3], [6, 7]]
        assert widened(legs[:2], False) == []
