"""Tests that curves in one set of arrays have the energies, steps and results of single curves."""

import numpy as np
import pytest
from nicmm_kernels import damped_step

from nicmm_core import shapes
from nicmm_core.geometry.surface_points import joined
from nicmm_core.relaxation.batch_relaxation import BatchConfig, curves_of, relax_batch
from nicmm_core.relaxation.curve_nodes import CurveSurface, curve_surface, nodes_at
from tests.core.checks import circle, points_near, simple_curves
from tests.oracles.reference_energy import linearised

SIZE = 40


@pytest.fixture(scope="module")
def surface():
    return curve_surface(shapes.sphere(4))


def rings(surface, closed=True):
    """Three wavy circles of latitude, as one set of nodes and one by one."""
    angle = np.arange(SIZE) * 2.0 * np.pi / (SIZE if closed else 1.3 * SIZE)
    places = []
    for height, waves in ((0.1, 2), (-0.3, 3), (0.5, 0)):
        z = height + 0.1 * np.sin(waves * angle)
        ring = np.sqrt(1.0 - z**2)
        positions = np.column_stack([ring * np.cos(angle), ring * np.sin(angle), z])
        places.append(points_near(surface.mesh, positions))
    return nodes_at(surface, joined(places), closed, 3), [
        nodes_at(surface, place, closed) for place in places
    ]


def fixed_nodes(count=1):
    fixed = np.zeros(SIZE, dtype=bool)
    fixed[[0, 13, 27, SIZE - 1]] = True
    return np.tile(fixed, count)


def test_contact_is_within_each_curve(surface):
    """Different curves do not repel each other, even in the same place."""
    _, alone = rings(surface)
    twice = nodes_at(surface, joined([alone[0].places, alone[0].places]), True, 2)
    both = relax_batch(surface, twice, fixed_nodes(2), 1.0, BatchConfig())
    own = relax_batch(surface, alone[0], fixed_nodes(), 1.0, BatchConfig())
    np.testing.assert_array_equal(both.positions, np.tile(own.positions, (2, 1)))


@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize("mapped", [True, False])
def test_relaxing_together_is_relaxing_alone(surface, closed, mapped):
    if mapped:
        phi_fea = 1.0 + 0.5 * np.sin(3.0 * surface.mesh.vertices[:, 0])
        surface = CurveSurface(surface.mesh, surface.vertex_normals, phi_fea, 40.0)
    together, alone = rings(surface, closed)
    config = BatchConfig(iterations=6)
    found = relax_batch(surface, together, fixed_nodes(3), 1.0, config)
    for number, nodes in enumerate(alone):
        own = relax_batch(surface, nodes, fixed_nodes(), 1.0, config)
        here = curves_of(found, np.array([number])).positions
        np.testing.assert_array_equal(here, own.positions)


def energies(surface, nodes):
    """Energy of each of three curves, with weights of its own."""
    curves = [curves_of(nodes, np.array([number])) for number in range(3)]
    return np.array([linearised(surface, curve).energy for curve in curves])


def test_energies_fall_and_fixed_nodes_stay(surface):
    nodes, _ = rings(surface)
    found = relax_batch(surface, nodes, fixed_nodes(3), 1.0, BatchConfig())
    before, after = (energies(surface, curves) for curves in (nodes, found))
    assert (after <= before).all() and after[1] < 0.9 * before[1]
    fixed = fixed_nodes(3)
    np.testing.assert_array_equal(found.positions[fixed], nodes.positions[fixed])


def test_a_curve_that_crosses_itself_is_told(surface):
    angles = np.arange(SIZE) * 2.0 * np.pi / SIZE
    eight = np.column_stack([0.5 * np.sin(angles), 0.4 * np.sin(2.0 * angles)])
    ring = circle(angles, 0.5)[:, :2]
    places = []
    for flat in (eight, ring):
        heights = np.sqrt(1.0 - (flat**2).sum(axis=1))
        places.append(points_near(surface.mesh, np.column_stack([flat, heights])))
    nodes = nodes_at(surface, joined(places), True, 2)
    assert simple_curves(surface, nodes).tolist() == [False, True]


def test_a_curve_without_length_does_not_disturb_the_others(surface):
    """The system of a curve without length is singular."""
    angle = 4.0 * np.pi * np.arange(SIZE) / SIZE
    twice = np.column_stack([np.cos(angle), np.sin(angle), 0.1 * np.sin(0.5 * angle + 0.3)])
    close = points_near(surface.mesh, twice)
    point = points_near(surface.mesh, np.tile([[0.0, 0.0, -1.0]], (SIZE, 1)))
    stack = nodes_at(surface, joined([close, point, close]), True, 3)
    alone = nodes_at(surface, point, True)
    singular = linearised(surface, alone, contact=True)
    assert (damped_step(singular.bands, singular.slope, fixed_nodes(), 1e-3)[0] == 0.0).all()
    relaxed = relax_batch(surface, stack, fixed_nodes(3), 1.0, BatchConfig(iterations=3))
    assert np.isfinite(relaxed.positions).all()
    first, still, last = relaxed.positions.reshape(3, SIZE, 3)
    np.testing.assert_array_equal(first, last)
    np.testing.assert_allclose(still, alone.positions, atol=1e-5)
    assert np.abs(first - stack.positions[:SIZE]).max() > 1e-4
