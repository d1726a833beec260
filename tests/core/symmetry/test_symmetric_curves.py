"""Tests that curves with a mirror are their own mirror image, and what else they guarantee."""

import json

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import progress, shapes
from nicmm_core.commands import main
from nicmm_core.io.files import read_mesh, write_mesh
from tests.core.checks import assert_valid_curve, circle, flipped, joined, renumbered
from tests.core.symmetry.symmetric_meshes import (
    FLIP,
    MIRROR,
    crossing_angles,
    is_symmetric,
    points_on_right,
    symmetric_creature,
)
from tests.oracles.named_curves import nearest_vertices

pytestmark = pytest.mark.usefixtures("one_attempt_each")

SYMMETRIC = 1e-6
"""Greatest asymmetry on symmetric surfaces, relative to the diagonal."""

RIGHT_ANGLE, ON_COARSE_MESH = 1e-2, 5e-2
"""Greatest deviation from a right angle at the plane, in radians; it falls with the edge length."""


def assert_symmetric(mesh, design, points, closed=True, angle=ON_COARSE_MESH):
    """Assert everything that a curve through the given points with the mirror x = 0 guarantees."""
    assert design.status is nicmm.Status.CONVERGED
    (curve,) = design.curves
    images = curve.points[curve.control_index]
    assert_valid_curve(mesh, curve, images, closed)
    assert design.asymmetry <= SYMMETRIC * mesh.diagonal
    backward = images[::-1]
    if closed:
        nearest = np.linalg.norm(backward - FLIP * images[0], axis=1).argmin()
        backward = np.roll(backward, -nearest, axis=0)
    np.testing.assert_allclose(FLIP * images, backward, rtol=0, atol=1e-6 * mesh.diagonal)
    for point in points:
        assert (images == point).all(axis=1).any()
    angles = crossing_angles(mesh, curve)
    assert len(angles) == (2 if closed else 1)
    assert max(angles) < angle


class TestClosedForms:
    def test_circle_through_pairs_of_points_on_a_sphere(self, ball):
        """The relaxed curve through points of a great circle is that circle."""
        points = circle([-1.0, 0.3, 1.2])
        design = nicmm.design_curve(ball, nearest_vertices(ball, points), mirror=MIRROR)
        assert_symmetric(ball, design, [])
        np.testing.assert_allclose(design.curves[0].points[:, 2], 0.0, atol=5e-3)
        assert design.curves[0].length == pytest.approx(2 * np.pi, rel=2e-3)

    def test_open_curve_on_a_plane_strip_is_straight(self):
        mesh = strip(24)
        design = nicmm.design_curve(
            mesh, [[0.9, 0.1, 0.0], [0.5, 0.1, 0.0]], closed=False, mirror=MIRROR
        )
        assert_symmetric(mesh, design, [], closed=False)
        np.testing.assert_allclose(design.curves[0].points[:, 1], 0.1, atol=1e-4)
        assert design.curves[0].length == pytest.approx(1.8)

    def test_one_point_and_its_image_are_joined(self):
        mesh = strip(24)
        design = nicmm.design_curve(mesh, [[0.7, 0.05, 0.0]], closed=False, mirror=MIRROR)
        assert design.curves[0].length == pytest.approx(1.4)
        assert len(design.curves[0].control_index) == 2


def strip(count):
    """The rectangle |x| ≤ 1, 0 ≤ y ≤ 0.3, whose triangulation is not symmetric."""
    x, y = np.meshgrid(np.linspace(-1, 1, 2 * count + 1), np.linspace(0, 0.3, 7), indexing="ij")
    index = np.arange(x.size).reshape(x.shape)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    faces = np.concatenate([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)])
    return nicmm.Mesh(np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3), faces.reshape(-1, 3))


FINE = {
    **{f"creature {seed}": (lambda seed=seed: symmetric_creature(seed, 4)) for seed in range(2)},
    "fine torus": lambda: shapes.torus(around=384, across=192),
}
SEEDS = [*range(13), 14]
"""Seeds of creatures; that of 13 and its mirror image are no manifold."""

COARSE = {
    **{f"creature {seed}": (lambda seed=seed: symmetric_creature(seed)) for seed in SEEDS},
    "sphere": lambda: shapes.sphere(4),
    "cube": lambda: shapes.cube(8),
    "disc": shapes.disc,
    "annulus": shapes.annulus,
}


@pytest.mark.slow
@pytest.mark.parametrize("name", COARSE)
def test_curves_on_generated_meshes_are_symmetric(name):
    mesh = COARSE[name]()
    designer = nicmm.Designer(mesh)
    for count, closed, seed in ((2, True, 1), (3, True, 2), (3, False, 3)):
        points = points_on_right(mesh, count, seed)
        design = designer.design(points, closed=closed, order="shortest", mirror=MIRROR)
        assert_symmetric(mesh, design, mesh.vertices[points], closed)


@pytest.mark.slow
@pytest.mark.parametrize("name", FINE)
def test_curves_on_fine_meshes_cross_the_plane_at_right_angles(name):
    mesh = FINE[name]()
    points = points_on_right(mesh, 2, 1)
    design = nicmm.design_curve(mesh, points, mirror=MIRROR)
    assert max(crossing_angles(mesh, design.curves[0])) < RIGHT_ANGLE


@pytest.fixture(scope="module")
def creature():
    mesh = symmetric_creature(2)
    assert is_symmetric(mesh)
    return mesh


@pytest.fixture(scope="module")
def designer(creature):
    return nicmm.Designer(creature)


class TestTheOtherSide:
    """What is on the other side of the plane is found from the given side."""

    @pytest.mark.slow
    def test_points_of_either_side_give_the_same_curve(self, creature):
        points = points_on_right(creature, 3, 4)
        right = nicmm.design_curve(creature, points, mirror=MIRROR)
        images = FLIP * creature.vertices[points]
        left = nicmm.design_curve(creature, images, mirror=MIRROR)
        assert left.curves[0].length == pytest.approx(right.curves[0].length, rel=1e-4)

    @pytest.mark.slow
    def test_every_plane_vector_gives_the_same_plane(self, creature):
        points = points_on_right(creature, 2, 4)
        one = nicmm.design_curve(creature, points, mirror=MIRROR)
        other = nicmm.design_curve(creature, points, mirror=((0.0, 3.0, -9.0), (-1e-200, 0.0, 0.0)))
        np.testing.assert_allclose(other.curves[0].points, one.curves[0].points, atol=1e-12)

    def test_mesh_without_symmetric_triangulation(self):
        mesh = shapes.cube(7)
        points = points_on_right(mesh, 3, 5)
        assert_symmetric(
            mesh, nicmm.design_curve(mesh, points, mirror=MIRROR), mesh.vertices[points]
        )

    def test_asymmetry_of_a_nearly_symmetric_mesh(self, creature):
        bent = creature.vertices + [0.0, 0.0, 0.02] * np.abs(creature.vertices) * (
            creature.vertices[:, :1] < 0.0
        )
        mesh = nicmm.Mesh(bent, creature.faces)
        points = points_on_right(mesh, 3, 4)
        design = nicmm.design_curve(mesh, points, mirror=MIRROR)
        assert 1e-5 < design.asymmetry / mesh.diagonal < 0.02
        (curve,) = design.curves
        assert_valid_curve(mesh, curve, curve.points[curve.control_index])

    def test_without_a_mirror_there_is_no_asymmetry(self, creature):
        assert nicmm.design_curve(creature, points_on_right(creature, 3, 4)).asymmetry is None

    @pytest.mark.slow
    def test_images_on_a_near_component_are_not_used(self, creature):
        """A shell around the body is nearer to some images than the body's own other side."""
        other = nicmm.Mesh(1.01 * FLIP * creature.vertices, creature.faces)
        both = joined(creature, other)
        points = points_on_right(creature, 2, 4)
        alone = nicmm.design_curve(creature, points, mirror=MIRROR)
        design = nicmm.design_curve(both, points, mirror=MIRROR)
        np.testing.assert_allclose(design.curves[0].points, alone.curves[0].points, atol=1e-12)

    def test_faces_that_share_no_vertices(self, creature):
        soup = nicmm.Mesh(
            creature.vertices[creature.faces.ravel()],
            np.arange(creature.faces.size).reshape(-1, 3),
        )
        positions = creature.vertices[points_on_right(creature, 2, 4)]
        design = nicmm.design_curve(soup, positions, mirror=MIRROR)
        assert design.asymmetry <= SYMMETRIC * soup.diagonal


class TestPointsOnThePlane:
    @pytest.mark.slow
    def test_first_and_last_point_of_a_closed_curve(self, creature):
        on_plane = np.flatnonzero(creature.vertices[:, 0] == 0.0)[[0, -1]]
        (inner,) = points_on_right(creature, 1, 3)
        points = [on_plane[0], inner, on_plane[1]]
        design = nicmm.design_curve(creature, points, mirror=MIRROR)
        assert len(design.curves[0].control_index) == 4
        assert_symmetric(creature, design, creature.vertices[points], angle=0.2)

    def test_last_point_of_an_open_curve(self, creature):
        on_plane = np.flatnonzero(creature.vertices[:, 0] == 0.0)[0]
        points = [*points_on_right(creature, 1, 3), on_plane]
        design = nicmm.design_curve(creature, points, closed=False, mirror=MIRROR)
        assert len(design.curves[0].control_index) == 3
        assert_symmetric(creature, design, creature.vertices[points], closed=False, angle=0.2)

    def test_in_the_middle_with_the_shortest_order(self, creature):
        on_plane = np.flatnonzero(creature.vertices[:, 0] == 0.0)[0]
        one, other = points_on_right(creature, 2, 3)
        design = nicmm.design_curve(
            creature, [one, on_plane, other], order="shortest", mirror=MIRROR
        )
        assert_symmetric(creature, design, creature.vertices[[one, on_plane, other]], angle=0.2)


class TestOptions:
    @pytest.mark.slow
    def test_equal_arguments_give_equal_curves(self, creature):
        points = points_on_right(creature, 3, 4)
        designer = nicmm.Designer(creature)
        one = designer.design(points, mirror=MIRROR)
        designer.design(points, closed=False, mirror=MIRROR)
        again = designer.design(points, mirror=MIRROR)
        np.testing.assert_array_equal(one.curves[0].points, again.curves[0].points)

    @pytest.mark.slow
    @pytest.mark.parametrize("changed", [flipped, renumbered])
    def test_numbering_makes_no_difference(self, creature, changed):
        points = creature.vertices[points_on_right(creature, 3, 4)]
        one = nicmm.design_curve(creature, points, mirror=MIRROR)
        other = nicmm.design_curve(changed(creature, 1), points, mirror=MIRROR)
        np.testing.assert_allclose(
            other.curves[0].points, one.curves[0].points, rtol=0, atol=1e-9 * creature.diagonal
        )

    @pytest.mark.slow
    def test_alternatives_are_symmetric(self, creature):
        designer = nicmm.Designer(creature)
        found = [
            designer.design(points_on_right(creature, 3, seed), mirror=MIRROR, alternatives=3)
            for seed in range(4)
        ]
        others = [each for design in found for each in design.alternatives]
        assert len(others) >= 2
        for each in others:
            assert each.asymmetry <= SYMMETRIC * creature.diagonal

    @pytest.mark.slow
    def test_obstacle_of_one_side_is_avoided_on_both(self, ball):
        """The curve passes an obstacle, although only the mirror image of a point is near it."""
        points = nearest_vertices(ball, circle([-1.2, 0.0, 1.2]))
        left = nearest_vertices(ball, circle([np.pi - 0.6]))
        obstacles = np.zeros(len(ball.vertices))
        near = np.linalg.norm(ball.vertices - ball.vertices[left], axis=1) < 0.15
        obstacles[near] = 1.0
        design = nicmm.design_curve(ball, points, mirror=MIRROR, obstacles=obstacles)
        (curve,) = design.curves
        assert design.asymmetry <= SYMMETRIC * ball.diagonal
        for centre in (ball.vertices[left], FLIP * ball.vertices[left]):
            assert np.linalg.norm(curve.points - centre, axis=1).min() > 0.1

    @pytest.mark.slow
    def test_via_points_are_mirrored(self, ring):
        """With a via point the first leg runs on the inner side of the tube, and so does its image.

        Without it, the curve stays on the outer side.
        """
        points = nearest_vertices(ring, on_torus([-60.0, 60.0], [30.0, 30.0]))
        over = nearest_vertices(ring, on_torus([-30.0, 0.0, 30.0], [150.0, 180.0, 150.0]))
        design = nicmm.design_curve(ring, points, closed=False, mirror=MIRROR, via_points={0: over})
        (curve,) = design.curves
        radius = np.hypot(curve.points[:, 0], curve.points[:, 1])
        front = np.abs(np.arctan2(curve.points[:, 1], np.abs(curve.points[:, 0]))) < 0.2
        for side in (1.0, -1.0):
            there = front & (side * curve.points[:, 0] > 0.0)
            assert radius[there].min() < 0.9
        assert design.asymmetry <= 1e-4 * ring.diagonal

    def test_rounding_of_the_canonical_copy_makes_no_difference(self, ring):
        """In single precision, mirror images of vertices may be rounded differently there."""
        mesh = nicmm.Mesh(ring.vertices.astype(np.float32).astype(np.float64), ring.faces)
        points = points_on_right(mesh, 3, 4)
        design = nicmm.design_curve(mesh, points, order="shortest", mirror=MIRROR)
        assert design.asymmetry <= 1e-7 * mesh.diagonal

    def test_shortest_order_of_the_half(self, ball):
        given = circle([-1.2, 1.1, 0.0, -0.6, 0.7])
        points = nearest_vertices(ball, given)
        design = nicmm.design_curve(ball, points, order="shortest", mirror=MIRROR)
        assert design.curves[0].length == pytest.approx(2 * np.pi, rel=5e-3)
        with pytest.raises(nicmm.ArgumentError, match="via_points"):
            nicmm.design_curve(
                ball, points, order="shortest", mirror=MIRROR, via_points={0: [points[0]]}
            )


def on_torus(around, across):
    u, v = np.radians(around), np.radians(across)
    radius = 1.0 + 0.4 * np.cos(v)
    return np.stack([radius * np.cos(u), radius * np.sin(u), 0.4 * np.sin(v)], axis=-1)


@pytest.mark.slow
def test_half_is_searched_for_where_other_curves_cross_the_plane(ball):
    """On the given side both legs are far longer than across the plane."""
    points = nearest_vertices(ball, unit([[0.15, 1.0, 0.2], [0.15, -1.0, 0.2], [0.15, 0.9, -0.5]]))
    design = nicmm.design_curve(ball, points, closed=False, mirror=MIRROR)
    assert_symmetric(ball, design, ball.vertices[points], closed=False)


def unit(vectors):
    vectors = np.asarray(vectors)
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


class TestStart:
    def moved(self, mesh, points):
        neighbour = mesh.faces[mesh.faces_at(points[1:2])[0]]
        result = points.copy()
        result[1] = neighbour[neighbour != points[1]][0]
        return result

    @pytest.mark.parametrize("order", ["given", "shortest"])
    def test_dragging(self, creature, designer, order):
        points = points_on_right(creature, 3, 4)
        before = designer.design(points, order=order, mirror=MIRROR)
        for _ in range(3):
            points = self.moved(creature, points)
            before = designer.design(
                points, order=order, mirror=MIRROR, start=before, max_iterations=3
            )
            (curve,) = before.curves
            assert before.iterations <= 3
            assert before.asymmetry <= SYMMETRIC * creature.diagonal
            assert_valid_curve(creature, curve, curve.points[curve.control_index])
        done = designer.design(points, order=order, mirror=MIRROR, start=before)
        assert_symmetric(creature, done, creature.vertices[points])
        again = designer.design(points, order=order, mirror=MIRROR, start=done)
        np.testing.assert_array_equal(again.curves[0].points, done.curves[0].points)

    def test_from_a_curve_that_is_not_symmetric(self, creature, designer):
        points = points_on_right(creature, 3, 4)
        symmetric = designer.design(points, mirror=MIRROR).curves[0]
        every = symmetric.points[symmetric.control_index]
        plain = designer.design(every)
        design = designer.design(points, mirror=MIRROR, start=plain)
        assert_symmetric(creature, design, creature.vertices[points])

    def test_limited_from_the_beginning(self, creature, designer):
        points = points_on_right(creature, 3, 4)
        design = designer.design(points, mirror=MIRROR, max_iterations=1)
        assert design.status is nicmm.Status.ITERATION_LIMIT
        assert design.asymmetry <= SYMMETRIC * creature.diagonal

    @pytest.mark.slow
    def test_cancelled_at_any_checkpoint(self, creature, monkeypatch):
        """There is no curve before one is symmetric, and only symmetric ones afterwards."""
        monkeypatch.setattr(progress, "INTERVAL", 0.0)
        points = points_on_right(creature, 3, 4)
        designer = nicmm.Designer(creature)
        designer.design(points, mirror=MIRROR)  # what depends on the mesh only is computed once
        calls = []
        designer.design(points, mirror=MIRROR, progress=lambda *_: calls.append(0) or True)
        found = []
        for last in (0, len(calls) // 2, *range(len(calls) - 40, len(calls) - 1, 3)):
            left = iter(range(last))
            design = designer.design(
                points, mirror=MIRROR, progress=lambda *_, left=left: next(left, None) is not None
            )
            assert design.status is nicmm.Status.CANCELLED
            found += design.curves
            for curve in design.curves:
                assert design.asymmetry <= SYMMETRIC * creature.diagonal
                assert_valid_curve(creature, curve, curve.points[curve.control_index])
        assert found


class TestErrors:
    def refused(self, mesh, points, error, words, mirror=MIRROR, **options):
        with pytest.raises(error, match=words):
            nicmm.design_curve(mesh, points, mirror=mirror, **options)

    @pytest.mark.parametrize(
        ("mirror", "words"),
        [
            (((0, 0, 0), (0, 0, 0)), "normal"),
            (((0, 0, 0), (np.nan, 0, 0)), "NaN"),
            ((0, 0, 0), "shape"),
            ("X", "numbers"),
            (((0, 0, 0), (1, 0)), "numbers"),
        ],
    )
    def test_planes(self, small_ball, mirror, words):
        points = points_on_right(small_ball, 2, 0)
        self.refused(small_ball, points, nicmm.ArgumentError, f"mirror.*{words}", mirror)

    def test_points_on_both_sides(self, creature):
        right = points_on_right(creature, 2, 0)
        left = np.flatnonzero(creature.vertices[:, 0] < -0.1)[0]
        with pytest.raises(nicmm.ControlPointError, match=r"\[0\] and .*\[2\]") as caught:
            nicmm.design_curve(creature, [*right, left], mirror=MIRROR)
        assert [name.index for name in caught.value.points] == [0, 2]

    def test_point_on_the_plane_where_the_curve_does_not_cross_it(self, creature):
        on_plane = np.flatnonzero(creature.vertices[:, 0] == 0.0)[0]
        one, other = points_on_right(creature, 2, 0)
        words = r"control_points\[{}\] is on the mirror"
        error = nicmm.ControlPointError
        self.refused(creature, [one, on_plane, other], error, words.format(1))
        self.refused(creature, [on_plane, one], error, words.format(0), closed=False)

    def test_too_few_points(self, creature):
        on_plane = np.flatnonzero(creature.vertices[:, 0] == 0.0)[0]
        error, words = nicmm.ControlPointError, "too few"
        self.refused(creature, points_on_right(creature, 1, 0), error, words)
        self.refused(creature, [on_plane], error, words, closed=False)
        self.refused(creature, [], error, words)

    def test_images_far_from_the_surface(self, creature):
        plane = ((0.3, 0.0, 0.0), (1.0, 0.0, 0.0))
        points = np.argsort(creature.vertices[:, 0])[[0, 5]]
        self.refused(creature, points, nicmm.ArgumentError, "not symmetric enough", plane)

    def test_image_at_another_point(self):
        """Both points of the narrow side are nearest to the corner of the wide one."""
        wide = strip(8)
        left = wide.vertices[:, :1] < 0.0
        narrow = np.where(left, [1.0, 0.9, 1.0] * wide.vertices, wide.vertices)
        mesh = nicmm.Mesh(narrow, wide.faces)
        points = [[1.0, 0.3, 0.0], [1.0, 0.29, 0.0]]
        self.refused(mesh, points, nicmm.ControlPointError, "not symmetric enough")

    def test_other_methods(self, creature):
        points = points_on_right(creature, 2, 0)
        self.refused(creature, points, nicmm.ArgumentError, "mirror needs", method="variational")

    @pytest.mark.slow
    def test_surface_of_one_side_that_is_not_connected(self):
        """A ring with a slot across its right side connects the points only by its left side."""
        ring = shapes.annulus()
        centre = ring.vertices[ring.faces].mean(axis=1)
        kept = (np.abs(centre[:, 1]) > 0.04) | (centre[:, 0] < 0.0)
        mesh = nicmm.Mesh(ring.vertices, ring.faces[kept])
        points = nearest_vertices(mesh, 0.7 * circle([-0.6, 0.6]))
        self.refused(mesh, points, nicmm.UnreachableError, "on their side of the mirror")


@pytest.mark.slow
@pytest.mark.parametrize("text", ["x", "0,0,0,1,0,0", "0,7,0,-2,0,0"])
def test_command_line(creature, tmp_path, text):
    path, out = tmp_path / "mesh.obj", tmp_path / "curve.json"
    write_mesh(path, creature)
    points = points_on_right(creature, 2, 4)
    words = ",".join(map(str, points))
    assert main(["design", str(path), "--points", words, "--mirror", text, "-o", str(out)]) == 0
    expected = nicmm.design_curve(read_mesh(path), points, mirror=MIRROR).curves[0]
    found = json.loads(out.read_text())
    np.testing.assert_allclose(found["points"], expected.points, rtol=0, atol=1e-9)
    assert len(found["control_index"]) == 4


def test_command_line_refuses_other_texts(creature, tmp_path, capsys):
    path = tmp_path / "mesh.obj"
    write_mesh(path, creature)
    out = str(tmp_path / "curve.obj")
    for text in ("W", "1,2,3", "0,0,0,1,0,x"):
        assert main(["design", str(path), "--points", "1,2", "--mirror", text, "-o", out]) == 2
        assert "--mirror" in capsys.readouterr().err
