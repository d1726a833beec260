"""Relaxes several curves together, so that their energies can be compared.

Only nodes move; the curves are not traced between them. The steps are those of
`levenberg_marquardt`, with the nodes of all curves in one set of arrays, because the time depends
on the number of array calls rather than on the number of nodes. Damping is separate for each curve,
and so is the decision to accept or reject a step. A curve may cross itself, although the contact
term resists it; `node_traces.crossing_steps` finds where.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, IntArray
from ..geometry.surface_points import SurfacePoints
from ..progress import checkpoint
from .curve_nodes import CurveSurface, Nodes, nodes_at
from .elastic_energy import (
    balance,
    curve_energies,
    damped_step,
    elastic_system,
    energy_scales,
)
from .even_nodes import evened
from .levenberg_marquardt import DAMPING_FACTOR, StepConfig
from .noded_curve import moved_along_conormals
from .strand_contact import close_pairs, contacts_of_pairs


@dataclass(frozen=True)
class TogetherConfig:
    """Settings. Lengths are in mean distances between neighbouring nodes.

    Attributes
    ----------
    iterations : int
        Greatest number of iterations, of one step each.
    longest_move : float
        Trust radius of the linearised energy.
    respacing : int
        Number of iterations from one respacing of the nodes to the next.
    least_decrease : float
        Relative decrease of the energy up to which an iteration counts as quiet, if no node has
        moved by more than half of `longest_move` either.
    quiet : int
        Number of consecutive quiet iterations after which a curve has converged.
    contact : bool
        Whether strands are kept apart.
    """

    iterations: int = 30
    longest_move: float = 1.0
    respacing: int = 3
    least_decrease: float = 1e-3
    quiet: int = 2
    contact: bool = True


def relax_together(
    surface: CurveSurface,
    nodes: Nodes,
    fixed: BoolArray,
    smoothness: float,
    config: TogetherConfig,
) -> Nodes:
    """Relax several curves without tracing them.

    Parameters
    ----------
    surface : CurveSurface
    nodes : Nodes
        c curves with n / c nodes each.
    fixed : (n,) bool array
        Which nodes must not move, such as control points. The first node of each curve must be
        fixed.
    smoothness : float
        Divisor of the tension and of the weight of a map.
    config : TogetherConfig
    """
    size = nodes.per_curve
    steps = StepConfig()
    least = steps.least_damping(size)
    damping = np.full(nodes.curves, least)
    quiet = np.zeros(nodes.curves, dtype=np.int64)
    which = np.arange(nodes.curves)  # curves that have not converged
    faces, barycentric = nodes.places.faces.copy(), nodes.places.barycentric.copy()
    whole = nodes
    for iteration in range(config.iterations):
        checkpoint(iteration / config.iterations)
        if iteration % config.respacing == 0:
            nodes = evened(surface, nodes, fixed)
            pairs = close_pairs(nodes) if config.contact else None
        # Nodes may coincide where a route could not be placed; such a curve does not move.
        with np.errstate(over="ignore", invalid="ignore"):
            weights = balance(surface, nodes, smoothness, apart=config.contact)
            contacts = None if pairs is None else contacts_of_pairs(nodes, pairs)
            before = curve_energies(nodes, weights, contacts)
            scale = energy_scales(nodes, weights, before)
            system = elastic_system(surface, nodes, weights, contacts)
            move = damped_step(system, ~fixed, damping)
        spacing = nodes.by_curve(nodes.step_lengths).sum(axis=1) / size
        farthest = np.abs(nodes.by_curve(move)).max(axis=1) / np.maximum(spacing, tolerances.TINY)
        share = np.minimum(1.0, config.longest_move / np.maximum(farthest, tolerances.TINY))
        moved, _, _ = moved_along_conormals(surface, nodes, move * nodes.spread(share))
        with np.errstate(over="ignore", invalid="ignore"):
            contacts = None if pairs is None else contacts_of_pairs(moved, pairs)
            after = curve_energies(moved, weights, contacts)
        lower = after < before
        nodes = _chosen(nodes, moved, lower)
        damping = np.where(
            lower, np.maximum(damping / DAMPING_FACTOR, least), damping * DAMPING_FACTOR
        )
        decrease = np.where(lower, before - after, 0.0)
        still = (decrease <= config.least_decrease * scale) & (
            share * farthest <= 0.5 * config.longest_move
        )
        quiet = np.where(still, quiet + 1, 0)
        done = (quiet >= config.quiet) | (damping > steps.most_damping)
        if done.any() or iteration == config.iterations - 1:
            place = (which[:, None] * size + np.arange(size)).ravel()
            faces[place], barycentric[place] = nodes.places.faces, nodes.places.barycentric
            if done.all():
                break
            left = np.flatnonzero(~done)
            nodes, fixed = curves_of(nodes, left), nodes.by_curve(fixed)[left].ravel()
            damping, quiet, which = damping[left], quiet[left], which[left]
            if pairs is not None:
                pairs = _renumbered(pairs, left, size)
    return nodes_at(surface, SurfacePoints(faces, barycentric), whole.closed, whole.curves)


def curves_of(nodes: Nodes, which: IntArray) -> Nodes:
    """Some of the curves, by their indices."""
    size = nodes.per_curve
    place = (which[:, None] * size + np.arange(size)).ravel()
    return Nodes(
        nodes.places[place], nodes.closed, nodes.positions.T.take(place, axis=1).T,
        nodes.normals.T.take(place, axis=1).T, nodes.phi_fea.take(place), len(which),
    )  # fmt: skip


def _chosen(one: Nodes, other: Nodes, take: BoolArray) -> Nodes:
    """The curves of `other` where `take`, (c,), is true, and those of `one` elsewhere."""
    if take.all():
        return other
    taken = one.spread(take)
    row = taken[:, None]
    places = SurfacePoints(
        np.where(taken, other.places.faces, one.places.faces),
        np.where(row, other.places.barycentric, one.places.barycentric),
    )
    return Nodes(
        places,
        one.closed,
        np.where(row, other.positions, one.positions),
        np.where(row, other.normals, one.normals),
        np.where(taken, other.phi_fea, one.phi_fea),
        one.curves,
    )


def _renumbered(pairs: IntArray, left: IntArray, size: int) -> IntArray:
    """The pairs that belong to the remaining curves, with the new indices of their nodes."""
    curve = pairs[:, 0] // size
    place = np.searchsorted(left, curve).clip(max=len(left) - 1)
    kept = left[place] == curve
    return (pairs + ((place - curve) * size)[:, None])[kept]
