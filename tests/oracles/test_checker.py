"""Tests the checker on curves with one known fault, and against elementary geometry."""

from dataclasses import replace
from fractions import Fraction
from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import shapes
from tests.oracles.checker import judge, judge_curve

# Two triangles that share the edge (0, 2).
SQUARE = nicmm.Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])


def on_square(places, closed=True, controls=(), lower=None):
    """A curve on the square; ``lower`` selects the face for points on the diagonal."""
    places = np.asarray(places, dtype=float)
    x, y = places.T
    below = x > y if lower is None else np.where(x == y, lower, x > y)
    first = np.stack([1 - x, x - y, y], axis=1)
    second = np.stack([1 - y, x, y - x], axis=1)
    faces = np.where(below, 0, 1)
    barycentric = np.where(below[:, None], first, second)
    points = np.pad(places, ((0, 0), (0, 1)))
    index = np.array(controls, dtype=np.int64)
    return nicmm.SurfaceCurve(closed, faces, barycentric, points, index)


def contacts(curve):
    """Repeated points, crossings and touchings of a curve without other faults."""
    verdict = judge_curve(SQUARE, curve, closed=curve.closed)
    assert not verdict.off_surface
    return verdict.points_twice, verdict.crossings, verdict.touchings


class TestSelfContacts:
    def test_a_simple_curve_has_none(self):
        curve = on_square([[0.25, 0.25], [0.5, 0.25], [0.5, 0.5], [0.25, 0.5]])
        assert contacts(curve) == (0, 0, 0)
        assert not judge_curve(SQUARE, curve).faults

    def test_two_strands_that_cross_in_a_face(self):
        assert contacts(on_square([[0.5, 0.1], [0.9, 0.2], [0.9, 0.1], [0.5, 0.2]])) == (0, 1, 0)

    def test_a_point_on_another_strand(self):
        curve = on_square([[0.5, 0.125], [0.875, 0.125], [0.875, 0.25], [0.75, 0.125], [0.5, 0.25]])
        assert contacts(curve) == (0, 0, 1)

    def test_a_strand_that_turns_back_on_itself(self):
        curve = on_square([[0.5, 0.25], [0.875, 0.25], [0.625, 0.25]], closed=False)
        assert contacts(curve) == (0, 0, 1)

    @pytest.mark.parametrize("lower", [[True] * 7, [True, True, False, True, False, True, True]])
    def test_a_point_of_an_edge_passed_from_two_faces(self, lower):
        places = [
            [0.5, 0.2],
            [0.6, 0.3],
            [0.5, 0.5],
            [0.8, 0.6],
            [0.5, 0.5],
            [0.3, 0.2],
            [0.4, 0.1],
        ]
        assert contacts(on_square(places, lower=lower)) == (1, 0, 0)

    def test_a_corner_passed_twice(self):
        places = [[0.5, 0.25], [0.0, 0.0], [0.25, 0.5], [0.5, 0.75], [0.0, 0.0], [0.75, 0.25]]
        curve = on_square(places, lower=[True, True, True, True, False, True])
        assert contacts(curve)[0] == 1

    @pytest.mark.parametrize("lower", [True, False])
    def test_a_point_that_touches_a_strand_along_an_edge(self, lower):
        """The strand is given in the lower face, and the point that touches it in either face."""
        places = [[0.25, 0.25], [0.75, 0.75], [0.5, 0.75], [0.5, 0.5], [0.25, 0.5]]
        curve = on_square(places, lower=[True, True, False, lower, False])
        assert contacts(curve) == (0, 0, 1)

    def test_a_strand_along_an_edge_from_corner_to_corner(self):
        places = [[0.0, 0.0], [1.0, 1.0], [0.5, 0.75], [0.5, 0.5], [0.25, 0.5]]
        assert contacts(on_square(places)) == (0, 0, 1)
        assert contacts(on_square(places[:3] + places[4:])) == (0, 0, 0)

    def test_strands_one_rounding_apart_do_not_touch(self):
        places = np.array([[0.25, 0.25], [0.75, 0.75], [0.5, 0.75], [0.5, 0.5], [0.25, 0.5]])
        places[3, 0] = np.nextafter(0.5, 0.0)
        assert contacts(on_square(places)) == (0, 0, 0)

    @pytest.mark.slow
    @pytest.mark.parametrize("closed", [True, False])
    def test_same_verdict_as_plain_geometry(self, closed):
        """Random polygons on a coarse grid, on which touching is as common as crossing."""
        generator = np.random.default_rng(3)
        counts = {True: 0, False: 0}
        for _ in range(400):
            grid = generator.integers(0, 7, size=(generator.integers(3, 6), 2))
            grid = grid[generator.random() < 0.5 or grid[:, 0] >= grid[:, 1]].reshape(-1, 2)
            if len(grid) < 3:
                continue
            places = crossing_points(grid / 8.0, closed)
            twice, crossings, touchings = contacts(on_square(places, closed))
            simple = is_simple(places, closed)
            assert (twice + crossings + touchings == 0) == simple, places
            counts[simple] += 1
        assert min(counts.values()) > 50


def crossing_points(corners, closed):
    """Polygon with points where it crosses the diagonal, so that each chord lies in one face."""
    places = []
    ends = np.roll(corners, -1, axis=0) if closed else corners[1:]
    for start, end in zip(corners, ends, strict=False):
        places.append(start)
        before, after = start[0] - start[1], end[0] - end[1]
        if before * after < 0:
            middle = (start + before / (before - after) * (end - start)).mean()
            places.append([middle, middle])
    return np.array(places if closed else [*places, corners[-1]])


def is_simple(places, closed):
    """Whether no two sides of a polygon meet, except consecutive sides at their common corner."""
    exact = [tuple(Fraction(float(x)) for x in place) for place in places]
    n = len(exact)
    sides = [(exact[i], exact[(i + 1) % n]) for i in range(n if closed else n - 1)]
    if len(set(exact)) < n:
        return False
    for (i, first), (j, second) in combinations(enumerate(sides), 2):
        common = set(first) & set(second)
        if common:
            # For consecutive sides, the free end of one must not lie on the other.
            (p,) = set(first) - common or {None}
            (q,) = set(second) - common or {None}
            if p is None or q is None or lies_on(p, second) or lies_on(q, first):
                return False
            assert j - i in (1, n - 1)
        elif meet(first, second):
            return False
    return True


def turn(p, q, r):
    area = (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
    return (area > 0) - (area < 0)


def lies_on(p, side):
    a, b = side
    within = all(min(a[i], b[i]) <= p[i] <= max(a[i], b[i]) for i in (0, 1))
    return within and turn(a, b, p) == 0


def meet(first, second):
    crossing = (
        turn(*first, second[0]) * turn(*first, second[1]) < 0
        and turn(*second, first[0]) * turn(*second, first[1]) < 0
    )
    return (
        crossing or any(lies_on(p, second) for p in first) or any(lies_on(p, first) for p in second)
    )


class TestSurface:
    @pytest.fixture
    def square(self):
        return on_square([[0.25, 0.25], [0.5, 0.25], [0.5, 0.5], [0.25, 0.5]])

    def test_a_chord_across_two_faces(self):
        verdict = judge_curve(SQUARE, on_square([[0.25, 0.25], [0.5, 0.25], [0.25, 0.5]]))
        assert verdict.chords_off_face == 1 and verdict.faults

    def test_a_chord_between_corners_that_no_edge_joins(self):
        strip = nicmm.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], [[0, 1, 2], [1, 3, 2]])
        corner = nicmm.SurfaceCurve(
            False, np.array([0, 1]), np.array([[1.0, 0, 0], [0, 1, 0]]),
            strip.vertices[[0, 3]], np.array([0, 1]),
        )  # fmt: skip
        assert judge_curve(strip, corner, closed=False).chords_off_face == 1

    def test_a_chord_round_an_empty_triangle(self):
        """Three edges around a hole, which do not bound a face of the mesh."""
        faces = [[0, 1, 3], [1, 2, 3], [2, 0, 3]]
        open_tetrahedron = nicmm.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], faces)
        middles = np.array([[0.5, 0.5, 0], [0.5, 0.5, 0], [0.5, 0.5, 0]])
        points = nicmm.SurfacePoints(np.arange(3), middles).positions(open_tetrahedron)
        none = np.zeros(0, dtype=np.int64)
        curve = nicmm.SurfaceCurve(True, np.arange(3), middles, points, none)
        assert judge_curve(open_tetrahedron, curve).chords_off_face == 3

    def test_points_beside_their_barycentrics(self, square):
        moved = square.points + [0.0, 0.0, 1e-14]
        assert judge_curve(SQUARE, replace(square, points=moved)).off_surface

    def test_weights_that_are_negative_or_do_not_sum_to_one(self, square):
        for error in ([1e-9, 0, 0], [1e-9, -1.0, 1.0]):
            wrong = replace(square, barycentric=square.barycentric + error)
            assert judge_curve(SQUARE, wrong).weight_error >= 1e-9

    @pytest.mark.parametrize(
        "change",
        [
            {"faces": np.array([0, 0, 1, 2])},
            {"faces": np.array([0, 0, 1])},
            {"points": np.full((4, 3), np.nan)},
            {"barycentric": np.zeros((4, 3))},
            {"control_index": np.array([0, 4, 1])},
        ],
    )
    def test_arrays_that_cannot_be_read(self, square, change):
        verdict = judge_curve(SQUARE, replace(square, **change))
        assert not verdict.readable and verdict.faults


class TestControlPoints:
    corners = np.array([[0.25, 0.25, 0], [0.5, 0.25, 0], [0.5, 0.5, 0], [0.25, 0.5, 0]])

    def judged(self, asked, controls, closed=True, order="given", curves=1):
        curve = on_square(self.corners[:, :2], closed, controls)
        design = SimpleNamespace(curves=[curve] * curves)
        return judge(SQUARE, design, np.asarray(asked), closed, order)

    def test_the_order_given(self):
        assert not self.judged(self.corners[[0, 1, 2]], [0, 1, 2]).faults
        assert not self.judged(self.corners[[2, 3, 0]], [2, 3, 0]).faults
        assert self.judged(self.corners[[2, 1, 0]], [0, 1, 2]).interpolation_error > 0.1
        assert not self.judged(self.corners[[2, 1, 0]], [2, 1, 0]).in_order

    def test_any_order_of_all_points(self):
        assert not self.judged(self.corners[[2, 0, 1]], [0, 1, 2], order="shortest").faults
        twice = self.corners[[0, 1, 1]]
        assert not self.judged(twice, [0, 1, 2], order="shortest").in_order

    def test_a_point_missed(self):
        asked = self.corners[:3] + [[0, 0, 0], [1e-9, 0, 0], [0, 0, 0]]
        verdict = self.judged(asked, [0, 1, 2])
        assert verdict.interpolation_error == pytest.approx(1e-9 / np.sqrt(2.0))
        assert verdict.faults
        assert self.judged(self.corners[:3], [0, 1, -1]).interpolation_error == np.inf
        assert self.judged(self.corners[:3], [0, 1]).faults

    def test_an_open_curve_ends_at_control_points(self):
        assert not self.judged(self.corners[[0, 1, 3]], [0, 1, 3], closed=False).faults
        assert not self.judged(self.corners[[0, 1, 2]], [0, 1, 2], closed=False).in_order

    def test_closed_and_one(self):
        curve = on_square(self.corners[:, :2], False)
        assert judge_curve(SQUARE, curve).faults == ["it is not closed or open as asked"]
        assert self.judged(self.corners[:3], [0, 1, 2], curves=2).faults
        assert self.judged(self.corners[:3], [0, 1, 2], curves=0).faults


@pytest.mark.slow
def test_a_curve_on_a_large_mesh():
    """Curves along a parallel of a torus: through vertices, and through midpoints beside it."""
    mesh = shapes.torus(around=500, across=120)
    assert len(mesh.faces) > 100_000
    along = np.arange(500) * 120
    beside = np.stack([along, along + 1], axis=1)
    straight = curve_through(mesh, along[:, None])
    assert judge_curve(mesh, straight, mesh.vertices[along[[0, 200, 400]]]).in_order is False
    controlled = replace(straight, control_index=np.array([0, 200, 400]))
    assert not judge_curve(mesh, controlled, mesh.vertices[along[[0, 200, 400]]]).faults
    assert judge_curve(mesh, curve_through(mesh, beside)).chords_off_face == 500
    diagonal = np.stack([along, np.roll(along, -1) + 1], axis=1)
    zigzag = np.stack([beside, diagonal], axis=1).reshape(-1, 2)
    assert not judge_curve(mesh, curve_through(mesh, zigzag)).faults


def curve_through(mesh, corners):
    """A closed curve through vertices (n, 1), or through the midpoints of edges (n, 2)."""
    around = {
        v: set(mesh.vertex_faces[[v]].indices.tolist()) for v in set(corners.ravel().tolist())
    }
    faces = np.array([min(set.intersection(*(around[v] for v in row))) for row in corners.tolist()])
    weights = (mesh.faces[faces][:, :, None] == corners[:, None, :]).sum(axis=2) / corners.shape[1]
    points = nicmm.SurfacePoints(faces, weights).positions(mesh)
    return nicmm.SurfaceCurve(True, faces, weights, points, np.zeros(0, dtype=np.int64))
