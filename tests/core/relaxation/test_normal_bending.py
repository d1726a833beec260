"""Tests the bending of curves by the curvature of the surface, against closed forms."""

import numpy as np
import pytest
from scipy.optimize import minimize

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.normals import unsigned_normals
from nicmm_core.relaxation.curve_nodes import CurveSurface, nodes_at
from nicmm_core.relaxation.elastic_energy import bending_energy
from tests.core.checks import assert_valid_design, circle, cylinder, flipped, grid, points_near
from tests.oracles.reference_energy import energy, linearised, moved_along_conormals


def surface_of(mesh, weight):
    return CurveSurface(mesh, unsigned_normals(mesh), normal_bending=weight)


def nodes_on(mesh, positions, closed=True):
    return nodes_at(surface_of(mesh, 0.0), points_near(mesh, positions), closed)


def angles(count):
    return np.arange(count) * 2 * np.pi / count


@pytest.mark.parametrize("latitude", [0.0, 0.5])
@pytest.mark.parametrize("count", [60, 400])
def test_a_parallel_of_the_sphere_bends_as_in_space(latitude, count):
    """∮ κ² ds = 2π / cos φ, by nodes nearer together and farther apart than edges."""
    mesh = shapes.sphere(4)
    nodes = nodes_on(mesh, circle(angles(count), np.cos(latitude)) + [0, 0, np.sin(latitude)])
    normal = bending_energy(nodes, 1.0) - bending_energy(nodes)
    assert normal == pytest.approx(2 * np.pi * np.cos(latitude), rel=0.02)
    assert bending_energy(nodes, 1.0) == pytest.approx(2 * np.pi / np.cos(latitude), rel=0.02)
    assert bending_energy(nodes, 0.3) - bending_energy(nodes) == pytest.approx(0.3 * normal)


@pytest.mark.parametrize("slope", [0.0, 0.5, 2.0])
def test_a_helix_bends_by_the_square_of_its_cosine(slope):
    """On a cylinder of radius r, κ_n = cos² θ / r for a helix at the angle θ."""
    mesh = cylinder(96, 48, radius=1.0)
    around = np.linspace(0.2, 0.2 + 1.6 / max(slope, 1.0), 80)
    height = 0.2 + slope * (around - around[0])
    points = np.stack([np.cos(around), np.sin(around), height], axis=1)
    nodes = nodes_on(mesh, points, closed=False)
    expected = nodes.lengths.sum() / (1.0 + slope**2) ** 2
    assert bending_energy(nodes, 1.0) - bending_energy(nodes) == pytest.approx(expected, rel=0.01)


def test_a_plane_does_not_bend_a_curve(flat_disc):
    nodes = nodes_on(flat_disc, circle(angles(50), 0.6))
    assert bending_energy(nodes, 1.0) == pytest.approx(bending_energy(nodes))


def test_sides_of_normals_do_not_matter(ball):
    loop = circle(angles(60), 0.9) + [0.0, 0.0, 0.436]
    straight, turned = (
        bending_energy(nodes_on(mesh, loop), 1.0) for mesh in (ball, flipped(ball, 3))
    )
    assert turned == pytest.approx(straight, rel=0.02)


def test_the_core_of_a_moebius_strip_bends_as_in_space():
    """The core is a circle, and its normals change sides once."""
    mesh = shapes.moebius_strip(96, 7)
    nodes = nodes_on(mesh, circle(angles(96)))
    assert bending_energy(nodes, 1.0) == pytest.approx(2 * np.pi, rel=0.02)


@pytest.mark.parametrize("closed", [True, False])
def test_energy_and_slope_are_those_of_the_formula(closed):
    """Up to the difference between the mesh and the smooth surface of its normals."""
    mesh = shapes.torus(around=96, across=48)
    surface = surface_of(mesh, 0.7)
    angle = angles(60)[: 60 if closed else 45]
    across = 1.0 + 0.6 * np.sin(3 * angle)
    points = circle(angle) * (1.0 + 0.4 * np.cos(across))[:, None]
    points[:, 2] += 0.4 * np.sin(across)
    nodes = nodes_at(surface, points_near(mesh, points), closed)
    here = linearised(surface, nodes)
    assert here.normal_bending == 0.7
    assert here.energy == pytest.approx(energy(nodes, here))
    step = 1e-4 * nodes.lengths.mean()
    generator = np.random.default_rng(1)
    for _ in range(5):
        phase, waves = generator.uniform(0, 6), generator.integers(1, 6)
        move = np.cos(waves * angle + phase)
        ahead, behind = (
            moved_along_conormals(surface, nodes, s * step * move) for s in (1.0, -1.0)
        )
        expected = 0.25 * (energy(ahead, here) - energy(behind, here)) / step
        assert move @ here.slope == pytest.approx(expected, abs=0.05 * np.linalg.norm(here.slope))


def on_unrolled_cylinder(across, along, tension, modes=8):
    """Energy of the best curve from (0, 0) to (across, along) on the unrolled unit cylinder.

    The unknowns are the cosine modes of its direction θ, which has no slope at free ends, and its
    length.
    """
    share = (np.arange(400) + 0.5) / 400
    number = np.arange(modes)
    cosines = np.cos(np.pi * number[:, None] * share)

    def value(unknown):
        amplitudes, length = unknown[:-1], unknown[-1]
        bending = 0.5 * np.pi**2 * (number * amplitudes) @ (number * amplitudes) / length
        return bending + (np.mean(np.cos(amplitudes @ cosines) ** 4) + tension) * length

    def gap(unknown):
        theta = unknown[:-1] @ cosines
        return unknown[-1] * np.array([np.cos(theta).mean(), np.sin(theta).mean()]) - [
            across,
            along,
        ]

    begin = np.zeros(modes + 1)
    begin[[0, 1, 2, -1]] = np.arctan2(along, across), 0.1, 0.1, np.hypot(across, along)
    found = minimize(value, begin, constraints={"type": "eq", "fun": gap}, method="SLSQP")
    assert found.success
    return found.fun


@pytest.mark.slow
@pytest.mark.parametrize("smoothness", [0.3, 3.0])
def test_between_two_points_of_a_cylinder_the_curve_is_the_best_one(smoothness):
    mesh = cylinder(96, 48)
    ends = mesh.vertices[[5 * 49 + 10, 25 * 49 + 30]]
    design = nicmm.design_curve(mesh, ends, closed=False, normal_bending=1.0, smoothness=smoothness)
    assert_valid_design(mesh, design, ends, closed=False)
    curve = design.resumable.curve
    scale = curve.length / np.linalg.norm(np.diff(design.curves[0].points, axis=0), axis=1).sum()
    tension = (2 * np.pi / curve.length) ** 2 / smoothness
    found = bending_energy(curve.nodes, 1.0) + tension * curve.length
    radius = scale  # the design has the unit of its copy of the mesh
    best = on_unrolled_cylinder(20 / 96 * 2 * np.pi, 20 / 24, tension * radius**2) / radius
    assert found == pytest.approx(best, rel=0.01)


def corrugated(waves=6, height=0.06):
    """A square with waves along x."""
    mesh = grid(60)
    vertices = mesh.vertices.copy()
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    vertices = (vertices - low) / (high - low).max()
    vertices[:, 2] = height * np.sin(2 * np.pi * waves * vertices[:, 0])
    return nicmm.Mesh(vertices, mesh.faces)


@pytest.mark.slow
def test_across_a_corrugated_plane_the_curve_climbs_less():
    """It crosses the waves more directly, or keeps to a valley; it bends less in space."""
    mesh = corrugated()
    ends = np.array([[0.1, 0.1, 0.0], [0.9, 0.9, 0.0]])
    ends = mesh.vertices[[np.argmin(((mesh.vertices - e)[:, :2] ** 2).sum(axis=1)) for e in ends]]
    bent = []
    for weight in (0.0, 0.1, 1.0):
        design = nicmm.design_curve(mesh, ends, closed=False, normal_bending=weight)
        assert_valid_design(mesh, design, ends, closed=False)
        bent.append(bending_energy(design.resumable.curve.nodes, 1.0))
    assert bent[2] < 0.9 * bent[0]
    assert bent[2] <= bent[1] <= bent[0]


@pytest.mark.slow
def test_the_weight_is_continuous_at_zero(body):
    points = [10, 200, 400]
    none, little = (nicmm.design_curve(body, points, normal_bending=w) for w in (0.0, 1e-9))
    apart = np.abs(none.curves[0].points[:, None] - little.curves[0].points).sum(axis=2).min(axis=1)
    assert apart.max() < 1e-3 * body.diagonal
