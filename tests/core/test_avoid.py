"""Tests curves that avoid other curves: distances, junctions, errors, and many curves on one mesh.

Contacts and distances are measured by `tests.oracles.curve_pairs`.
"""

import json

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import improvement, shapes
from nicmm_core.avoidance.avoided_curve import avoided_curves
from nicmm_core.avoidance.off_curves import surface_off_curves
from nicmm_core.commands import main
from nicmm_core.geometry.curve import points_of
from nicmm_core.geometry.distances import distance_to_segments
from nicmm_core.geometry.surface_points import nearest_points
from nicmm_core.io.files import read_curve, write_curve, write_mesh
from tests.core.checks import assert_valid_design
from tests.oracles.checker import judge
from tests.oracles.curve_pairs import contacts, least_distance
from tests.oracles.named_curves import nearest_vertices
from tests.oracles.same_surface import changed

pytestmark = pytest.mark.usefixtures("one_attempt_each")

CLEARANCE = 0.05
LEAST, MOST = 1.0, 1.05
"""Bounds of the distance where a curve is pressed against another one, in clearances."""

MOST_WORK = improvement.MOST_WORK
"""Work of all attempts at a curve, before fixtures change it."""

JUNCTION_REACH = 2.0
"""Distance from a junction within which no clearance is kept, in clearances."""


def flat(*points):
    return np.array([[x, y, 0.0] for x, y in points])


def sampled(curve, count=9):
    """Points of a curve, evenly spaced on each of its segments."""
    ends = np.roll(curve.points, -1, axis=0)
    count_segments = len(curve.points) - (not curve.closed)
    shares = np.linspace(0.0, 1.0, count)[:, None, None]
    return ((1.0 - shares) * curve.points + shares * ends)[:, :count_segments].reshape(-1, 3)


def distance_in_plane(curve, other, junction=None, reach=0.0):
    """Least distance of a curve in a plane to another one, away from a junction."""
    points = sampled(curve)
    if junction is not None:
        points = points[np.linalg.norm(points - junction, axis=1) > reach]
    last = None if other.closed else -1
    start, end = other.points[:last], np.roll(other.points, -1, axis=0)[:last]
    return min(
        distance_to_segments(
            points, np.broadcast_to(a, points.shape), np.broadcast_to(b, points.shape)
        ).min()
        for a, b in zip(start, end, strict=True)
    )


def on_curve(curve, share):
    """A point of a curve, at a fraction of its points."""
    return curve.points[round(share * (len(curve.points) - 1))]


@pytest.fixture(scope="module")
def plate():
    return shapes.disc(18)


@pytest.fixture(scope="module")
def line(plate):
    """A straight line in the middle of the plate."""
    return nicmm.design_curve(plate, flat((-0.5, 0.0), (0.5, 0.0)), closed=False)


@pytest.mark.slow
@pytest.mark.parametrize("clearance", [0.07, 0.05, 0.02, 0.005])
def test_a_parallel_line_keeps_the_clearance_and_no_more(plate, line, clearance):
    """Free, the curve would dip across the line between its two middle points."""
    side = 1.3 * clearance
    points = flat((-0.6, 0.5), (-0.35, side), (0.35, side), (0.6, 0.5))
    free = nicmm.design_curve(plate, points, closed=False)
    assert contacts(plate, free.curves[0], line.curves[0])
    design = nicmm.design_curve(plate, points, closed=False, avoid=[line], clearance=clearance)
    assert_valid_design(plate, design, points, closed=False)
    assert not contacts(plate, design.curves[0], line.curves[0])
    distance = distance_in_plane(design.curves[0], line.curves[0])
    assert LEAST * clearance <= distance <= MOST * clearance


@pytest.mark.slow
def test_without_clearance_it_only_does_not_cross(plate, line):
    points = flat((-0.6, 0.5), (-0.35, 0.03), (0.35, 0.03), (0.6, 0.5))
    design = nicmm.design_curve(plate, points, closed=False, avoid=[line.curves[0]])
    assert_valid_design(plate, design, points, closed=False)
    assert not contacts(plate, design.curves[0], line.curves[0])
    assert 0.0 < distance_in_plane(design.curves[0], line.curves[0]) < 0.005


def test_the_barrier_covers_the_whole_curve(ball):
    """Also where the curve runs close to edges, so that the strip beside it is very narrow."""
    around = np.array([[1.0, 0.1, 0.0], [-0.6, 0.8, 0.2], [-0.4, -0.9, 0.1]])
    curve = nicmm.design_curve(ball, nearest_vertices(ball, around)).curves[0]
    manifold = next(nicmm.Designer(ball)._whole.manifolds())
    avoided = avoided_curves(ball, [curve], points_of(curve)[:0])
    off = surface_off_curves(manifold, avoided, 0.0).mesh
    areas = np.bincount(off.face_component, weights=off.face_areas)
    sides = np.isin(off.face_component, np.argsort(areas)[-2:])
    assert off.face_areas[sides].sum() > 0.98 * ball.face_areas.sum()
    _, away = nearest_points(off, sampled(curve), np.flatnonzero(sides))
    assert away.min() > 1e-8


@pytest.mark.slow
def test_it_goes_round_the_end(plate, line):
    points = flat((0.45, 0.1), (0.45, -0.1))
    design = nicmm.design_curve(plate, points, closed=False, avoid=[line], clearance=CLEARANCE)
    assert design.curves[0].points[:, 0].max() > 0.5 + LEAST * CLEARANCE
    distance = distance_in_plane(design.curves[0], line.curves[0])
    assert LEAST * CLEARANCE <= distance


@pytest.mark.slow
def test_distance_on_a_torus():
    """A curve around the tube is pushed towards another one by points on both sides."""
    mesh = shapes.torus(around=48, across=24)

    def around_tube(degrees, *across):
        u, v = np.radians(degrees), np.radians(across)
        radius = 1.0 + 0.4 * np.cos(v)
        return np.stack([radius * np.cos(u), radius * np.sin(u), 0.4 * np.sin(v)], axis=1)

    first = nicmm.design_curve(mesh, nearest_vertices(mesh, around_tube(0.0, 0, 120, 240)))
    points = nearest_vertices(
        mesh, np.concatenate([around_tube(16.0, 0, 180), around_tube(8.0, 90)])[[0, 2, 1]]
    )
    clearance = 0.12
    design = nicmm.design_curve(mesh, points, avoid=[first], clearance=clearance)
    assert_valid_design(mesh, design, mesh.vertices[points])
    distance = least_distance(mesh, design.curves[0], first.curves[0], clearance / 8)
    assert distance >= LEAST * clearance


@pytest.mark.slow
def test_two_curves_on_a_torus_keep_their_distance_and_no_more(monkeypatch):
    """The distance from the outer equator is that along a meridian, r |v|."""
    monkeypatch.setattr(improvement, "MOST_WORK", MOST_WORK)  # the first course may have kinks
    mesh, tube = shapes.torus(around=128, across=64), 0.4

    def on_torus(degrees, across):
        u, radius = np.radians(degrees), 1.0 + tube * np.cos(across)
        places = np.stack([radius * np.cos(u), radius * np.sin(u), tube * np.sin(across)], axis=1)
        return nearest_points(mesh, places)[0]

    def least_distance_from_equator(curve):
        x, y, z = curve.points.T
        return (tube * np.arctan2(z, np.hypot(x, y) - 1.0)).min()

    first = nicmm.design_curve(mesh, on_torus(np.arange(0.0, 360.0, 30.0), np.zeros(12)))
    assert np.abs(first.curves[0].points[:, 2]).max() < 1e-4
    points = on_torus(np.array([-40.0, -12.0, 12.0, 40.0]), np.array([0.6, 0.17, 0.17, 0.6]))
    free = nicmm.design_curve(mesh, points, closed=False)
    assert least_distance_from_equator(free.curves[0]) < 0.9 * CLEARANCE
    design = nicmm.design_curve(mesh, points, closed=False, avoid=[first], clearance=CLEARANCE)
    assert_valid_design(mesh, design, points.positions(mesh), closed=False)
    distance = least_distance_from_equator(design.curves[0])
    assert LEAST * CLEARANCE <= distance <= MOST * CLEARANCE


def test_distance_from_a_great_circle():
    """Between two points near a great circle, the clearance pushes the curve off the circle."""
    mesh = shapes.sphere(4)
    angle = np.radians([0.0, 90.0, 180.0, 270.0])
    circle = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    first = nicmm.design_curve(mesh, nearest_vertices(mesh, circle))
    height, clearance = 0.14, 0.1
    ends = np.radians([-50.0, 0.0, 50.0])
    wanted = np.stack([np.cos(ends), np.sin(ends), [0.5, height, 0.5]], axis=1)
    points = nearest_vertices(mesh, wanted / np.linalg.norm(wanted, axis=1, keepdims=True))
    design = nicmm.design_curve(mesh, points, closed=False, avoid=[first], clearance=clearance)
    assert_valid_design(mesh, design, mesh.vertices[points], closed=False)
    distance = np.arcsin(
        design.curves[0].points[:, 2] / np.linalg.norm(design.curves[0].points, axis=1)
    )
    assert distance.min() >= LEAST * clearance


@pytest.mark.parametrize("clearance", [0.0, CLEARANCE])
class TestJunctions:
    """A control point on an avoided curve is a junction and not a crossing."""

    def design(self, plate, line, points, clearance, closed=False):
        design = nicmm.design_curve(plate, points, closed=closed, avoid=[line], clearance=clearance)
        assert_valid_design(plate, design, points, closed=closed)
        return design.curves[0]

    @pytest.mark.slow
    def test_t(self, plate, line, clearance):
        end = on_curve(line.curves[0], 0.6)
        points = np.stack([[-0.3, 0.5, 0.0], [0.2, 0.3, 0.0], end])
        curve = self.design(plate, line, points, clearance)
        assert contacts(plate, curve, line.curves[0], end[None]) == 0
        reach = JUNCTION_REACH * clearance
        assert distance_in_plane(curve, line.curves[0], end, reach) >= LEAST * clearance

    def test_t_at_the_end_of_the_other_curve(self, plate, line, clearance):
        end = line.curves[0].points[-1]
        curve = self.design(plate, line, np.stack([end, [0.5, 0.5, 0.0]]), clearance)
        assert contacts(plate, curve, line.curves[0], end[None]) == 0

    @pytest.mark.slow
    def test_x(self, plate, line, clearance):
        middle = on_curve(line.curves[0], 0.4)
        points = np.stack([[-0.2, -0.5, 0.0], middle, [0.2, 0.5, 0.0]])
        curve = self.design(plate, line, points, clearance)
        assert contacts(plate, curve, line.curves[0], middle[None]) == 0
        reach = JUNCTION_REACH * clearance
        assert distance_in_plane(curve, line.curves[0], middle, reach) >= LEAST * clearance
        heights = curve.points[:, 1]
        assert np.count_nonzero(np.diff(np.sign(heights[np.abs(heights) > 1e-6]))) == 1

    @pytest.mark.slow
    def test_a_closed_curve_passes_twice(self, plate, line, clearance):
        left, right = on_curve(line.curves[0], 0.2), on_curve(line.curves[0], 0.8)
        points = np.stack([left, [0.0, 0.4, 0.0], right, [0.0, -0.4, 0.0]])
        curve = self.design(plate, line, points, clearance, closed=True)
        assert contacts(plate, curve, line.curves[0], np.stack([left, right])) == 0

    @pytest.mark.slow
    def test_three_curves_share_a_point(self, plate, line, clearance):
        shared = on_curve(line.curves[0], 0.5)
        first = self.design(plate, line, np.stack([[-0.4, 0.5, 0.0], shared]), clearance)
        points = np.stack([[0.5, 0.4, 0.0], shared])
        design = nicmm.design_curve(
            plate, points, closed=False, avoid=[line, first], clearance=clearance
        )
        assert_valid_design(plate, design, points, closed=False)
        for other in (line.curves[0], first):
            assert contacts(plate, design.curves[0], other, shared[None]) == 0


class TestArguments:
    def test_not_a_list(self, plate, line):
        with pytest.raises(nicmm.ArgumentError, match="avoid is a SurfaceCurve; pass a list"):
            nicmm.design_curve(plate, [3, 50, 90], avoid=line.curves[0])
        with pytest.raises(nicmm.ArgumentError, match=r"avoid\[1\] is 7; pass a SurfaceCurve"):
            nicmm.design_curve(plate, [3, 50, 90], avoid=[line, 7])

    def test_on_another_mesh(self, plate, line, ball):
        with pytest.raises(nicmm.CurveError, match=r"avoid\[0\]"):
            nicmm.design_curve(ball, [3, 50, 90], avoid=[line])

    def test_another_method(self, plate, line):
        with pytest.raises(nicmm.ArgumentError, match='avoid needs the method "elastic"'):
            nicmm.design_curve(plate, [3, 50, 90], avoid=[line], method="variational")

    def test_with_a_mirror(self, plate, line):
        with pytest.raises(nicmm.ArgumentError, match="avoid and mirror cannot be combined"):
            nicmm.design_curve(plate, [3, 50, 90], avoid=[line], mirror=((0, 0, 0), (1, 0, 0)))

    def test_clearance_alone(self, plate):
        with pytest.raises(nicmm.ArgumentError, match="without obstacles or avoid"):
            nicmm.design_curve(plate, [3, 50, 90], clearance=0.1)

    def test_too_close(self, plate, line):
        points = flat((-0.5, 0.5), (0.0, 0.04), (0.5, 0.5))
        with pytest.raises(
            nicmm.ControlPointError, match=r"control_points\[1\] is closer"
        ) as error:
            nicmm.design_curve(plate, points, closed=False, avoid=[line], clearance=0.05)
        assert [point.index for point in error.value.points] == [1]

    def test_separated(self, plate):
        fence = nicmm.design_curve(plate, flat((-0.6, 0.0), (0.0, 0.6), (0.6, 0.0), (0.0, -0.6)))
        with pytest.raises(
            nicmm.UnreachableError, match=r"separate control_points\[1\] from"
        ) as error:
            nicmm.design_curve(plate, flat((0.0, 0.0), (0.9, 0.0)), closed=False, avoid=[fence])
        assert [point.index for point in error.value.points] == [1, 0]

    @pytest.mark.parametrize("clearance", [1e-300, 1e-12, 1e-6])
    def test_clearance_that_cannot_be_resolved(self, plate, line, clearance):
        with pytest.raises(nicmm.ArgumentError, match="too small beside the lengths"):
            nicmm.design_curve(plate, [3, 50], closed=False, avoid=[line], clearance=clearance)

    @pytest.mark.slow
    def test_nothing_left(self, plate, line):
        with pytest.raises(nicmm.UnreachableError, match="avoid leaves no part of the surface"):
            nicmm.design_curve(plate, [3, 50, 90], avoid=[line], clearance=5.0)

    def test_an_empty_list_has_no_effect(self, plate):
        plain = nicmm.design_curve(plate, [3, 50, 90]).curves[0]
        empty = nicmm.design_curve(plate, [3, 50, 90], avoid=[]).curves[0]
        np.testing.assert_array_equal(plain.points, empty.points)


@pytest.mark.slow
def test_with_obstacles(plate, line):
    """The clearance is kept from both."""
    obstacle = np.array([0.0, 0.35, 0.0])
    weights = (np.linalg.norm(plate.vertices - obstacle, axis=1) < 0.12).astype(float)
    points = flat((-0.6, 0.2), (0.6, 0.2))
    design = nicmm.design_curve(
        plate, points, closed=False, avoid=[line], obstacles=weights, clearance=CLEARANCE
    )
    assert_valid_design(plate, design, points, closed=False)
    assert distance_in_plane(design.curves[0], line.curves[0]) >= LEAST * CLEARANCE
    hard = plate.vertices[weights == 1.0]
    away = np.linalg.norm(sampled(design.curves[0])[:, None] - hard, axis=2)
    assert away.min() >= LEAST * CLEARANCE


@pytest.mark.slow
def test_dragging_keeps_the_side(plate, line):
    designer = nicmm.Designer(plate)
    points = flat((-0.4, 0.4), (0.0, 0.25), (0.4, 0.4))
    given = {"closed": False, "avoid": [line], "clearance": CLEARANCE}
    before = designer.design(points, **given)
    for height in (0.2, 0.15, 0.1, 0.06):
        points[1, 1] = height
        before = designer.design(points, **given, start=before)
        assert_valid_design(plate, before, points, closed=False)
        assert distance_in_plane(before.curves[0], line.curves[0]) >= LEAST * CLEARANCE
    crossing = designer.design(flat((-0.1, 0.5), (0.1, -0.5)), closed=False)
    with pytest.raises(nicmm.CurveError, match="start crosses a curve of avoid"):
        designer.design(flat((-0.1, 0.5), (0.6, 0.5)), **given, start=crossing)


@pytest.mark.slow
def test_equal_arguments_give_equal_curves(plate, line):
    designer = nicmm.Designer(plate)
    points = flat((-0.6, 0.5), (-0.3, 0.07), (0.3, 0.07), (0.6, 0.5))
    given = {"closed": False, "avoid": [line], "clearance": CLEARANCE}
    first = designer.design(points, **given)
    designer.design(points, closed=False, avoid=[line], clearance=0.03)
    again, other = designer.design(points, **given), nicmm.design_curve(plate, points, **given)
    for design in (again, other):
        np.testing.assert_array_equal(design.curves[0].points, first.curves[0].points)


@pytest.mark.slow
@pytest.mark.parametrize(
    "change",
    [
        "soup",
        "doubled faces",
        "T-junctions",
        "half of the faces turned",
        "faces without area",
        "gaps",
    ],
)
def test_on_defective_meshes(plate, change):
    mesh = changed(plate, change, seed=1).mesh
    line = nicmm.design_curve(mesh, flat((-0.5, 0.0), (0.5, 0.0)), closed=False)
    points = flat((-0.6, 0.5), (-0.35, 0.065), (0.35, 0.065), (0.6, 0.5))
    design = nicmm.design_curve(mesh, points, closed=False, avoid=[line], clearance=CLEARANCE)
    assert judge(mesh, design, points, closed=False).faults == []
    distance = distance_in_plane(design.curves[0], line.curves[0])
    assert LEAST * CLEARANCE <= distance <= MOST * CLEARANCE


def test_command_line(plate, line, tmp_path):
    write_mesh(tmp_path / "plate.ply", plate)
    write_curve(tmp_path / "line.json", line.curves[0])
    kept = read_curve(tmp_path / "line.json")
    np.testing.assert_array_equal(kept.points, line.curves[0].points)
    points = nearest_vertices(plate, flat((-0.6, 0.4), (0.0, 0.1), (0.6, 0.4)))
    arguments = [
        "design",
        str(tmp_path / "plate.ply"),
        "--open",
        "--points",
        ",".join(map(str, points)),
    ]
    arguments += ["--clearance", "0.05", "-o", str(tmp_path / "curve.json")]
    assert main([*arguments, "--avoid", str(tmp_path / "line.json")]) == 0
    expected = nicmm.design_curve(plate, points, closed=False, avoid=[line], clearance=0.05).curves[
        0
    ]
    written = json.loads((tmp_path / "curve.json").read_text())
    np.testing.assert_allclose(written["points"], expected.points, rtol=0, atol=1e-9)


@pytest.mark.parametrize("text", ["{", "[]", '{"closed": true}', '{"faces": 3}', "null"])
def test_a_file_without_a_curve(tmp_path, text):
    path = tmp_path / "curve.json"
    path.write_text(text)
    with pytest.raises(nicmm.ArgumentError, match="contains no curve"):
        read_curve(path)


MANY = {
    "sphere": lambda seed: shapes.sphere(3),
    "torus": lambda seed: shapes.torus(around=30 + seed, across=15 + seed % 4),
    "creature": lambda seed: shapes.creature(seed, resolution=32, faces=200, subdivisions=1),
    "double torus": lambda seed: shapes.double_torus(400),
    "disc": lambda seed: shapes.disc(10 + seed % 4),
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "seed"),
    [("sphere", 0), ("torus", 1), ("creature", 2), ("disc", 3), ("double torus", 2)],
)
def test_five_curves_on_one_mesh(kind, seed):
    """Each curve avoids those before it; points that cannot be joined are chosen again."""
    mesh = MANY[kind](seed)
    generator = np.random.default_rng(seed)
    clearance = [0.0, 0.01, 0.02, 0.03][seed] * mesh.diagonal
    designer, curves, attempts = nicmm.Designer(mesh), [], 0
    free = np.ones(len(mesh.vertices), dtype=bool)  # a shared point would be a junction
    while len(curves) < 5:
        attempts += 1
        assert attempts < 60
        closed = bool(generator.random() < 0.2)
        first = generator.integers(len(mesh.vertices))
        away = np.linalg.norm(mesh.vertices - mesh.vertices[first], axis=1)
        near = np.flatnonzero(free & (away < 0.3 * mesh.diagonal))
        count = int(generator.integers(3 if closed else 2, 5))
        points = generator.choice(near, size=count, replace=False)
        given = {"avoid": curves, "clearance": clearance} if curves else {}
        try:
            design = designer.design(points, closed=closed, **given)
        except (nicmm.UnreachableError, nicmm.ControlPointError):
            continue
        assert judge(mesh, design, points, closed).faults == []
        curve = design.curves[0]
        for other in curves:
            assert contacts(mesh, curve, other) == 0
            if clearance:
                assert least_distance(mesh, curve, other, clearance / 6) >= LEAST * clearance
        curves.append(curve)
        free[points] = False


class TestCheckAvoids:
    """The check of mirror images, which are not relaxed."""

    MIRROR = ((0.0, 0.0, 0.0), (0.0, 1.0, 0.0))

    @pytest.fixture
    def line(self, plate):
        """The same line, which a third point keeps straighter than relaxation does."""
        points = flat((-0.5, 0.0), (0.0, 0.0), (0.5, 0.0))
        return nicmm.design_curve(plate, points, closed=False)

    def image(self, plate, height, start=-0.3):
        points = flat((start, -height), (0.5 * (start + 0.3), -height), (0.3, -height))
        return nicmm.mirrored(plate, nicmm.design_curve(plate, points, closed=False), self.MIRROR)

    @pytest.mark.slow
    @pytest.mark.parametrize(("height", "clearance"), [(0.1, 0.09), (0.1, 0.0), (0.02, 0.019)])
    def test_far_enough(self, plate, line, height, clearance):
        image = self.image(plate, height)
        assert distance_in_plane(image.curves[0], line.curves[0]) == pytest.approx(height, rel=0.02)
        nicmm.Designer(plate).check_avoids(image, [line], clearance)

    @pytest.mark.parametrize(("height", "clearance"), [(0.1, 0.11), (0.02, 0.021)])
    def test_too_close(self, plate, line, height, clearance):
        image = self.image(plate, height)
        with pytest.raises(nicmm.UnreachableError, match=r"design comes closer to avoid\[1\]"):
            far = nicmm.design_curve(plate, flat((-0.5, 0.6), (0.5, 0.6)), closed=False)
            nicmm.Designer(plate).check_avoids(image, [far, line], clearance)

    def test_crossing(self, plate, line):
        crossing = nicmm.design_curve(plate, flat((0.0, -0.3), (0.1, 0.3)), closed=False)
        with pytest.raises(nicmm.UnreachableError, match=r"design crosses avoid\[0\]"):
            nicmm.Designer(plate).check_avoids(crossing, [line])

    @pytest.mark.parametrize("clearance", [0.0, CLEARANCE])
    def test_control_points_are_junctions(self, plate, line, clearance):
        points = np.stack([[0.1, 0.4, 0.0], on_curve(line.curves[0], 0.5)])
        ending = nicmm.design_curve(plate, points, closed=False)
        nicmm.Designer(plate).check_avoids(ending, [line], clearance)

    @pytest.mark.slow
    def test_on_a_defective_mesh(self, plate):
        """The distance is measured on the repaired surface."""
        mesh = changed(plate, "soup", seed=1).mesh
        line, other = (
            nicmm.design_curve(mesh, flat((-0.5, height), (0.5, height)), closed=False)
            for height in (-0.05, 0.05)
        )
        nicmm.Designer(mesh).check_avoids(other, [line], 0.09)
        with pytest.raises(nicmm.UnreachableError, match="than the clearance"):
            nicmm.Designer(mesh).check_avoids(other, [line], 0.11)
