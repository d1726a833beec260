"""Relax several curves together, to compare them: nodes only, without tracing between them.

The steps are those of `levenberg_marquardt`, with all nodes of all curves in one set of arrays,
since the number of calls and not of nodes decides the time. Each curve has its own damping and
takes or rejects its own steps. A curve may cross itself, although the contact term resists it;
`node_traces.crossing_steps` tells where it does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, IntArray
from ..geometry.surface_points import SurfacePoints
from ..progress import checkpoint
from .curve_nodes import CurveSurface, Nodes, nodes_at
from .elastic_energy import balance, curve_energies, damped_step, elastic_system
from .levenberg_marquardt import DAMPING_FACTOR, StepConfig
from .noded_curve import moved_along_conormals, shifted
from .strand_contact import close_pairs, contacts_of_pairs


@dataclass(frozen=True)
class TogetherConfig:
    """Settings; lengths are in mean distances between neighbouring nodes.

    Attributes
    ----------
    iterations : int
        Most iterations, of one step each.
    longest_move : float
        Trust radius of the linearised energy.
    respacing : int
        Iterations from one respacing of the nodes to the next.
    least_decrease : float
        Relative decrease of the energy below which an iteration counts as quiet.
    quiet : int
        Quiet iterations after which a curve has converged.
    contact : bool
        Whether strands are kept apart.
    """

    iterations: int = 30
    longest_move: float = 1.0
    respacing: int = 3
    least_decrease: float = 1e-3
    quiet: int = 2
    contact: bool = True


NODES_PER_RADIAN = 1.0
"""Additional nodes where the normals turn by one radian, as round the edge of a thin part."""

SHORT_MOVE = 1e-3
"""Distance, in mean distances between nodes, that is too short for respacing."""


def relax_together(
    surface: CurveSurface,
    nodes: Nodes,
    fixed: BoolArray,
    smoothness: float,
    config: TogetherConfig,
) -> Nodes:
    """Relax some curves.

    Parameters
    ----------
    surface : CurveSurface
    nodes : Nodes
        c curves of n / c nodes.
    fixed : (n,) bool array
        Nodes that stay, as control points do; the first node of each curve is one of them.
    smoothness : float
        Divides the tension.
    config : TogetherConfig
    """
    size = len(nodes.positions) // nodes.curves
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
            nodes = _respaced(surface, nodes, fixed)
            pairs = close_pairs(nodes) if config.contact else None
        # Nodes may coincide where a route could not be laid; that curve then stays as it is.
        with np.errstate(over="ignore", invalid="ignore"):
            weights = balance(surface, nodes, smoothness, apart=config.contact)
            contacts = None if pairs is None else contacts_of_pairs(nodes, pairs)
            before = curve_energies(nodes, weights, contacts)
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
        fall = np.where(lower, before - after, 0.0)
        still = (fall <= config.least_decrease * before) & (
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
    """Some of the curves."""
    size = len(nodes.positions) // nodes.curves
    place = (which[:, None] * size + np.arange(size)).ravel()
    return Nodes(
        nodes.places[place], nodes.closed, nodes.positions.T.take(place, axis=1).T,
        nodes.normals.T.take(place, axis=1).T, nodes.phi_fea.take(place), len(which),
    )  # fmt: skip


def _chosen(one: Nodes, other: Nodes, take: BoolArray) -> Nodes:
    """The curves of the other nodes where they are taken, (c,)."""
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
    """Pairs of nodes of the curves that are left, by their new numbers."""
    curve = pairs[:, 0] // size
    place = np.searchsorted(left, curve).clip(max=len(left) - 1)
    kept = left[place] == curve
    return (pairs + ((place - curve) * size)[:, None])[kept]


def _respaced(surface: CurveSurface, nodes: Nodes, fixed: BoolArray) -> Nodes:
    """Nodes moved along their curves, so that they are evenly spaced between fixed ones.

    They are closer together where the normals turn (`NODES_PER_RADIAN`).
    """
    size = len(nodes.positions) // nodes.curves
    mean = nodes.by_curve(nodes.step_lengths).mean(axis=1)
    turning = np.linalg.norm(nodes.after_each(nodes.normals.T).T - nodes.normals, axis=1)
    turning[nodes.step_lengths == 0.0] = 0.0  # at the end of an open curve
    lengths = nodes.step_lengths + NODES_PER_RADIAN * nodes.spread(mean) * turning
    lengths = nodes.by_curve(lengths)
    # Weighted arc length over all curves, each with its first node once more at its end.
    last = np.where(nodes.closed, nodes.first, nodes.last)
    around = np.append(
        np.arange(len(nodes.positions)).reshape(nodes.curves, size), last[:, None], 1
    )
    ends = np.append(nodes.by_curve(fixed), np.ones((nodes.curves, 1), dtype=bool), axis=1)
    begins = np.cumsum(lengths.sum(axis=1)) - lengths.sum(axis=1)
    arc = np.cumsum(np.append(np.zeros((nodes.curves, 1)), lengths, axis=1), axis=1)
    arc = (arc + begins[:, None]).ravel()
    place = np.arange(len(arc))
    along = np.interp(place, place[ends.ravel()], arc[ends.ravel()])
    along = along.reshape(nodes.curves, size + 1)[:, :-1].ravel()
    path = nodes.positions[around.ravel()]
    target = np.stack([np.interp(along, arc, axis) for axis in path.T], axis=1)
    move = target - nodes.positions
    move -= (move * nodes.normals).sum(axis=1, keepdims=True) * nodes.normals
    length = np.linalg.norm(move, axis=1)
    direction = move / np.maximum(length, tolerances.TINY)[:, None]
    length[fixed | (length < SHORT_MOVE * nodes.spread(mean))] = 0.0
    return shifted(surface, nodes, direction, length)[0]
