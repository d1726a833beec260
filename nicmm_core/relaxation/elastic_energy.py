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

from dataclasses import dataclass, field

import nicmm_kernels
import numpy as np

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
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

    Attributes
    ----------
    tension : float
        τ, in 1/length².
    contact : float
        Weight of the contacts of a node, in 1/length; 0 where strands may cross.
    feature : float
        τ_fea, in 1/length²; 0 without a map.
    held : (n,) float array or None
        ds at each node, held constant in the term of lanes; None without a map.
    """

    tension: float
    contact: float
    feature: float = 0.0
    held: FloatArray | None = None

    @property
    def for_kernels(self) -> nicmm_kernels.Weights:
        """The weights as compiled kernels read them."""
        return nicmm_kernels.Weights(self.tension, self.contact, self.feature, self.held)


def energy_rules(
    smoothness: float, apart: bool, tautness: float = 1.0
) -> nicmm_kernels.EnergyRules:
    """How the terms are balanced; see `balance`."""
    return nicmm_kernels.EnergyRules(smoothness, tautness, OVER_TENSION, CONTACT if apart else 0.0)


def balance(
    surface: CurveSurface, nodes: Nodes, smoothness: float, apart: bool, tension_factor: float = 1.0
) -> Balance:
    """Compute the weights of the energy terms for a curve.

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
    rules = energy_rules(smoothness, apart, tension_factor)
    return Balance(*nicmm_kernels.balance(surface.for_kernels, nodes.for_kernels, rules))


def bending_energy(nodes: Nodes) -> float:
    """∮ κ_g² ds of one curve, in 1/length."""
    return float(curve_bending(nodes)[0])


def node_bending(nodes: Nodes) -> FloatArray:
    """κ_g² ds at each node, (n,); zero at the ends of open curves."""
    return nodes.angles**2 / nodes.ds


def curve_bending(nodes: Nodes) -> FloatArray:
    """∮ κ_g² ds of each curve, (c,), in 1/length."""
    return nodes.by_curve(node_bending(nodes)).sum(axis=1)


def feature_energy(nodes: Nodes) -> float:
    """∮ φ_fea² ds of one curve, in units of length."""
    return float((nodes.phi_fea**2 * nodes.ds).sum())


def elastic_energy(nodes: Nodes, weights: Balance, contacts: Contacts | None = None) -> float:
    """E of one curve, with the contact term if its weight is not zero.

    Contacts are computed unless they are given.
    """
    found = _contacts(nodes, weights, contacts)
    return nicmm_kernels.elastic_energy(nodes.for_kernels, weights.for_kernels, found)


def _contacts(nodes: Nodes, weights: Balance, given: Contacts | None) -> Contacts | None:
    """The contacts of a curve; None if they have no weight."""
    if weights.contact == 0.0:
        return None
    return contacts_between(nodes) if given is None else given


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


def energy_scale(nodes: Nodes, weights: Balance, energy: float) -> float:
    """A positive value that decreases of the energy of a curve are compared with.

    It is the energy itself unless there is a map: the term of a lane is negative. Then it is the
    energy without maps and contact.
    """
    if weights.held is None:
        return energy
    return elastic_energy(nodes, Balance(weights.tension, 0.0))


def shortest_step(surface: CurveSurface) -> float:
    """Least length of a step by which the tension is divided, in mesh units."""
    return tolerances.SAME_POSITION * surface.mesh.diagonal


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
    """

    bands: FloatArray
    slope: FloatArray
    pairs: IntArray = field(default_factory=_no_pairs)
    pair_entries: FloatArray = field(default_factory=_no_entries)


def elastic_system(
    surface: CurveSurface, nodes: Nodes, weights: Balance, contacts: Contacts | None = None
) -> ElasticSystem:
    """Assemble the Gauss–Newton system; the residuals are the square roots of the energy's terms.

    Contacts are computed unless they are given.
    """
    found = _contacts(nodes, weights, contacts)
    bands, slope, entries = nicmm_kernels.elastic_system(
        surface.for_kernels, nodes.for_kernels, weights.for_kernels, shortest_step(surface), found
    )
    return ElasticSystem(bands, slope, _no_pairs() if found is None else found.pairs, entries)


def damped_step(system: ElasticSystem, free: BoolArray, damping: float) -> FloatArray:
    """Moves of the free nodes along conormals that lower the linearised energy, shape (n,).

    A curve does not move if its linearisation is zero or not finite, as where nodes coincide.

    Parameters
    ----------
    system : ElasticSystem
    free : (n,) bool array
        Which nodes may move; at least one.
    damping : float
        It is added to the diagonal of the matrix, relative to the greatest diagonal entry of a free
        node.
    """
    return nicmm_kernels.damped_step(
        system.bands, system.slope, system.pairs, system.pair_entries, ~free, damping
    )


def predicted_decrease(system: ElasticSystem, move: FloatArray) -> float:
    """Decrease of the linearised energy by given moves along the conormals, (n,)."""
    return nicmm_kernels.predicted_decrease(
        system.bands, system.slope, system.pairs, system.pair_entries, move
    )
