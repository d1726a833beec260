"""Tests the energy of a curve against closed forms, and its linearisation against differences."""

import nicmm_kernels
import numpy as np
import pytest
from nicmm_kernels import damped_step
from scipy.spatial.transform import Rotation

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.normals import unsigned_normals
from nicmm_core.relaxation.curve_nodes import CurveSurface, nodes_at
from nicmm_core.relaxation.elastic_energy import OVER_TENSION, bending_energy, feature_energy
from nicmm_core.relaxation.rules import contact_rules
from tests.core.checks import circle, flipped, points_near, renumbered, scaled
from tests.oracles.reference_energy import Weights, energy, linearised, moved_along_conormals


def surface_of(mesh, feature_map=None, weight=0.0):
    return CurveSurface(mesh, unsigned_normals(mesh), feature_map, weight)


def nodes_on(mesh, positions, closed=True, feature_map=None):
    return nodes_at(surface_of(mesh, feature_map), points_near(mesh, positions), closed)


def angles(count):
    return np.arange(count) * 2 * np.pi / count


def wobble(count, factor=1.0):
    angle = angles(count)
    radius = factor * (0.55 + 0.1 * np.sin(3 * angle) + 0.05 * np.cos(5 * angle))
    return circle(angle) * radius[:, None]


@pytest.mark.parametrize("factor", [1e-3, 1.0, 1e3])
def test_a_circle_in_the_plane_has_its_own_energies(flat_disc, factor):
    """∮ κ² ds = 2π / r and ∮ ds = 2π r; without a map both terms are equal."""
    errors = []
    for count in (32, 128):
        radius = 0.6 * factor
        nodes = nodes_on(scaled(flat_disc, factor), circle(angles(count), radius))
        errors.append(bending_energy(nodes) / (2 * np.pi / radius) - 1.0)
        polygon = 2 * count * radius * np.sin(np.pi / count)
        assert feature_energy(nodes) == pytest.approx(polygon, rel=1e-5)
        weights = linearised(surface_of(flat_disc), nodes, 1.0, contact=False)
        assert weights.tension * feature_energy(nodes) == pytest.approx(
            bending_energy(nodes), rel=1e-2
        )
    assert abs(errors[1]) < 1e-3
    assert abs(errors[1]) < 0.1 * abs(errors[0])


@pytest.mark.parametrize("latitude", [0.0, 0.4, -1.0])
def test_a_parallel_of_the_sphere_bends_by_the_tangent_of_its_latitude(latitude):
    """∮ κ_g² ds = tan² φ · 2π cos φ; the equator is a geodesic."""
    mesh = shapes.sphere(4)
    height = [0.0, 0.0, np.sin(latitude)]
    nodes = nodes_on(mesh, circle(angles(60), np.cos(latitude)) + height)
    expected = 2 * np.pi * np.cos(latitude) * np.tan(latitude) ** 2
    assert bending_energy(nodes) == pytest.approx(expected, rel=0.02, abs=5e-3)
    assert feature_energy(nodes) == pytest.approx(2 * np.pi * np.cos(latitude), rel=5e-3)


def test_few_nodes_turn_in_the_tangent_plane():
    """With three nodes on a parallel, the turning angle is that of the projected chords."""
    mesh = shapes.sphere(4)
    latitude = 0.5
    height = [0.0, 0.0, np.sin(latitude)]
    nodes = nodes_on(mesh, circle(angles(3), np.cos(latitude)) + height)
    place = circle(angles(3), np.cos(latitude)) + height
    before, after = place[0] - place[2], place[1] - place[0]
    before, after = (v - (v @ place[0]) * place[0] for v in (before, after))
    cosine = before @ after / np.linalg.norm(before) / np.linalg.norm(after)
    side = np.sqrt(3.0) * np.cos(latitude)
    assert bending_energy(nodes) == pytest.approx(3 * np.arccos(cosine) ** 2 / side, rel=0.02)


def test_the_core_of_a_moebius_strip_bends_across_its_seam_as_elsewhere():
    """Rulings make the angle u / 2 with the radius, so κ_g = cos(u / 2), and ∮ κ_g² ds = π."""
    core = nodes_on(shapes.moebius_strip(96, 7), circle(angles(96)))
    assert bending_energy(core) == pytest.approx(np.pi, rel=0.01)


def test_an_open_arc_bends_between_its_ends_only(flat_disc):
    """A half circle has the bending π / r, and a straight line has none."""
    arc = nodes_on(flat_disc, circle(np.linspace(0, np.pi, 65), 0.6), closed=False)
    assert bending_energy(arc) == pytest.approx(np.pi / 0.6 * 63 / 64, rel=2e-3)
    assert feature_energy(arc) == pytest.approx(np.pi * 0.6, rel=1e-3)
    x = np.linspace(-0.5, 0.6, 40)
    line = nodes_on(flat_disc, np.stack([x, 0.3 * x, 0 * x], axis=1), closed=False)
    assert bending_energy(line) == pytest.approx(0.0, abs=1e-6)
    assert feature_energy(line) == pytest.approx(1.1 * np.hypot(1, 0.3), rel=1e-5)


def test_the_map_weighs_length(flat_disc):
    """∮ (2 + x)² ds along a circle about the origin is (4 + r²/2) 2π r."""
    mapped = 2.0 + flat_disc.vertices[:, 0]
    nodes = nodes_on(flat_disc, circle(angles(64), 0.6), feature_map=mapped)
    assert feature_energy(nodes) == pytest.approx(4.18 * 2 * np.pi * 0.6, rel=2e-3)


@pytest.mark.parametrize("count", [20, 21, 22])
def test_the_energy_has_no_first_node_and_no_direction(flat_disc, count):
    weights = Weights(3.0)
    points = wobble(count)
    energies = [
        energy(nodes_on(flat_disc, polygon), weights)
        for polygon in (points, np.roll(points, 7, axis=0), points[::-1])
    ]
    assert energies == pytest.approx([energies[0]] * 3)


def test_the_energy_does_not_depend_on_numbers_orientation_or_pose(body):
    """Tested on a curved surface, also with all faces reversed."""
    turn = Rotation.from_rotvec([0.3, -1.0, 2.0])
    posed = nicmm.Mesh(turn.apply(body.vertices.copy()), body.faces)
    section = body.vertices[np.argsort(body.vertices[:, 0])[::30]]
    weights = Weights(3.0)
    here = energy(nodes_on(body, section), weights)
    assert energy(nodes_on(renumbered(body, 1), section), weights) == pytest.approx(here)
    assert energy(nodes_on(posed, turn.apply(section)), weights) == pytest.approx(here)
    other = nicmm.Mesh(body.vertices, body.faces[:, ::-1])
    assert energy(nodes_on(other, section), weights) == pytest.approx(here)


def test_faces_turned_over_hardly_change_the_energy(ball):
    loop = circle(angles(60), 0.9) + [0.0, 0.0, 0.436]
    straight, turned = (bending_energy(nodes_on(mesh, loop)) for mesh in (ball, flipped(ball, 3)))
    assert turned == pytest.approx(straight, rel=0.02)


@pytest.mark.parametrize("factor", [1e-3, 1e3])
def test_energies_scale_as_their_units_say(flat_disc, factor):
    one, other = (nodes_on(scaled(flat_disc, f), wobble(50, f)) for f in (1.0, factor))
    assert bending_energy(other) == pytest.approx(bending_energy(one) / factor)
    assert feature_energy(other) == pytest.approx(feature_energy(one) * factor)
    surface = surface_of(flat_disc)
    weights = [linearised(surface, nodes, 2.0, contact=True) for nodes in (one, other)]
    assert weights[1].tension == pytest.approx(weights[0].tension / factor**2)
    assert weights[1].contact == pytest.approx(weights[0].contact / factor)


def test_smoothness_divides_the_tension(flat_disc):
    nodes = nodes_on(flat_disc, wobble(40))
    for surface in (surface_of(flat_disc), surface_of(flat_disc, np.ones(len(flat_disc.vertices)))):
        whole, quarter = (linearised(surface, nodes, s, contact=False).tension for s in (1.0, 4.0))
        assert quarter == pytest.approx(whole / 4.0)


@pytest.mark.parametrize("mapped", [False, True])
def test_a_taut_curve_has_more_tension_and_the_same_map(flat_disc, mapped):
    feature_map = np.full(len(flat_disc.vertices), 0.5) if mapped else None
    surface = surface_of(flat_disc, feature_map, 7.0)
    nodes = nodes_at(surface, points_near(flat_disc, wobble(40)), True)
    plain = linearised(surface, nodes, 2.0, contact=False)
    taut = linearised(surface, nodes, 2.0, contact=False, tautness=30.0)
    assert taut.tension == pytest.approx(30.0 * plain.tension)
    assert taut.feature == plain.feature
    assert bool(plain.feature) is mapped


@pytest.mark.parametrize("closed", [True, False])
def test_a_neutral_map_has_no_influence(flat_disc, closed):
    """Neither the energy nor its slope, its matrix or the weight of contacts changes."""
    surface = surface_of(flat_disc, np.ones(len(flat_disc.vertices)), 17.0)
    nodes = nodes_at(surface, points_near(flat_disc, wobble(40)), closed)
    plain = linearised(surface_of(flat_disc), nodes, 1.0, contact=True)
    mapped = linearised(surface, nodes, 1.0, contact=True)
    feature = 17.0 + OVER_TENSION * plain.tension
    assert (mapped.tension, mapped.feature) == (plain.tension, pytest.approx(feature))
    assert mapped.contact == plain.contact
    scale = np.abs(plain.slope).max()
    np.testing.assert_allclose(plain.slope, mapped.slope, rtol=0, atol=1e-9 * scale)
    np.testing.assert_allclose(plain.bands, mapped.bands, rtol=1e-9)
    assert mapped.energy == pytest.approx(plain.energy)


def test_a_lane_does_not_pay_for_length_in_it(flat_disc):
    """Otherwise curves would buckle: in a lane, a straight line must cost less than a wavy one."""
    lane = np.full(len(flat_disc.vertices), 0.1)
    x = np.linspace(-0.5, 0.5, 40)
    straight, wavy = (
        nodes_on(flat_disc, np.stack([x, h * np.cos(12 * x), 0 * x], axis=1), False, lane)
        for h in (0.0, 0.02)
    )
    weights = linearised(surface_of(flat_disc, lane, 1e3), straight, 1.0, contact=False)
    assert feature_energy(wavy) > feature_energy(straight)
    bent = bending_energy(wavy) - bending_energy(straight)
    longer = weights.tension * (wavy.lengths.sum() - straight.lengths.sum())
    rise = energy(wavy, weights) - energy(straight, weights)
    assert rise == pytest.approx(bent + longer, rel=0.02)


def test_an_obstacle_adds_to_the_tension(flat_disc):
    """Where φ_fea is 2, (φ_fea² - 1) τ_fea = 3 τ_fea is added to the tension τ."""
    twos = np.full(len(flat_disc.vertices), 2.0)
    nodes = nodes_on(flat_disc, circle(angles(64), 0.6), feature_map=twos)
    weights = linearised(surface_of(flat_disc, twos, 5.0), nodes, 1.0, contact=False)
    length = (weights.tension + 3.0 * weights.feature) * nodes.lengths.sum()
    assert energy(nodes, weights) == pytest.approx(bending_energy(nodes) + length)


def near_strands(count=60):
    """A long, narrow loop whose two sides are less than the clearance apart."""
    x = np.linspace(-0.6, 0.6, count)
    side = np.stack([x, 0.004 * np.sin(9 * x), 0 * x], axis=1)
    tip = np.array([[0.615, 0.0, 0.0]])
    up = np.array([0.0, 0.014, 0.0])
    return np.concatenate([side - up, tip, side[::-1] + up, -tip])


CASES = {
    "closed": (lambda: wobble(40), True, 1.0),
    "forty-one nodes": (lambda: wobble(41), True, 1.0),
    "forty-two nodes": (lambda: wobble(42), True, 1.0),
    "open": (lambda: wobble(40)[:30], False, 1.0),
    "bending only": (lambda: wobble(40), True, 1e12),
    "much tension": (lambda: wobble(40), True, 0.01),
    "strands apart": (near_strands, True, 3.0),
}
"""Positions of nodes, whether the curve is closed, and the smoothness."""


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("mapped", [False, True])
def test_energy_and_slope_are_those_of_the_formula(case, mapped):
    """The slope is half the derivative of the energy by moves on the surface."""
    points, closed, smoothness = CASES[case]
    mesh = shapes.disc(7)
    # The map has lanes and obstacles.
    feature_map = 1.0 + mesh.vertices[:, 0] - 0.4 * mesh.vertices[:, 1] if mapped else None
    surface = surface_of(mesh, feature_map, 1.0)
    nodes = nodes_at(surface, points_near(mesh, points()), closed)
    here = linearised(surface, nodes, smoothness, contact=case == "strands apart")
    assert here.energy == pytest.approx(energy(nodes, here))
    step = 1e-4 * nodes.lengths.mean()
    expected = np.empty(len(here.slope))
    for node in range(len(expected)):
        move = np.zeros(len(expected))
        move[node] = step
        ahead, behind = (moved_along_conormals(surface, nodes, s * move) for s in (1.0, -1.0))
        expected[node] = 0.5 * (energy(ahead, here) - energy(behind, here)) / (2.0 * step)
    # Contact depends on the mean step, which a single node changes noticeably only at sharp tips.
    compared = (np.abs(nodes.positions[:, 0]) < 0.55) | (here.contact == 0.0)
    scale = np.abs(expected[compared]).max()
    np.testing.assert_allclose(here.slope[compared], expected[compared], rtol=0, atol=0.01 * scale)


def test_on_a_sphere_the_slope_is_nearly_that_of_the_energy():
    """Up to the difference between the mesh and the smooth surface of its normals."""
    mesh = shapes.sphere(4)
    surface = surface_of(mesh)
    angle = angles(60)
    loop = circle(angle) + np.outer(0.3 + 0.1 * np.sin(3 * angle), [0.0, 0.0, 1.0])
    nodes = nodes_at(surface, points_near(mesh, loop), True)
    weights = linearised(surface, nodes)
    slope = weights.slope
    step = 1e-4 * nodes.lengths.mean()
    generator = np.random.default_rng(1)
    for _ in range(5):
        phase, waves = generator.uniform(0, 6), generator.integers(1, 6)
        move = np.cos(waves * angle + phase)
        ahead, behind = (
            moved_along_conormals(surface, nodes, s * step * move) for s in (1.0, -1.0)
        )
        change = energy(ahead, weights) - energy(behind, weights)
        expected = 0.5 * change / (2.0 * step)
        assert move @ slope == pytest.approx(expected, abs=0.05 * np.linalg.norm(slope))


def dense(bands):
    """Dense matrix of a system."""
    n = bands.shape[1]
    matrix = np.zeros((n, n))
    for i in range(n):
        matrix[i, i] += bands[0, i]
        for offset in (1, 2):
            j = (i + offset) % n
            matrix[i, j] += bands[offset, i]
            matrix[j, i] += bands[offset, i]
    return matrix


@pytest.mark.parametrize("count", [6, 7, 8, 41])
@pytest.mark.parametrize("fixed", [(), (0,), (0, 1), (2, 5)])
def test_a_step_solves_the_dense_system_of_the_free_nodes(count, fixed):
    generator = np.random.default_rng(count)
    jacobian = sum(
        generator.normal(size=count)[:, None] * np.roll(np.eye(count), shift, axis=1)
        for shift in (-1, 0, 1)
    )
    matrix = jacobian.T @ jacobian
    index = np.arange(count)
    bands = np.stack([matrix[index, (index + offset) % count] for offset in range(3)])
    slope, is_fixed = generator.normal(size=count), np.isin(index, fixed)
    step, decrease = damped_step(bands, slope, is_fixed, 0.01)
    np.testing.assert_allclose(dense(bands), matrix)
    kept = matrix[np.ix_(~is_fixed, ~is_fixed)]
    kept = kept + 0.01 * np.diag(kept).max() * np.eye(len(kept))
    np.testing.assert_array_equal(step[is_fixed], 0.0)
    np.testing.assert_allclose(step[~is_fixed], np.linalg.solve(kept, -slope[~is_fixed]), rtol=1e-7)
    assert decrease == pytest.approx(-2.0 * slope @ step - step @ matrix @ step)


@pytest.mark.parametrize("mapped", [False, True])
def test_small_moves_lower_the_energy_as_predicted(flat_disc, mapped):
    """Some strands are in contact; the remaining difference is of second order."""
    feature_map = 1.5 + flat_disc.vertices[:, 0] if mapped else None
    surface = surface_of(flat_disc, feature_map, 1.0)
    nodes = nodes_on(flat_disc, near_strands(), feature_map=feature_map)
    here = linearised(surface, nodes, contact=True)
    assert energy(nodes, here) > energy(
        nodes, Weights(here.tension, 0.0, here.feature, here.frozen_ds)
    )
    free = np.zeros(len(nodes.positions), dtype=bool)
    step = 1e-3 * damped_step(here.bands, here.slope, free, 1.0)[0]
    fall = here.energy - energy(moved_along_conormals(surface, nodes, step), here)
    assert fall > 0.0
    matrix = dense(here.bands)
    assert fall == pytest.approx(-2.0 * here.slope @ step - step @ matrix @ step, rel=0.05)


def test_contact_is_never_less_stiff_than_its_pairs(flat_disc):
    """It adds to the diagonal only, so that the matrix stays banded: 2 (a² + b²) ≥ (a + b)²."""
    surface, nodes = surface_of(flat_disc), nodes_on(flat_disc, near_strands())
    without, touching = (linearised(surface, nodes, contact=contact) for contact in (False, True))
    added = touching.bands - without.bands
    np.testing.assert_array_equal(added[1:], 0.0)
    pairs, _, by_moves = nicmm_kernels.find_contacts(nodes.for_kernels, contact_rules(2.0))
    paired = np.zeros((len(nodes.positions), len(nodes.positions)))
    for (i, j), by in zip(pairs, by_moves, strict=True):
        row = np.zeros(len(paired))
        row[[i, j]] = by
        paired += 2.0 * touching.contact * np.outer(row, row)
    least = np.linalg.eigvalsh(np.diag(added[0]) - paired).min()
    assert len(pairs) > 0 and least > -1e-9 * added.max()


@pytest.mark.parametrize("seed", [0, 1])
def test_faces_turned_over_only_turn_the_moves_of_their_nodes(flat_disc, seed):
    """Matrix and slope only change sign at nodes whose left and right are exchanged."""
    mesh = flipped(flat_disc, seed)
    here, there = nodes_on(flat_disc, wobble(41)), nodes_on(mesh, wobble(41))
    one = linearised(surface_of(flat_disc), here)
    other = linearised(surface_of(mesh), there)
    side = there.normals[:, 2]
    assert set(np.round(side)) == {-1.0, 1.0}
    np.testing.assert_allclose(
        dense(other.bands),
        side[:, None] * dense(one.bands) * side,
        rtol=0,
        atol=1e-3 * one.bands.max(),
    )
    np.testing.assert_allclose(other.slope, side * one.slope, atol=1e-3 * np.abs(one.slope).max())


@pytest.mark.parametrize("closed", [True, False])
def test_the_matrix_is_positive_and_more_damping_takes_shorter_steps(flat_disc, closed):
    nodes = nodes_on(flat_disc, wobble(40), closed)
    system = linearised(surface_of(flat_disc), nodes)
    assert np.linalg.eigvalsh(dense(system.bands)).min() > -1e-9 * system.bands[0].max()
    fixed = np.arange(40) % 13 == 0
    lengths = [
        np.linalg.norm(damped_step(system.bands, system.slope, fixed, damping)[0])
        for damping in (1e-8, 1e-4, 1e-2, 1.0)
    ]
    assert lengths == sorted(lengths, reverse=True)


def test_a_step_lowers_the_energy_to_second_order(flat_disc):
    """For a curve near its minimum, a flat arc with fixed ends, one step makes it straight."""
    surface = surface_of(flat_disc)
    x = np.linspace(-0.5, 0.5, 40)
    nodes = nodes_on(flat_disc, np.stack([x, 0.02 * np.cos(np.pi * x), 0 * x], axis=1), False)
    here = linearised(surface, nodes, smoothness=(2.0 * np.pi) ** 2)
    fixed = np.isin(np.arange(40), (0, 39))
    step = damped_step(here.bands, here.slope, fixed, 1e-10)[0]
    moved = moved_along_conormals(surface, nodes, step)
    excess = [energy(n, here) - here.tension for n in (nodes, moved)]
    assert excess[0] > 1e-3
    assert excess[1] < 0.01 * excess[0]
    np.testing.assert_allclose(moved.positions[:, 1], 0.0, atol=1e-3)


def test_touching_strands_raise_the_energy_by_the_share_that_contact_has(flat_disc):
    nodes = nodes_on(flat_disc, near_strands())
    here = linearised(surface_of(flat_disc), nodes, contact=True)
    assert here.contact > 0.0
    assert here.energy > 2.0 * energy(nodes, Weights(here.tension))
    free = nodes_on(flat_disc, circle(angles(60), 0.6))
    surface = surface_of(flat_disc)
    with_contact = linearised(surface, free, contact=True).energy
    assert with_contact == linearised(surface, free).energy


def test_coinciding_nodes_do_not_overflow(flat_disc):
    """Two neighbouring nodes at the same place have a finite system."""
    mesh, places = scaled(flat_disc, 1e-2), wobble(48, 1e-2)
    places[7] = places[8]
    system = linearised(surface_of(mesh), nodes_on(mesh, places))
    move, decrease = damped_step(system.bands, system.slope, np.zeros(48, dtype=bool), 1e-3)
    assert np.isfinite(move).all() and np.isfinite(decrease)
