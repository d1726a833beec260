"""The energy of a curve as the formula says, and moves of its nodes, to check the kernels with."""

from __future__ import annotations

from typing import NamedTuple

import nicmm_kernels
import numpy as np

from nicmm_core.geometry.array_types import FloatArray, IntArray
from nicmm_core.relaxation.curve_nodes import CurveSurface, Nodes
from nicmm_core.relaxation.discrete_curve import shifted
from nicmm_core.relaxation.rules import CLEARANCE, DIFFERENT_STRANDS, SAME_SIDE, relaxation_rules


class Weights(NamedTuple):
    """Weights of the terms, as `nicmm_kernels.Linearised` has them."""

    tension: float
    contact: float = 0.0
    feature: float = 0.0
    frozen_ds: FloatArray | None = None
    normal_bending: float = 0.0


def energy(nodes: Nodes, weights: Weights | nicmm_kernels.Linearised) -> float:
    """∮ (κ_g² + w κ_n²) ds + τ ∮ ds + τ_fea ∮ (φ_fea² - 1) ds, and contact; ds held in lanes."""
    excess, ds = nodes.phi_fea**2 - 1.0, nodes.ds
    total = nodes.angles**2 / ds + (weights.tension + weights.feature * excess.clip(0.0)) * ds
    if weights.frozen_ds is not None:
        total += weights.feature * excess.clip(None, 0.0) * weights.frozen_ds
    total[nodes.with_step] += weights.normal_bending * normal_bending(nodes)
    overlap = 1.0 - contacts(nodes)[1] / (CLEARANCE * nodes.lengths.mean())
    return float(total.sum() + 2.0 * weights.contact * (overlap**2).sum())


def normal_bending(nodes: Nodes) -> FloatArray:
    """κ_n² ds along each step, from the change of the normal in the direction of the step."""
    following = nodes.following[nodes.with_step]
    tangents = nodes.steps[nodes.with_step] / nodes.lengths[:, None]
    change = nodes.normals[following] - nodes.normals[nodes.with_step]
    result: FloatArray = ((change * tangents).sum(axis=1) / nodes.lengths) ** 2 * nodes.lengths
    return result


def contacts(nodes: Nodes) -> tuple[IntArray, FloatArray]:
    """Pairs of nodes in contact, (p, 2), and their distances, (p,), by comparing all pairs."""
    clearance = CLEARANCE * nodes.lengths.mean()
    arc = np.concatenate([[0.0], np.cumsum(nodes.step_lengths)])
    one, other = np.triu_indices(len(nodes.positions), 1)
    distance = np.linalg.norm(nodes.positions[one] - nodes.positions[other], axis=1)
    along = arc[other] - arc[one]
    if nodes.closed:
        along = np.minimum(along, arc[-1] - along)
    same_side = (nodes.normals[one] * nodes.normals[other]).sum(axis=1) > SAME_SIDE
    close = (distance < clearance) & (along > DIFFERENT_STRANDS * clearance) & same_side
    return np.stack([one, other], axis=1)[close], distance[close]


def linearised(
    surface: CurveSurface,
    nodes: Nodes,
    smoothness: float = 1.0,
    contact: bool = False,
    tautness: float = 1.0,
) -> nicmm_kernels.Linearised:
    """Weights, energy and Gauss–Newton system of a curve, by the kernels."""
    rules = relaxation_rules(
        surface, smoothness, len(nodes.positions), 1.0, contact, tautness, single=True
    )
    return nicmm_kernels.Linearised(surface.for_kernels, nodes.for_kernels, rules)


def moved_along_conormals(surface: CurveSurface, nodes: Nodes, step: FloatArray) -> Nodes:
    """Nodes moved along their conormals by signed lengths, (n,)."""
    return shifted(surface, nodes, nodes.conormals * np.sign(step)[:, None], np.abs(step))[0]
