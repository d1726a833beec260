"""Tests contacts of strands against closed forms and differences."""

from types import SimpleNamespace

import nicmm_kernels
import numpy as np
import pytest

from nicmm_core import shapes
from nicmm_core.geometry.normals import unsigned_normals
from nicmm_core.relaxation.curve_nodes import CurveSurface, Nodes, nodes_at
from nicmm_core.relaxation.rules import CLEARANCE, NEARBY, contact_rules
from tests.core.checks import circle, points_near, scaled
from tests.oracles import reference_energy

STEP = 0.02


def contacts_between(nodes, before=None):
    """Pairs of nodes in contact, their overlaps and their derivatives."""
    first = None if before is None else before.for_kernels
    return nicmm_kernels.find_contacts(nodes.for_kernels, contact_rules(NEARBY), first)


def seen_by_nodes(nodes):
    """Contacts listed once for each of the two nodes of a pair."""
    pairs, overlap, derivatives = contacts_between(nodes)
    return SimpleNamespace(
        node=pairs.T.ravel(), overlap=np.tile(overlap, 2), derivative=derivatives.T.ravel()
    )


def lanes(mesh, gap, factor=1.0, closed=False):
    """Nodes along y = 0, around a turn, and back along y = gap; thirty in each direction."""
    x = STEP * np.arange(-15, 16)
    bow = 2.0 * STEP * np.arange(1, 8)
    there = np.stack([x, 0 * x], axis=1)
    out = np.stack([x[-1] + bow, 0 * bow], axis=1)
    up = np.stack([np.full(3, out[-1, 0]), gap * np.array([0.25, 0.5, 0.75])], axis=1)
    back = np.stack([out[::-1, 0], np.full(7, gap)], axis=1)
    points = np.concatenate([there, out, up, back, there[::-1] + [0.0, gap]])
    surface = CurveSurface(mesh, unsigned_normals(mesh))
    return nodes_at(surface, points_near(mesh, factor * np.pad(points, ((0, 0), (0, 1)))), closed)


@pytest.mark.parametrize("factor", [1e-3, 1.0, 1e3])
def test_the_overlap_of_two_lanes_is_what_lacks_of_the_clearance(flat_disc, factor):
    mesh = scaled(flat_disc, factor)
    nodes = lanes(mesh, STEP, factor)
    contacts = seen_by_nodes(nodes)
    clearance = CLEARANCE * nodes.lengths.mean()
    # Pairs of opposite nodes in the middle parts of both lanes.
    opposite = {(i, len(nodes.positions) - 1 - i) for i in range(5, 25)}
    assert len(contacts.node) % 2 == 0
    nearest = [contacts.overlap[contacts.node == i].max() for i, _ in opposite]
    np.testing.assert_allclose(nearest, 1.0 - factor * STEP / clearance, rtol=1e-3)
    # The conormal points to the left, towards the other lane, so moves increase the overlap.
    for i, j in opposite:
        for node in (i, j):
            straight = contacts.overlap[contacts.node == node].argmax()
            slope = contacts.derivative[contacts.node == node][straight]
            assert slope == pytest.approx(1.0 / clearance, rel=1e-3)


def test_lanes_farther_apart_than_the_clearance_do_not_touch(flat_disc):
    wide = lanes(flat_disc, 0.3)
    gap = 1.05 * CLEARANCE * wide.lengths.mean()
    assert len(seen_by_nodes(lanes(flat_disc, gap)).node) == 0
    assert len(seen_by_nodes(lanes(flat_disc, 0.8 * gap)).node) > 0


def test_a_round_circle_does_not_touch_itself(flat_disc):
    """Neighbouring nodes do not count, nor do the last and the first ones of a closed curve."""
    surface = CurveSurface(flat_disc, unsigned_normals(flat_disc))
    places = points_near(flat_disc, circle(np.arange(100) * 2 * np.pi / 100, 0.6))
    assert len(seen_by_nodes(nodes_at(surface, places, True)).node) == 0


def test_the_ends_of_an_open_curve_touch_each_other(flat_disc):
    surface = CurveSurface(flat_disc, unsigned_normals(flat_disc))
    places = points_near(flat_disc, circle(np.arange(100) * 2 * np.pi / 100, 0.6))
    touching = seen_by_nodes(nodes_at(surface, places, False)).node
    assert {0, 99} <= set(touching.tolist()) <= {0, 1, 98, 99}


@pytest.mark.parametrize("uneven", [0.05, 0.1, 0.3])
def test_the_same_strand_does_not_touch_itself_where_its_nodes_are_dense(flat_disc, uneven):
    """What counts is the distance along the curve, not the number of nodes in between."""
    dense = np.concatenate([np.full(12, uneven), np.ones(88)])
    angle = np.concatenate([[0.0], np.cumsum(dense)[:-1]]) * 2 * np.pi / dense.sum()
    surface = CurveSurface(flat_disc, unsigned_normals(flat_disc))
    places = points_near(flat_disc, circle(angle, 0.6))
    assert len(seen_by_nodes(nodes_at(surface, places, True)).node) == 0


def test_both_sides_of_a_thin_sheet_do_not_touch():
    """Two strands of a flat ellipsoid, above each other on opposite sides."""
    ball = shapes.sphere(4)
    thin = scaled(ball, 1.0).vertices * [1.0, 1.0, 0.005]
    mesh = type(ball)(thin, ball.faces)
    x = np.linspace(-0.6, 0.6, 40)
    above = np.stack([x, 0 * x, 0 * x + 0.1], axis=1)
    nodes = nodes_at(
        CurveSurface(mesh, unsigned_normals(mesh)),
        points_near(mesh, np.concatenate([above, above[::-1] * [1, 1, -1]])),
        True,
    )
    assert len(seen_by_nodes(nodes).node) == 0


@pytest.mark.parametrize("gap", [0.5, 1.0, 1.9])
@pytest.mark.parametrize("closed", [True, False])
def test_the_pairs_are_those_of_brute_force(flat_disc, gap, closed):
    nodes = lanes(flat_disc, gap * STEP, closed=closed)
    pairs, overlap, derivatives = contacts_between(nodes)
    expected, distance = reference_energy.contacts(nodes)
    order = np.lexsort(pairs.T[::-1])
    np.testing.assert_array_equal(pairs[order], expected)
    clearance = CLEARANCE * nodes.lengths.mean()
    np.testing.assert_allclose(overlap[order], 1.0 - distance / clearance, rtol=1e-9)
    assert len(pairs) > 20 and derivatives.shape == pairs.shape


def test_the_derivative_is_that_of_the_overlap(flat_disc):
    """Compared with moves of one node; the change of the clearance, a mean, is removed."""
    nodes = lanes(flat_disc, 1.3 * STEP)
    contacts = seen_by_nodes(nodes)
    clearance = CLEARANCE * nodes.lengths.mean()
    move = 1e-6 * STEP
    for node in (8, 14, 60):
        positions = nodes.positions.copy()
        positions[node] += move * nodes.conormals[node]
        moved = Nodes(nodes.places, False, positions, nodes.normals, nodes.phi_fea)
        after = seen_by_nodes(moved)
        scale = CLEARANCE * moved.lengths.mean() / clearance
        own = contacts.node == node
        assert own.any()
        change = 1.0 - (1.0 - after.overlap[after.node == node]) * scale - contacts.overlap[own]
        np.testing.assert_allclose(
            np.sort(change / move), np.sort(contacts.derivative[own]), rtol=1e-3, atol=1e-3
        )


def test_faces_turned_over_in_one_piece_do_not_matter(flat_disc):
    turned = type(flat_disc)(flat_disc.vertices, flat_disc.faces[:, ::-1])
    here, there = (seen_by_nodes(lanes(mesh, STEP)) for mesh in (flat_disc, turned))
    np.testing.assert_array_equal(np.bincount(here.node), np.bincount(there.node))


@pytest.mark.parametrize("gap", [0.5, 0.9, 1.1, 1.9, 2.5, 4.0])
def test_strands_sought_at_other_places_have_the_contacts_of_the_present_ones(flat_disc, gap):
    """Lanes were in contact or not before, and have made short or long moves.

    The turn is excluded: nodes there are barely far enough apart along the curve, and whether they
    form a pair depends on their old positions.
    """
    present = lanes(flat_disc, gap * STEP)

    def of_straight_parts(contacts):
        pairs, overlap = np.sort(contacts[0], axis=1), contacts[1]
        kept = (pairs < 25).any(axis=1)
        return dict(zip(map(tuple, pairs[kept].tolist()), overlap[kept], strict=True))

    expected = of_straight_parts(contacts_between(present))
    assert (len(expected) > 0) == (gap < 2.0)
    for before in (1.0, 1.8, 3.0):
        found = contacts_between(present, lanes(flat_disc, before * STEP))
        assert of_straight_parts(found) == pytest.approx(expected)
