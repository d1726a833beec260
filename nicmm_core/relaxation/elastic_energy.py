"""The energy of a curve itself: Eq. 6 and 7 where φ is exactly the distance to its zero set.

There |∇φ| = 1, the level-set term vanishes and the integrals over the surface run along the curve:

    E = ∮ κ_g² ds + τ ∮ φ_fea² ds.

With maps τ is λ_fea / λ_smooth, which is `FEATURE_TENSION` here. Without, φ_fea is 1 and the second
term is the length; it keeps far points from being joined by ever larger bows. There τ = (2π / L)²,
with which a circle in the plane neither grows nor shrinks, so that the balance has no length of its
own. Where strands of the curve may not cross, a third term keeps them apart (`strand_contact`).

The unknowns are sideways moves of nodes in their tangent planes. A node's residuals know only its
two neighbours, so that Gauss-Newton's matrix has two bands to each side and a step costs next to
nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from .. import tolerances
from ..array_types import BoolArray, FloatArray, IntArray
from .curve_nodes import CurveSurface, Nodes
from .strand_contact import contact_residuals

DIFFERENCE = 1e-4
"""Move of a node for differences, in mean steps."""

FEATURE_TENSION = 600.0
"""λ_fea / λ_smooth for lengths in square roots of the surface's area.

It sets how tightly the curve may bend to follow a map: about 1/√600, 4 % of that length. The ratio
of the level set's energy, 30, leaves the curve too stiff for what people paint.
"""

CONTACT = 10.0
"""Energy of a curve whose strands all touch, relative to that of the same curve without contact."""


@dataclass(frozen=True)
class Balance:
    """Weights of the terms, which change from step to step but not within one.

    Attributes
    ----------
    tension : float
        τ, in 1/length².
    contact : float
        Weight of a node's contact, in 1/length; 0 where strands may cross.
    """

    tension: float
    contact: float


def balance(surface: CurveSurface, nodes: Nodes, smoothness: float, apart: bool) -> Balance:
    """The weights at a curve; ``apart`` keeps its strands apart."""
    tension = surface.feature_weight
    if surface.feature_map is None:
        tension = float((2.0 * np.pi / nodes.lengths.sum()) ** 2)
    tension /= smoothness
    if not apart:
        return Balance(tension, 0.0)
    energy = elastic_energy(nodes, Balance(tension, 0.0))
    return Balance(tension, CONTACT * energy / len(nodes.positions))


def bending_energy(nodes: Nodes) -> float:
    """∮ κ_g² ds, in 1/length."""
    return float((_residuals(nodes)[0] ** 2).sum())


def feature_energy(nodes: Nodes) -> float:
    """∮ φ_fea² ds, in units of length."""
    return float((_residuals(nodes)[1] ** 2).sum())


def elastic_energy(nodes: Nodes, weights: Balance) -> float:
    """E, with contact where that has a weight."""
    bending, stretch = _residuals(nodes)
    energy = float((bending**2).sum() + weights.tension * (stretch**2).sum())
    if weights.contact:
        energy += weights.contact * float((contact_residuals(nodes).overlap ** 2).sum())
    return energy


@dataclass(frozen=True)
class ElasticSystem:
    """Gauss-Newton's matrix, symmetric with two cyclic bands to each side, and the slope.

    Attributes
    ----------
    bands : (3, n) float array
        Entries (i, i), (i, i + 1) and (i, i + 2) in column i, indices modulo n.
    slope : (n,) float array
        Half the derivative of the energy by each node's sideways move.
    """

    bands: FloatArray
    slope: FloatArray


def elastic_system(surface: CurveSurface, nodes: Nodes, weights: Balance) -> ElasticSystem:
    """Linearise the residuals about a curve."""
    n = len(nodes.positions)
    at_rest = _residuals(nodes)
    # Derivative of residual i by the move of node i - 1, i and i + 1: two (n, 3) arrays.
    jacobians = np.zeros((2, n, 3))
    step = DIFFERENCE * float(nodes.lengths.mean())
    turn, drift = nodes.sideways_derivatives(surface)
    colour = _colours(n)
    for chosen in range(int(colour.max()) + 1):
        change = step * (colour == chosen)
        changed = _residuals(
            Nodes(
                nodes.places,
                nodes.closed,
                nodes.positions + change[:, None] * nodes.sideways,
                nodes.normals + change[:, None] * turn,
                nodes.importance + change * drift,
            )
        )
        for column in range(3):
            rows = np.flatnonzero(np.roll(colour, 1 - column) == chosen)
            for jacobian, before, after in zip(jacobians, at_rest, changed, strict=True):
                jacobian[rows, column] = (after - before)[rows] / step
    bands, slope = np.zeros((3, n)), np.zeros(n)
    for weight, jacobian, residual in zip((1.0, weights.tension), jacobians, at_rest, strict=True):
        bands += weight * _squared(jacobian)
        slope += weight * _transposed(jacobian, residual)
    # Residuals do not have all of the length's second derivative: this is a string's stiffness.
    stiffness = np.zeros(n)
    stiffness[: len(nodes.lengths)] = weights.tension / np.maximum(nodes.lengths, tolerances.TINY)
    stiffness *= nodes.importance**2
    bands[0] += stiffness + np.roll(stiffness, 1)
    # Without an orientation of the surface, neighbours may have opposite moves to one side.
    opposite = (nodes.normals * np.roll(nodes.normals, -1, axis=0)).sum(axis=1) < 0.0
    bands[1] -= np.where(opposite, -stiffness, stiffness)
    if weights.contact:
        contact = contact_residuals(nodes)
        weight = 2.0 * weights.contact  # a move changes what both nodes of a pair have
        np.add.at(bands[0], contact.node, weight * contact.derivative**2)
        np.add.at(slope, contact.node, weight * contact.overlap * contact.derivative)
    return ElasticSystem(bands, slope)


def damped_step(system: ElasticSystem, free: BoolArray, damping: float) -> FloatArray:
    """Sideways moves of the free nodes that lower the linearised energy, shape (n,).

    Parameters
    ----------
    system : ElasticSystem
    free : (n,) bool array
        At least one node.
    damping : float
        Added to the diagonal, relative to its greatest entry.
    """
    n = len(free)
    both = np.stack([free, free & np.roll(free, -1), free & np.roll(free, -2)])
    bands = np.where(both, system.bands, 0.0)
    bands[0] += np.where(free, damping * bands[0].max(), 1.0)
    # Folding the ring flat, 0, n-1, 1, n-2, …, puts neighbours at most four places apart.
    place = np.empty(n, dtype=np.int64)
    place[: (n + 1) // 2] = 2 * np.arange((n + 1) // 2)
    place[(n + 1) // 2 :] = 2 * np.arange(n // 2)[::-1] + 1
    folded = np.zeros((5, n))
    for offset in range(3):
        here, there = place, np.roll(place, -offset)
        np.add.at(folded, (np.abs(here - there), np.minimum(here, there)), bands[offset])
    right = np.zeros(n)
    right[place] = np.where(free, -system.slope, 0.0)
    return linalg.solveh_banded(folded, right, lower=True, check_finite=False)[place]


def _residuals(nodes: Nodes) -> tuple[FloatArray, FloatArray]:
    """κ_g √ds and φ_fea √ds at each node, both (n,); an open curve does not bend at its ends."""
    after = nodes.steps
    before = np.roll(after, 1, axis=0)
    lengths = np.sqrt((after**2).sum(axis=1))
    root = np.sqrt(np.maximum(0.5 * (lengths + np.roll(lengths, 1)), tolerances.TINY))
    sine = (np.cross(before, after) * nodes.normals).sum(axis=1)
    cosine = (before * after).sum(axis=1)
    cosine -= (before * nodes.normals).sum(axis=1) * (after * nodes.normals).sum(axis=1)
    turning = np.arctan2(sine, cosine)
    if not nodes.closed:
        turning[[0, -1]] = 0.0
    return turning / root, nodes.importance * root


def _colours(n: int) -> IntArray:
    """Numbers such that three consecutive nodes of a ring have three of them, shape (n,)."""
    colours = np.arange(n) % 3
    if n % 3:
        colours[-(n % 3) :] = np.arange(3, 3 + n % 3)
    return colours


def _squared(jacobian: FloatArray) -> FloatArray:
    """Bands of JᵀJ, shape (3, n)."""
    left, middle, right = jacobian.T
    after = np.roll(jacobian, -1, axis=0)
    return np.stack(
        [
            np.roll(right, 1) ** 2 + middle**2 + after[:, 0] ** 2,
            middle * right + after[:, 0] * after[:, 1],
            after[:, 0] * after[:, 2],
        ]
    )


def _transposed(jacobian: FloatArray, residual: FloatArray) -> FloatArray:
    """Jᵀ r, shape (n,)."""
    left, middle, right = (jacobian * residual[:, None]).T
    return np.roll(left, -1) + middle + np.roll(right, 1)
