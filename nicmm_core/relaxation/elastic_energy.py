"""Computes the energy of a curve, its Gauss–Newton system, and damped steps of its nodes.

The energy is that of Eq. 6 and 7 for a φ that is exactly the distance to its zero set. Then
|∇φ| = 1, the level-set term vanishes, and the integrals reduce to integrals along the curve:

    E = ∮ κ_g² ds + τ ∮ ds + τ_fea ∮ (φ_fea² - 1) ds.

Without the length term, distant points would be joined by ever larger arcs. With τ = (2π / L)² a
circle in the plane neither grows nor shrinks, so the balance does not depend on scale.

Outside all maps φ_fea = 1, so maps have no effect there. τ_fea scales with the surface but is at
least a few times τ, which matters for short curves. In an obstacle φ_fea > 1, which adds to the
tension. In a lane, a region painted for alignment, φ_fea < 1. The energy must not reward length
there, or the curve would buckle in the lane to gain length. So ds is held constant in this term,
and only the position of the curve counts. Where strands must not cross, a contact term keeps them
apart (`strand_contact`).

The unknowns are the moves of the nodes along their conormals. The residuals of a node depend only
on the node and its two neighbours, so the Gauss–Newton matrix has two bands on each side and a step
is cheap.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from scipy import linalg, sparse
from scipy.linalg.lapack import dpbsv
from scipy.sparse.linalg import splu

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.vectors import cross, dot
from .curve_nodes import CurveSurface, Nodes
from .strand_contact import Contacts, contacts_between

OVER_TENSION = 4.0
"""Multiple of τ added to τ_fea, so that short curves follow a map too.

τ grows as the curve gets shorter, independently of the surface. For curves shorter than about
√area / 4, tension alone would exceed the pull of a map. With this term a map may bend any curve to
half the radius of a circle of the same length; long curves hardly change.
"""

CONTACT = 10.0
"""Contact energy of a curve whose strands touch everywhere, relative to its energy without maps."""


@dataclass(frozen=True)
class Balance:
    """Weights of the energy terms, which change from step to step but not within a step.

    For a single curve each weight is a number; for several curves it has a value at each node.

    Attributes
    ----------
    tension : float or (n,) float array
        τ, in 1/length².
    contact : float or (n,) float array
        Weight of the contacts of a node, in 1/length; 0 where strands may cross.
    feature : float or (n,) float array
        τ_fea, in 1/length²; 0 without a map.
    held : (n,) float array or None
        ds at each node, held constant in the term of lanes; None without a map.
    """

    tension: float | FloatArray
    contact: float | FloatArray
    feature: float | FloatArray = 0.0
    held: FloatArray | None = None


def balance(
    surface: CurveSurface, nodes: Nodes, smoothness: float, apart: bool, tension_factor: float = 1.0
) -> Balance:
    """Compute the weights of the energy terms for one or more curves.

    Parameters
    ----------
    surface : CurveSurface
    nodes : Nodes
    smoothness : float
        Divisor of the tension and of the weight of a map.
    apart : bool
        Whether strands are kept apart.
    tension_factor : float
        Additional factor of the tension only.
    """
    lengths = nodes.by_curve(nodes.step_lengths).sum(axis=1)
    tension = _weight(nodes, (2.0 * np.pi / lengths) ** 2 / smoothness)
    weights = Balance(tension_factor * tension, 0.0)
    if apart:
        size = nodes.per_curve
        contact = _weight(nodes, CONTACT * curve_energies(nodes, weights) / size)
        weights = replace(weights, contact=contact)
    if surface.feature_map is not None:
        feature = surface.feature_weight / smoothness + OVER_TENSION * tension
        weights = replace(weights, feature=feature, held=nodes.ds)
    return weights


def _weight(nodes: Nodes, values: FloatArray) -> float | FloatArray:
    """Values of the curves, (c,), as a weight: a number for one curve, else values at nodes."""
    return float(values[0]) if nodes.curves == 1 else nodes.spread(values)


def bending_energy(nodes: Nodes) -> float:
    """∮ κ_g² ds of one curve, in 1/length."""
    return float(curve_bending(nodes)[0])


def node_bending(nodes: Nodes) -> FloatArray:
    """κ_g² ds at each node, (n,); zero at the ends of open curves."""
    return nodes.turns.angle**2 / nodes.ds


def curve_bending(nodes: Nodes) -> FloatArray:
    """∮ κ_g² ds of each curve, (c,), in 1/length."""
    return nodes.by_curve(node_bending(nodes)).sum(axis=1)


def feature_energy(nodes: Nodes) -> float:
    """∮ φ_fea² ds of one curve, in units of length."""
    return float((nodes.phi_fea**2 * nodes.ds).sum())


def elastic_energy(nodes: Nodes, weights: Balance, contacts: Contacts | None = None) -> float:
    """E of one curve, with the contact term if its weight is not zero."""
    return float(curve_energies(nodes, weights, contacts)[0])


def comparable_energies(
    surface: CurveSurface, nodes: Nodes, smoothness: float, scale: float
) -> FloatArray:
    """E of all curves, (c,), with one length scale L₀, so that different courses can be compared.

        E = L₀ ∮ κ_g² ds + 4π² L / (s L₀) + L₀ τ_fea (∮ max(φ_fea² - 1, 0) ds + L₀ a),

    where s is the smoothness and a the mean of min(φ_fea² - 1, 0) along the curve. For a plane
    circle of length L₀ and s = 1, the first two terms are 4π² each. With a separate length scale
    for each curve, a long detour would cost nothing. With the length of the curve as the factor of
    a, turning back and forth in a lane would lower the energy.

    Parameters
    ----------
    surface : CurveSurface
    nodes : Nodes
        Nodes of c curves.
    smoothness : float
    scale : float
        L₀, in mesh units.
    """
    at_nodes, lanes, weight = comparable_terms(surface, nodes, smoothness, scale)
    length = nodes.by_curve(nodes.step_lengths).sum(axis=1)
    return (
        nodes.by_curve(at_nodes).sum(axis=1) + weight * nodes.by_curve(lanes).sum(axis=1) / length
    )


def comparable_terms(
    surface: CurveSurface, nodes: Nodes, smoothness: float, scale: float
) -> tuple[FloatArray, FloatArray, float]:
    """The terms of `comparable_energies` at the nodes.

    Returns
    -------
    (n,) float array
        All of E but the term of a.
    (n,) float array
        min(φ_fea² - 1, 0) ds, whose sum over a curve is L a.
    float
        Factor of a in E; 0 without a map.
    """
    tension, ds = (2.0 * np.pi / scale) ** 2 / smoothness, nodes.ds
    energy = scale * (node_bending(nodes) + tension * ds)
    if surface.feature_map is None:
        return energy, np.zeros(len(ds)), 0.0
    weight = scale * (surface.feature_weight / smoothness + OVER_TENSION * tension)
    excess = nodes.phi_fea**2 - 1.0
    energy += weight * np.maximum(excess, 0.0) * ds
    return energy, np.minimum(excess, 0.0) * ds, scale * weight


def curve_energies(nodes: Nodes, weights: Balance, contacts: Contacts | None = None) -> FloatArray:
    """E of each curve, (c,), with the contact term if its weight is not zero.

    Contacts are computed unless they are given.
    """
    at_nodes = node_bending(nodes) + _tension(nodes, weights) * nodes.ds
    if weights.held is not None:
        in_lanes = np.minimum(nodes.phi_fea, 1.0) ** 2 - 1.0
        at_nodes += weights.feature * in_lanes * weights.held
    if np.any(weights.contact):
        contacts = contacts or contacts_between(nodes)
        overlap = np.bincount(contacts.pairs[:, 0], contacts.overlap**2, len(at_nodes))
        at_nodes += 2.0 * weights.contact * overlap
    return nodes.by_curve(at_nodes).sum(axis=1)


def energy_scales(nodes: Nodes, weights: Balance, energies: FloatArray) -> FloatArray:
    """Positive values, (c,), that decreases of the energies of all curves are compared with.

    They are the energies themselves, (c,), unless there is a map: the term of a lane is negative.
    Then they are the energies without maps and contact.
    """
    if weights.held is None:
        return energies
    return curve_energies(nodes, replace(weights, contact=0.0, feature=0.0, held=None))


def _tension(nodes: Nodes, weights: Balance) -> FloatArray:
    """Tension at each node, (n,): τ, plus τ_fea times the excess φ_fea² - 1 in an obstacle."""
    excess = np.maximum(nodes.phi_fea**2 - 1.0, 0.0)
    return weights.tension + weights.feature * excess


def _no_pairs() -> IntArray:
    return np.zeros((0, 2), dtype=np.int64)


def _no_entries() -> FloatArray:
    return np.zeros((3, 0))


@dataclass(frozen=True)
class ElasticSystem:
    """Half the derivatives of the energy by moves of the nodes along their conormals.

    The first derivatives are the slope; the Gauss–Newton matrix approximates the second ones.

    Attributes
    ----------
    bands : (3, n) float array
        The matrix without contact: symmetric, with two cyclic bands on each side. Column i has the
        entries (i, i), (i, i + 1) and (i, i + 2), with indices modulo n.
    slope : (n,) float array
        Half the derivative of the energy by the move of each node.
    pairs : (p, 2) int array
        Pairs (i, j) of nodes in contact.
    pair_entries : (3, p) float array
        Contributions of contact to the entries (i, i), (i, j) and (j, j) of the matrix.
    curves : int
        Number c of curves; within each of them, indices are modulo n / c.
    """

    bands: FloatArray
    slope: FloatArray
    pairs: IntArray = field(default_factory=_no_pairs)
    pair_entries: FloatArray = field(default_factory=_no_entries)
    curves: int = 1

    @property
    def diagonal(self) -> FloatArray:
        """Diagonal of the matrix with contact, shape (n,)."""
        if not len(self.pairs):
            return self.bands[0]
        added = self.pair_entries[[0, 2]].ravel()
        return self.bands[0] + np.bincount(self.pairs.T.ravel(), added, len(self.slope))


def elastic_system(
    surface: CurveSurface, nodes: Nodes, weights: Balance, contacts: Contacts | None = None
) -> ElasticSystem:
    """Assemble the Gauss–Newton system; the residuals are the square roots of the energy's terms.

    Contacts are computed unless they are given.
    """
    n = len(nodes.positions)
    tension = _tension(nodes, weights)
    residuals, jacobian, drift = _linearised(surface, nodes, weights, tension)
    bands, slope = _normal_equations(nodes, jacobian, residuals)
    if weights.held is not None:
        pull = np.where(nodes.phi_fea < 1.0, weights.feature * weights.held * drift, 0.0)
        bands[0] += pull * drift
        slope += pull * nodes.phi_fea
    # JᵀJ lacks a part of the second derivative of the length: the stiffness of a taut string.
    lengths = np.maximum(nodes.step_lengths, tolerances.SAME_POSITION * surface.mesh.diagonal)
    if not nodes.closed:
        lengths[nodes.last] = np.inf
    stiffness = tension / lengths
    bands[0] += stiffness + nodes.before_each(stiffness)
    # Without an orientation, moves of two neighbours to the same side may have opposite signs.
    opposite = dot(nodes.normals.T, nodes.after_each(nodes.normals.T)) < 0.0
    bands[1] -= np.where(opposite, -stiffness, stiffness)
    if not np.any(weights.contact):
        return ElasticSystem(bands, slope, curves=nodes.curves)
    contact = contacts or contacts_between(nodes)
    # A pair counts for both of its nodes.
    weight = np.broadcast_to(2.0 * np.asarray(weights.contact), n)[contact.pairs[:, 0]]
    pull = (weight * contact.overlap)[:, None] * contact.derivatives
    slope += np.bincount(contact.pairs.ravel(), pull.ravel(), n)
    one, other = contact.derivatives.T
    if nodes.curves > 1:
        # Only diagonal entries, so that the matrix stays banded, which is far faster to solve. They
        # overestimate the stiffness, since 2 (a² + b²) is never less than (a + b)².
        own = 2.0 * weight[:, None] * contact.derivatives**2
        bands[0] += np.bincount(contact.pairs.ravel(), own.ravel(), n)
        return ElasticSystem(bands, slope, curves=nodes.curves)
    entries = weight * np.stack([one * one, one * other, other * other])
    return ElasticSystem(bands, slope, contact.pairs, entries, nodes.curves)


def damped_step(system: ElasticSystem, free: BoolArray, damping: float | FloatArray) -> FloatArray:
    """Moves of the free nodes along conormals that lower the linearised energy, shape (n,).

    A curve does not move if its linearisation is zero or not finite, as where nodes coincide.

    Parameters
    ----------
    system : ElasticSystem
    free : (n,) bool array
        Which nodes may move; at least one.
    damping : float or (c,) float array
        Damping of each curve. It is added to the diagonal of the matrix, relative to the greatest
        diagonal entry of a free node.
    """
    may = free.reshape(system.curves, -1)
    after, after_next = (np.concatenate([may[:, i:], may[:, :i]], axis=1) for i in (1, 2))
    both = np.array([may, may & after, may & after_next]).reshape(system.bands.shape)
    bands = np.where(both, system.bands, 0.0)
    greatest = np.where(free, system.diagonal, 0.0).reshape(may.shape).max(axis=1)
    bands[0] += np.where(may, (damping * greatest)[:, None], 1.0).ravel()
    right = np.where(free, -system.slope, 0.0)
    sums = bands[0] + bands[1] + bands[2] + right
    entries = system.pair_entries
    if len(system.pairs):
        one, other = system.pairs.T
        ends = np.array([free[one], free[one] & free[other], free[other]])
        entries = np.where(ends, entries, 0.0)
        sums += np.bincount(one, entries.sum(axis=0), len(right))
    sound = np.isfinite(sums).reshape(may.shape).all(axis=1) & (greatest > tolerances.TINY)
    if not sound.all():
        still = sound.repeat(may.shape[1]) ^ True
        bands[:, still], bands[0, still], right[still] = 0.0, 1.0, 0.0
        entries = np.where(still[system.pairs[:, 0]], 0.0, entries)
    if not len(system.pairs):
        return _solved(bands, right, system.curves)
    return _solved_with_pairs(bands, system.pairs, entries, right)


def predicted_decrease(system: ElasticSystem, move: FloatArray) -> float:
    """Decrease of the linearised energy by given moves along the conormals, (n,)."""
    if not move.any():  # the matrix need not be finite
        return 0.0
    return -float(move @ (2.0 * system.slope + _product(system, move)))


def _linearised(
    surface: CurveSurface, nodes: Nodes, weights: Balance, tension: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Residuals κ_g √ds and √(tension ds) of every node, and their derivatives by moves.

    Returns
    -------
    (2, n) float array
        Residuals.
    (3, 2, n) float array
        Derivatives of the residuals of node i by the moves of nodes i - 1, i and i + 1.
    (n,) float array
        Derivative of φ_fea at each node by the move of that node.
    """
    here = nodes.conormals.T
    here_before, here_after = nodes.before_each(here), nodes.after_each(here)
    normal_turn, drift = nodes.conormal_derivatives(surface)
    turn, normal = normal_turn.T, nodes.normals.T
    before, out_before, out_after, product, sine, cosine, angle = nodes.turns
    after = nodes.steps.T
    length_before, length_after = nodes.before_each(nodes.step_lengths), nodes.step_lengths
    flat_before, flat_after = before - out_before * normal, after - out_after * normal
    squared_before = np.maximum(dot(flat_before, flat_before), tolerances.TINY)
    squared_after = np.maximum(dot(flat_after, flat_after), tolerances.TINY)
    by_before = cross(flat_before, normal) / squared_before
    by_after = cross(normal, flat_after) / squared_after
    by_normal = sine * (out_after * dot(before, turn) + out_before * dot(after, turn))
    # Divided by one square after the other: the product of two tiny squares may underflow.
    by_normal = (by_normal + cosine * dot(product, turn)) / squared_before / squared_after
    angle_by = np.array(
        [
            -dot(by_before, here_before),
            dot(by_before - by_after, here) + by_normal,
            dot(by_after, here_after),
        ]
    )
    along_before = before / np.maximum(length_before, tolerances.TINY)
    along_after = after / np.maximum(length_after, tolerances.TINY)
    root = np.sqrt(np.maximum(0.5 * (length_before + length_after), tolerances.TINY))
    root_by = np.array(
        [
            -dot(along_before, here_before),
            dot(along_before - along_after, here),
            dot(along_after, here_after),
        ]
    ) / (4.0 * root)
    if not nodes.closed:  # no step before the first node and after the last
        ends = np.concatenate([nodes.first, nodes.last])
        angle_by[:, ends] = 0.0
        root_by[0, nodes.first] = root_by[2, nodes.last] = 0.0
    bending = angle / root
    pulled = np.sqrt(np.maximum(tension, tolerances.TINY))
    stretch_by = pulled * root_by
    rising = np.where(nodes.phi_fea > 1.0, weights.feature * nodes.phi_fea * drift, 0.0)
    stretch_by[1] += rising / pulled * root
    bending_by = (angle_by - bending * root_by) / root
    jacobian = np.stack([bending_by, stretch_by], axis=1)
    return np.array([bending, pulled * root]), jacobian, drift


@lru_cache(maxsize=64)
def _folding(n: int, curves: int) -> tuple[IntArray, IntArray]:
    """Storage of cyclic bands, (3, c, n), in one banded matrix of all curves, (5, c n).

    In the order 0, n-1, 1, n-2, …, nodes coupled by the bands are at most four positions apart.

    Returns
    -------
    (n,) int array
        The position of each node in this order.
    (3 c n,) int array
        The index of each entry of the bands in the flattened matrix.
    """
    place = np.empty(n, dtype=np.int64)
    place[: (n + 1) // 2] = 2 * np.arange((n + 1) // 2)
    place[(n + 1) // 2 :] = 2 * np.arange(n // 2)[::-1] + 1
    there = np.stack([np.roll(place, -offset) for offset in range(3)])
    entry = np.abs(place - there) * (curves * n) + np.minimum(place, there)
    return place, (entry[:, None] + n * np.arange(curves)[:, None]).ravel()


def _solved(bands: FloatArray, right: FloatArray, curves: int) -> FloatArray:
    """Solve a positive definite cyclic banded system for each curve."""
    n = len(right) // curves
    place, entry = _folding(n, curves)
    matrix = np.bincount(entry, bands.ravel(), 5 * len(right)).reshape(5, -1)
    in_order = np.empty((curves, n))
    in_order[:, place] = right.reshape(curves, n)
    _, solved, fault = dpbsv(matrix, in_order.ravel(), lower=1, overwrite_ab=1, overwrite_b=1)
    if fault:
        raise linalg.LinAlgError(f"leading minor {fault} of a damped system is not positive")
    return solved.reshape(curves, n)[:, place].ravel()


def _solved_with_pairs(
    bands: FloatArray, pairs: IntArray, entries: FloatArray, right: FloatArray
) -> FloatArray:
    """Solve such a system of one curve, with additional entries for pairs of nodes."""
    n = len(right)
    node = np.arange(n)
    rows = np.concatenate([node, node, pairs[:, 0]])
    columns = np.concatenate([np.roll(node, -1), np.roll(node, -2), pairs[:, 1]])
    beside = np.concatenate([bands[1], bands[2], entries[1]])
    diagonal = bands[0] + np.bincount(pairs.T.ravel(), entries[[0, 2]].ravel(), n)
    values = np.concatenate([diagonal, beside, beside])
    places = np.concatenate([node, rows, columns]), np.concatenate([node, columns, rows])
    matrix = sparse.csc_array((values, places), shape=(n, n))
    symmetric = {"SymmetricMode": True}
    return splu(matrix, permc_spec="MMD_AT_PLUS_A", options=symmetric).solve(right)


def _normal_equations(
    nodes: Nodes, jacobian: FloatArray, residuals: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Bands of JᵀJ, (3, n), and Jᵀr, (n,), where r are two residuals of each node, (2, n)."""
    left, middle, right = jacobian

    def product(one: FloatArray, other: FloatArray) -> FloatArray:
        return (one * other).sum(axis=0)

    shifted_left = nodes.after_each(
        np.array([product(left, each) for each in (left, middle, right, residuals)])
    )
    shifted_right = nodes.before_each(
        np.array([product(right, each) for each in (right, residuals)])
    )
    bands = np.array(
        [
            shifted_right[0] + product(middle, middle) + shifted_left[0],
            product(middle, right) + shifted_left[1],
            shifted_left[2],
        ]
    )
    return bands, shifted_left[3] + product(middle, residuals) + shifted_right[1]


def _product(system: ElasticSystem, move: FloatArray) -> FloatArray:
    """The matrix of a system times moves, shape (n,)."""
    result = system.bands[0] * move
    for offset in (1, 2):
        band = system.bands[offset]
        onward = band * move
        result += band * np.concatenate([move[offset:], move[:offset]])
        result += np.concatenate([onward[-offset:], onward[:-offset]])
    if not len(system.pairs):
        return result
    one, other = system.pairs.T
    own, mixed, others = system.pair_entries
    result += np.bincount(one, own * move[one] + mixed * move[other], len(move))
    result += np.bincount(other, others * move[other] + mixed * move[one], len(move))
    return result
