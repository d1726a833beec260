"""Tests the relaxation: known shapes, simple curves through their points, decreasing energy."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import nicmm_core as nicmm
from nicmm_core import shapes, surface_designer
from nicmm_core.geometry.crossings import crossing_segments
from nicmm_core.geometry.curve import resample
from nicmm_core.geometry.geodesic_curvature import geodesic_curvature
from nicmm_core.geometry.normals import unsigned_normals
from nicmm_core.geometry.surface_points import SurfacePoints
from nicmm_core.relaxation import relaxing
from nicmm_core.relaxation.curve_nodes import FEATURE_TENSION, CurveSurface, nodes_at
from nicmm_core.relaxation.discrete_curve import place_nodes
from nicmm_core.relaxation.elastic_energy import OVER_TENSION, bending_energy, feature_energy
from nicmm_core.relaxation.relaxing import GUIDED, RelaxationConfig, relax
from nicmm_core.status import Status
from tests.core.checks import (
    apart,
    assert_valid_curve,
    circle,
    curve_through,
    flipped,
    grid,
    points_near,
    renumbered,
    scaled,
)
from tests.oracles import messes

ANGLES = np.arange(60) * 2 * np.pi / 60
CONTROLS = np.arange(0, 60, 12)
DEFAULT = RelaxationConfig()


def relaxed(mesh, curve, smoothness=1.0, config=DEFAULT, watch=None, feature=None, weight=0.0):
    """Relax a curve and assert that the result is valid."""
    surface = CurveSurface(mesh, unsigned_normals(mesh), feature, weight)
    result = relax(surface, curve, smoothness, config, watch)
    controls = curve.points[curve.control_index]
    assert_valid_curve(mesh, result.curve, controls, curve.closed)
    kept = result.curve.points[result.curve.control_index]
    np.testing.assert_allclose(kept, controls, rtol=0, atol=1e-15 * np.abs(mesh.vertices).max())
    return result


def wave_on_equator(mesh, waves=5, height=0.25):
    """A wavy loop on the sphere with its control points on the equator."""
    points = circle(ANGLES)
    points[:, 2] = height * np.sin(waves * ANGLES) * np.abs(np.sin(waves * ANGLES / 2))
    points[CONTROLS, 2] = 1e-3
    return curve_through(mesh, points, CONTROLS)


def star(mesh, factor=1.0, wave=0.2, controls=CONTROLS):
    """A loop in the plane that oscillates about the circle through its control points."""
    radius = 0.6 * factor * (1.0 + wave * np.sin(7 * ANGLES))
    radius[controls] = 0.6 * factor
    return curve_through(mesh, circle(ANGLES) * radius[:, None], controls)


def bow(mesh):
    """A simple loop through points whose straight connections would cross."""
    corners = [(-0.5, -0.3), (0.5, 0.3), (0.5, -0.3), (0.1, -0.6), (-0.6, -0.6), (-0.75, 0.0)]
    corners = np.array([*corners, (-0.5, 0.3), (-0.6, 0.0)])
    line = np.concatenate([corners, corners[:1]])
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    at = np.unique(np.concatenate([arc[:-1], np.linspace(0.0, arc[-1], 60, endpoint=False)]))
    flat = np.stack([np.interp(at, arc, line[:, axis]) for axis in (0, 1)] + [0 * at], axis=1)
    return curve_through(mesh, flat, np.searchsorted(at, arc[[0, 1, 2, 6]]))


def straight_bow(mesh):
    """The same points joined by straight legs, which form a figure of eight."""
    return curve_through(mesh, bow(mesh).points[bow(mesh).control_index], np.arange(4))


def measured(curve, normals):
    """∮ κ_g² ds from evenly spaced points, independent of the nodes of the relaxation."""
    points, segment = resample(curve.points, 200, curve.closed)
    curvature = geodesic_curvature(points, normals(points), curve.closed)
    return (curvature**2).sum() * curve.length / 200


def upwards(points):
    return np.tile([0.0, 0.0, 1.0], (len(points), 1))


def outwards(points):
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def potential(bending, length, smoothness=1.0):
    """Function that steps with the tension (2π / L)² / smoothness decrease; d(1 / L) = -dL / L²."""
    return bending - (2.0 * np.pi) ** 2 / (smoothness * length)


def test_through_points_of_a_great_circle_it_is_that_circle(ball):
    start = wave_on_equator(ball)
    result = relaxed(ball, start)
    assert result.status == Status.CONVERGED
    assert start.length > 1.1 * 2 * np.pi
    assert result.curve.length == pytest.approx(2 * np.pi, rel=5e-3)
    assert np.abs(result.curve.points[:, 2]).max() < 5e-3
    assert result.bending < 1e-3
    assert measured(result.curve, outwards) < 0.02 * measured(start, outwards)


@pytest.mark.parametrize("factor", [1e-3, 1.0, 1e3])
def test_through_points_of_a_circle_it_bends_hardly_more_than_the_circle(flat_disc, factor):
    """Among closed curves of a given length, circles have minimal bending."""
    mesh = scaled(flat_disc, factor)
    result = relaxed(mesh, star(mesh, factor))
    assert result.status == Status.CONVERGED
    radius = 0.6 * factor
    best = potential(2 * np.pi / radius, 2 * np.pi * radius)
    assert potential(result.bending, result.feature) < best + 0.01 / radius
    assert result.bending * radius == pytest.approx(2 * np.pi, rel=0.01)
    distance = np.linalg.norm(result.curve.points, axis=1)
    np.testing.assert_allclose(distance, radius, rtol=0.01)
    assert measured(result.curve, upwards) == pytest.approx(result.bending, rel=0.02)


def test_what_it_reports_is_that_of_its_curve(flat_disc):
    """Without a map, ∮ φ_fea² ds is the length."""
    result = relaxed(flat_disc, star(flat_disc, controls=[0, 13, 22, 41]))
    assert result.feature == pytest.approx(result.curve.length, rel=2e-3)
    assert measured(result.curve, upwards) == pytest.approx(result.bending, rel=0.05)


def test_size_and_pose_of_the_mesh_do_not_matter(flat_disc):
    turn = Rotation.from_rotvec([0.3, 1.1, -0.5])
    posed = nicmm.Mesh(1e3 * turn.apply(flat_disc.vertices.copy()), flat_disc.faces)
    controls = [0, 13, 22, 41]
    start = star(flat_disc, controls=controls)
    moved = replace(start, points=SurfacePoints(start.faces, start.barycentric).positions(posed))
    here, there = relaxed(flat_disc, start), relaxed(posed, moved)
    assert there.iterations == here.iterations
    back = turn.inv().apply(there.curve.points) / 1e3
    assert apart(here.curve.points, back) < 1e-4
    assert there.bending == pytest.approx(here.bending / 1e3, rel=1e-3)


@pytest.mark.parametrize("change", [flipped, renumbered])
def test_in_the_plane_neither_numbers_nor_orientation_of_faces_matter(flat_disc, change):
    other = change(flat_disc, 3)
    controls = [0, 13, 22, 41]
    here, there = (relaxed(mesh, star(mesh, controls=controls)) for mesh in (flat_disc, other))
    assert there.curve.length == pytest.approx(here.curve.length, rel=1e-4)
    assert apart(here.curve.points, there.curve.points) < 1e-3


def test_on_a_sphere_with_faces_turned_over_it_is_the_same_curve(ball):
    angle = ANGLES
    loop = circle(angle, 0.9) + np.outer(0.4 + 0.1 * np.sin(3 * angle), [0.0, 0.0, 1.0])
    here, there = (
        relaxed(mesh, curve_through(mesh, loop, [0, 17, 40])) for mesh in (ball, flipped(ball, 2))
    )
    assert apart(here.curve.points, there.curve.points) < 0.01


@pytest.mark.parametrize("seed", [0, 1])
def test_on_a_moebius_strip_a_loop_converges_across_the_seam(seed):
    """It ends near the core, whose bending is π, for any orientation of the faces."""
    strip = shapes.moebius_strip(96, 7)
    swing = 0.2 * np.sin(2.5 * ANGLES) * np.abs(np.sin(2.5 * ANGLES))
    radius = 1.0 + swing * np.cos(0.5 * ANGLES)
    loop = circle(ANGLES) * radius[:, None]
    loop[:, 2] = swing * np.sin(0.5 * ANGLES)
    here, there = (
        relaxed(mesh, curve_through(mesh, loop, CONTROLS)) for mesh in (strip, flipped(strip, seed))
    )
    assert here.status == there.status == Status.CONVERGED
    assert potential(here.bending, here.feature) < potential(np.pi, 2 * np.pi) + 0.01
    assert apart(here.curve.points, circle(np.arange(400) * 2 * np.pi / 400)) < 0.03
    assert apart(here.curve.points, there.curve.points) < 5e-3


def test_an_open_curve_between_two_points_is_straight(flat_disc):
    """With natural ends nothing bends, whatever the start."""
    x = np.linspace(-0.5, 0.6, 30)
    start = curve_through(flat_disc, np.stack([x, 0.3 * np.cos(3 * x), 0 * x], 1), [0, 29], False)
    result = relaxed(flat_disc, start)
    ends = start.points[[0, -1]]
    assert result.bending < 1e-3
    assert result.curve.length == pytest.approx(np.linalg.norm(ends[1] - ends[0]), rel=1e-4)


def test_an_open_curve_through_three_points_ends_without_curvature(flat_disc):
    """In an elastica under tension, curvature falls from the middle point to zero at both ends."""
    corners = np.array([[-0.6, -0.2], [-0.3, 0.05], [0.0, 0.3], [0.3, 0.05], [0.6, -0.2]])
    start = curve_through(flat_disc, np.pad(corners, ((0, 0), (0, 1))), [0, 2, 4], False)
    result = relaxed(flat_disc, start)
    points, _ = resample(result.curve.points, 81, closed=False)
    curvature = np.abs(geodesic_curvature(points, upwards(points), closed=False))
    assert curvature[[2, -3]].max() < 0.1 * curvature[38:43].max()
    assert curvature[38:43].max() < 2.0 * curvature[30]


@pytest.mark.slow
def test_legs_along_edges_and_through_vertices_are_no_trouble():
    """The points are the corners of a square and vertices of a grid."""
    mesh = grid(8)
    square = 0.25 + 0.5 * np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    vertices = [int(np.argmin(np.linalg.norm(mesh.vertices[:, :2] - c, axis=1))) for c in square]
    design = nicmm.design_curve(mesh, vertices, method="variational")
    result = relaxed(mesh, design.curves[0])
    radius = np.linalg.norm(result.curve.points[:, :2] - 0.5, axis=1)
    np.testing.assert_allclose(radius, np.sqrt(0.125), rtol=0.02)


def states(mesh, curve, config=DEFAULT, smoothness=1.0):
    """Relaxed curve, and the nodes after every iteration."""
    seen = []

    def watch(done, state):
        seen.append((done, state))
        return True

    return relaxed(mesh, curve, smoothness, config, watch), seen


@pytest.mark.parametrize("smoothness", [0.3, 1.0, 5.0])
def test_the_energy_never_rises(flat_disc, smoothness):
    """Without respacing, which would change the sampling of the curve."""
    config = RelaxationConfig(levels=(128,), spacing_ratio=np.inf)
    _, seen = states(flat_disc, star(flat_disc), config, smoothness)
    surface = CurveSurface(flat_disc, unsigned_normals(flat_disc))
    values = []
    for _, positions in seen:
        nodes = nodes_at(surface, points_near(flat_disc, positions), closed=True)
        values.append(potential(bending_energy(nodes), feature_energy(nodes), smoothness))
    assert len(values) > 3
    assert (np.diff(values) <= 0.0).all()


@pytest.mark.parametrize("seed", range(4))
def test_from_any_start_it_ends_better(ball, seed):
    """Random loops around the sphere, measured on the polyline and not at nodes."""
    generator = np.random.default_rng(seed)
    a, b = generator.normal(scale=0.12, size=(2, 5, 1))
    wave = np.arange(2, 7)[:, None] * ANGLES
    height = (a * np.cos(wave) + b * np.sin(wave)).sum(axis=0)
    start = curve_through(ball, circle(ANGLES) + np.outer(height, [0, 0, 1]), CONTROLS[::2])
    result = relaxed(ball, start)
    before, after = (
        potential(measured(curve, outwards), curve.length) for curve in (start, result.curve)
    )
    assert after < before


def test_more_smoothness_gives_no_more_bending_and_no_shorter_curve(flat_disc):
    start = star(flat_disc, controls=[0, 13, 22, 41])
    results = [relaxed(flat_disc, start, smoothness=s) for s in (0.05, 0.3, 1.0, 5.0)]
    bending = [result.bending for result in results]
    lengths = [result.curve.length for result in results]
    assert bending == sorted(bending, reverse=True)
    assert lengths == sorted(lengths)
    assert bending[0] > 1.2 * bending[-1]


def test_obstacles_are_avoided(flat_disc):
    """With a hill beside the straight path, the curve moves away and ∮ φ_fea² ds decreases."""
    hill = 1.0 + 4.0 * np.exp(-np.sum((flat_disc.vertices[:, :2] - [0, -0.05]) ** 2, 1) / 0.02)
    x = np.linspace(-0.6, 0.6, 30)
    start = curve_through(flat_disc, np.stack([x, 0.01 + 0 * x, 0 * x], axis=1), [0, 29], False)
    aside = relaxed(flat_disc, start, feature=hill, weight=30.0)
    straight = relaxed(flat_disc, start)
    surface = CurveSurface(flat_disc, unsigned_normals(flat_disc), hill)
    through = feature_energy(nodes_at(surface, straight.discrete_curve.nodes.places, closed=False))
    assert aside.feature < 0.6 * through
    assert aside.curve.points[:, 1].max() > 0.15
    assert aside.curve.length > straight.curve.length
    assert np.abs(straight.curve.points[:, 1]).max() < 0.02


@pytest.mark.slow
def test_a_flat_map_is_a_tension(flat_disc):
    """A constant map is a tension of (φ_fea² - 1) τ_fea; 3 τ_fea equals 3/4 of 4 τ_fea."""
    start = star(flat_disc, controls=[0, 13, 22, 41])
    flat = np.ones(len(flat_disc.vertices))
    free, neutral, one = (
        relaxed(flat_disc, start, feature=feature, weight=weight)
        for feature, weight in ((None, 0.0), (flat, 20.0), (2.0 * flat, 5.0))
    )
    own = OVER_TENSION * (2.0 * np.pi / one.curve.length) ** 2
    weight = 4.0 * (5.0 + own) - own
    other = relaxed(flat_disc, start, feature=1.75**0.5 * flat, weight=weight)
    assert apart(free.curve.points, neutral.curve.points) < 1e-9
    assert apart(one.curve.points, other.curve.points) < 5e-3
    assert one.feature == pytest.approx(4.0 / 1.75 * other.feature, rel=1e-3)
    assert one.curve.length < 0.97 * free.curve.length


def test_a_lane_is_followed_and_left_smoothly(flat_disc):
    """With a lane beside the middle of a straight path, the curve follows it only there."""
    x, y, _ = flat_disc.vertices.T
    beyond = np.maximum(np.abs(x) - 0.25, 0.0)
    lane = np.sqrt(1.0 - np.exp(-((y - 0.08) ** 2 + beyond**2) / (2 * 0.05**2)))
    ends = np.array([-0.7, 0.7])
    along = np.linspace(*ends, 40)
    start = curve_through(
        flat_disc, np.stack([along, 0 * along, 0 * along], axis=1), [0, 39], False
    )
    result = relaxed(flat_disc, start, feature=lane, weight=200.0)
    points = result.curve.points
    inside = np.abs(points[:, 0]) < 0.2
    assert np.abs(points[inside, 1] - 0.08).max() < 0.02
    assert points[:, 1].min() > -0.02 and points[:, 1].max() < 0.1
    assert result.curve.length < 1.05 * 1.4


@pytest.mark.parametrize("length", [0.05, 0.4, 1.2])
def test_a_lane_is_followed_by_short_curves_too(length):
    """Width and distance of the lane scale with the curve; the weight does not."""
    mesh = scaled(shapes.disc(24), length)
    x, y, _ = mesh.vertices.T / length
    lane = np.sqrt(1.0 - np.exp(-((y - 0.06) ** 2) / (2 * 0.08**2)))
    along = length * np.linspace(-0.5, 0.5, 40)
    start = curve_through(mesh, np.stack([along, 0 * along, 0 * along], axis=1), [0, 39], False)
    # The same τ_fea for all three curves, as if they lay on one surface of area 1.
    result = relaxed(mesh, start, feature=lane, weight=FEATURE_TENSION, config=GUIDED)
    points = result.curve.points / length
    inside = np.abs(points[:, 0]) < 0.2
    assert np.abs(points[inside, 1] - 0.06).max() < 0.02


def test_a_fold_of_the_start_is_pulled_straight(flat_disc):
    """With few nodes and almost no tension it would grow into a bow, another local minimum."""
    _, y, _ = flat_disc.vertices.T
    lane = np.sqrt(1.0 - np.exp(-(y**2) / (2 * 0.04**2)))
    fold = [(-0.4, 0.0), (0.02, 0.0), (0.02, 0.08), (-0.02, 0.08), (-0.02, 0.04)]
    fold += [(-0.06, 0.04), (-0.06, 0.12), (0.06, 0.12), (0.06, 0.0), (0.4, 0.0)]
    line = np.array(fold)
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    at = np.unique(np.concatenate([arc, np.linspace(0.0, arc[-1], 100)]))
    flat = np.stack([np.interp(at, arc, line[:, axis]) for axis in (0, 1)] + [0 * at], axis=1)
    start = curve_through(flat_disc, flat, [0, len(at) - 1], closed=False)
    for smoothness in (1.0, 4.0):
        result = relaxed(
            flat_disc, start, smoothness, GUIDED, feature=lane, weight=FEATURE_TENSION / np.pi
        )
        assert np.abs(result.curve.points[:, 1]).max() < 0.01
        assert result.status == Status.CONVERGED


def test_strands_that_would_cross_stay_apart(flat_disc):
    """The figure of eight through these points would bend less, but it crosses itself."""
    start = bow(flat_disc)
    polyline = straight_bow(flat_disc)
    pairs = crossing_segments(
        flat_disc.faces, SurfacePoints(polyline.faces, polyline.barycentric), closed=True
    )
    assert len(pairs) > 0
    result, seen = states(flat_disc, start)
    assert result.status == Status.CONVERGED
    assert measured(result.curve, upwards) < 0.5 * measured(start, upwards)
    points, _ = resample(result.curve.points, 300)
    gap = np.linalg.norm(points[:, None] - points, axis=2)
    along = np.abs(np.arange(300)[:, None] - np.arange(300))
    along = np.minimum(along, 300 - along)
    # The clearance is two mean steps of the last level, but contact is not infinitely stiff.
    assert gap[along > 25].min() > result.curve.length / 512


@pytest.mark.parametrize("after", [0, 3, 20])
def test_a_cancelled_relaxation_gives_a_valid_curve(flat_disc, after):
    """Also while strands would pass through each other."""
    for start in (star(flat_disc), bow(flat_disc)):
        calls = []

        def watch(done, state, calls=calls):
            calls.append(done)
            return len(calls) <= after

        result = relaxed(flat_disc, start, watch=watch)
        if len(calls) > after:
            assert result.status == Status.CANCELLED
            assert len(calls) == after + 1
        else:
            assert result.status == Status.CONVERGED
        assert all(0.0 <= done <= 1.0 for done in calls)


@pytest.mark.slow
@pytest.mark.parametrize("after", [0, 1, 2, 5])
@pytest.mark.parametrize("seed", range(3))
def test_however_far_nodes_move_the_curve_stays_simple(flat_disc, seed, after):
    """Moves are up to 40 steps long, and nodes that would cross other strands stay."""
    generator = np.random.default_rng(seed)
    wave = np.arange(2, 12)[:, None] * ANGLES + generator.uniform(0.0, 6.0, (10, 1))
    radius = 0.55 * (1.0 + 0.08 * np.sin(wave).sum(axis=0))
    start = curve_through(flat_disc, circle(ANGLES) * radius[:, None], CONTROLS)
    config = RelaxationConfig(levels=(64,), longest_move=40.0)
    calls = []
    relaxed(
        flat_disc, start, 100.0, config, lambda *seen: len(calls.append(seen) or calls) <= after
    )
    assert calls


@pytest.mark.parametrize("cap", [1, 4])
def test_the_cap_is_kept(flat_disc, cap):
    config = RelaxationConfig(iterations=cap)
    result, seen = states(flat_disc, star(flat_disc), config)
    assert result.status == Status.ITERATION_LIMIT
    assert result.iterations == cap
    assert len(seen) <= cap
    # If strands would cross there are two attempts: with crossings allowed, and without.
    assert relaxed(flat_disc, bow(flat_disc), config=config).iterations <= 2 * cap


def test_a_coil_round_a_thin_ring_stays_on_it():
    """With few nodes, straight traces around the tube fail, and a level with more nodes is used."""
    thin = shapes.torus(major=1.0, minor=0.05, around=96, across=8)
    angle = np.arange(600) * 2 * np.pi / 600
    radius = 1 + 0.05 * np.cos(40 * angle)
    coil = circle(angle) * radius[:, None]
    coil[:, 2] = 0.05 * np.sin(40 * angle)
    result = relaxed(thin, curve_through(thin, coil, [0, 150, 340]))
    assert turns(result.curve.points) == 40


def turns(points):
    """Winding number of a closed polyline around the tube of a torus with major radius 1."""
    tube = np.arctan2(points[:, 2], np.linalg.norm(points[:, :2], axis=1) - 1.0)
    change = np.angle(np.exp(1j * (np.roll(tube, -1) - tube)))
    return round(change.sum() / (2 * np.pi))


def test_more_levels_end_at_the_same_curve(flat_disc):
    start = star(flat_disc, controls=[0, 13, 22, 41])
    coarse, fine = (
        relaxed(flat_disc, start, config=RelaxationConfig(levels=levels))
        for levels in ((64, 128), (64, 128, 256, 512))
    )
    assert apart(coarse.curve.points, fine.curve.points) < 0.01
    assert coarse.bending == pytest.approx(fine.bending, rel=0.02)


def node_counts(mesh, start, config=DEFAULT):
    """Numbers of nodes in the iterations of a relaxation, without repetitions, and its result."""
    counts = []

    def watch(done, points):
        if not counts or abs(counts[-1] - len(points)) > 20:
            counts.append(len(points))
        return True

    surface = CurveSurface(mesh, unsigned_normals(mesh))
    return counts, relax(surface, start, 1.0, config, watch)


def with_nodes(mesh, curve, count):
    return place_nodes(CurveSurface(mesh, unsigned_normals(mesh)), curve, count)


@pytest.mark.slow
def test_a_start_that_bends_little_needs_no_coarse_level(flat_disc):
    curve = star(flat_disc, wave=0.05)
    fine, result = node_counts(flat_disc, with_nodes(flat_disc, curve, 192))
    assert len(fine) == 1
    assert fine[0] == pytest.approx(512, abs=20)
    config = replace(DEFAULT, fine_below=0.0)
    both, on_levels = node_counts(flat_disc, with_nodes(flat_disc, curve, 192), config)
    assert both[0] == pytest.approx(128, abs=20)
    assert apart(result.curve.points, on_levels.curve.points) < 2e-2
    bent, _ = node_counts(flat_disc, with_nodes(flat_disc, star(flat_disc, wave=0.4), 192))
    assert bent[0] == pytest.approx(128, abs=20)


@pytest.mark.slow
def test_if_the_energy_rises_all_levels_are_used(flat_disc, monkeypatch):
    """With ten nodes, the polygon through them has less energy than the relaxed curve."""
    monkeypatch.setattr(relaxing, "ACCEPTABLE", 0.0)
    start = with_nodes(flat_disc, star(flat_disc, wave=0.0), 10)
    counts, result = node_counts(flat_disc, start)
    assert counts[:2] == pytest.approx([512, 128], abs=20)
    for config in (replace(DEFAULT, levels=(512,)), replace(DEFAULT, fine_below=0.0)):
        _, other = node_counts(flat_disc, start, config)
        assert result.bending <= 1.001 * other.bending


@pytest.mark.slow
def test_control_points_at_vertices_on_edges_and_in_faces_are_kept(ball):
    """Each control point is kept exactly."""
    near = points_near(ball, [[0.2, 0.1, 1.0]])
    face, other = near.faces[0], np.argmin(ball.vertices[ball.faces].mean(axis=1)[:, 2])
    points = nicmm.SurfacePoints(
        np.array([face, other, 77]), np.array([[1.0, 0, 0], [0.5, 0.5, 0], [0.2, 0.3, 0.5]])
    )
    design = nicmm.design_curve(ball, points, method="variational")
    result = relaxed(ball, design.curves[0])
    np.testing.assert_allclose(
        result.curve.points[result.curve.control_index], points.positions(ball), atol=1e-15
    )


@pytest.mark.parametrize("work", [1.0, 20.0])
def test_work_is_bounded_by_moves(flat_disc, work):
    result = relaxed(flat_disc, star(flat_disc), config=RelaxationConfig(work=work))
    assert result.status == Status.ITERATION_LIMIT


@pytest.mark.slow
@pytest.mark.parametrize("number", [41, 197])
def test_a_curve_on_a_mess_ends_within_its_work(number, monkeypatch):
    """Repeated respacing costs more energy here than steps over folds gain."""
    work = []
    relax_once = surface_designer.relax

    def counted(*given):
        result = relax_once(*given)
        work.append(result.work)
        return result

    monkeypatch.setattr(surface_designer, "relax", counted)
    mess = messes.mess(number)
    nicmm.design_curve(mess.mesh, mess.points, **mess.arguments)
    # The last move may start just below the limit, and traverse some faces.
    assert 0.0 < max(work) <= DEFAULT.work + 10.0
