"""Selects the part of a relaxed curve that bends most, and replaces it by another course.

On bodies with limbs, most of the bending of a poor curve is in one or two short parts. A search for
the whole curve finds a good course for all parts at once only by chance. So the worst part is
searched for again, between nodes that stay.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..geometry.array_types import FloatArray, IntArray
from ..geometry.surface_points import joined
from ..relaxation.curve_nodes import CurveSurface
from ..relaxation.discrete_curve import DiscreteCurve
from ..relaxation.elastic_energy import node_bending
from ..relaxation.simple_curve import simple_curve
from ..request import Request

HALF_LENGTH = 0.12
"""Half the length of a part, relative to the length of the curve."""

DIRECTION = 0.02
"""Distance, relative to the length of the curve, from an end of a part to a further node.

The course of the part passes this node as well, which fixes its direction at the end.
"""

HALF_WINDOW = 0.025
"""Half the length over which bending is summed to find the middle of a part."""

LEAST_SHARE = 0.1
"""Share of the bending of the curve in that window below which no other part is worthwhile."""

APART = 0.02
"""Least distance between the middles of two parts, relative to the length of the curve."""


@dataclass(frozen=True)
class BentPart:
    """A part of a curve between two of its nodes.

    Attributes
    ----------
    middle : (3,) float array
        Position of the node in the middle.
    passed : (p,) int array
        Indices of the nodes that its course must pass: one before the part, the first node of the
        part, the control points inside, the last node, and one after it. At an end of an open curve
        there is no node outside.
    first, last : int
        Places of the first and the last node of the part in `passed`.
    length : float
        Length of the curve from the first node in `passed` to the last.
    """

    middle: FloatArray
    passed: IntArray
    first: int
    last: int
    length: float


def bent_part(curve: DiscreteCurve, tried: Sequence[FloatArray]) -> BentPart | None:
    """Select the part of a curve in which it bends most.

    Parameters
    ----------
    curve : DiscreteCurve
    tried : sequence of (3,) float arrays
        Positions near which no part is selected.

    Returns
    -------
    BentPart or None
        None if no part bends strongly, or if it has too few nodes.
    """
    nodes, whole = curve.nodes, curve.length
    bending, steps = node_bending(nodes), nodes.step_lengths
    count = len(steps)
    untried = np.ones(count, dtype=bool)
    for position in tried:
        untried &= np.linalg.norm(nodes.positions - position, axis=1) >= APART * whole
    # Three turns of a closed curve; the middle of a part lies in the second one.
    turns = 3 if curve.closed else 1
    arc = np.cumsum(np.tile(steps, turns)) - np.tile(steps, turns)
    own = np.arange(count) + (count if curve.closed else 0)
    sums = np.append(0.0, np.cumsum(np.tile(bending, turns)))
    low = np.searchsorted(arc, arc[own] - HALF_WINDOW * whole)
    high = np.searchsorted(arc, arc[own] + HALF_WINDOW * whole, side="right")
    in_window = np.where(untried, sums[high] - sums[low], 0.0)
    middle = int(np.argmax(in_window))
    if in_window[middle] <= LEAST_SHARE * bending.sum():
        return None
    outer = HALF_LENGTH + DIRECTION
    offsets = whole * np.array([-outer, -HALF_LENGTH, HALF_LENGTH, outer])
    ends = np.searchsorted(arc, arc[own[middle]] + offsets).clip(0, len(arc) - 1)
    controls = (curve.control_nodes + count * np.arange(turns)[:, None]).ravel()
    inside = controls[(controls > ends[1]) & (controls < ends[2])]
    passed = np.unique(np.concatenate([ends, inside]))
    if ends[1] >= ends[2] or len(passed) > len(np.unique(passed % count)):
        return None
    first, last = np.searchsorted(passed, ends[1:3])
    length = float(arc[passed[-1]] - arc[passed[0]])
    return BentPart(nodes.positions[middle], passed % count, int(first), int(last), length)


def request_for_part(request: Request, curve: DiscreteCurve, part: BentPart) -> Request:
    """The request for other courses of a part, with the tension of the whole curve."""
    return replace(
        request,
        points=curve.nodes.places[part.passed],
        closed=False,
        order="given",
        via_points={},
        smoothness=request.smoothness * (curve.length / part.length) ** 2,
    )


def with_part(
    surface: CurveSurface, curve: DiscreteCurve, part: BentPart, course: DiscreteCurve
) -> DiscreteCurve | None:
    """Replace a part of a curve by another course.

    Parameters
    ----------
    surface : CurveSurface
    curve : DiscreteCurve
    part : BentPart
    course : DiscreteCurve
        An open curve through the nodes that the part must pass.

    Returns
    -------
    DiscreteCurve or None
        A simple curve through the control points in the same order; None if it would cross itself.
    """
    places, count = curve.nodes.places, len(curve.nodes.positions)
    at_passed = course.control_nodes[part.first : part.last + 1]
    passed = part.passed[part.first : part.last + 1]
    inside = np.arange(at_passed[0], at_passed[-1] + 1)
    others = (passed[-1] + np.arange(1, (passed[0] - passed[-1]) % count)) % count
    # The former index of each node; -1 for new nodes.
    former = np.concatenate([np.full(len(inside), -1), others])
    former[at_passed - at_passed[0]] = passed
    # The first node of a curve is a control point.
    order = np.roll(np.arange(len(former)), -int(np.flatnonzero(former == 0)[0]))
    control_nodes = np.flatnonzero(np.isin(former[order], curve.control_nodes))
    return simple_curve(
        surface,
        joined([course.nodes.places[inside], places[others]])[order],
        control_nodes,
        places[curve.control_nodes],
        curve.closed,
    )
