"""Selects parts of a relaxed curve that bend most, and replaces them by other courses.

On bodies with limbs, most of the bending of a poor curve is in one or two short parts, or the curve
passes a control point in a poor direction. A search for the whole curve finds a good course for all
parts at once only by chance. So single parts are searched for again, between nodes that stay.
"""

from __future__ import annotations

from collections.abc import Iterator
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
"""Half the length of a part around a bend, relative to the length of the curve."""

DIRECTION = 0.02
"""Distance, relative to the length of the curve, from an end of a part to a further node.

The course of the part passes this node as well, which fixes its direction at the end.
"""

HALF_WINDOW = 0.025
"""Half the length over which bending is summed to find a bend."""

LEAST_SHARE = 0.1
"""Share of the bending of the curve in that window below which there is no further bend."""

APART = 0.02
"""Least distance between two bends, relative to the length of the curve."""


@dataclass(frozen=True)
class BentPart:
    """A part of a curve between two of its nodes.

    Attributes
    ----------
    passed : (p,) int array
        Indices of the nodes that its course must pass: one before the part, the first node of the
        part, the control points inside, the last node, and one after it. At an end of an open curve
        there is no node outside.
    first, last : int
        Places of the first and the last node of the part in `passed`.
    length : float
        Length of the curve from the first node in `passed` to the last.
    """

    passed: IntArray
    first: int
    last: int
    length: float

    def positions(self, curve: DiscreteCurve) -> FloatArray:
        """Positions of the nodes of the curve from the first node in `passed` to the last."""
        count = len(curve.nodes.positions)
        first, last = self.passed[0], self.passed[-1]
        among = (first + np.arange((last - first) % count + 1)) % count
        result: FloatArray = curve.nodes.positions[among]
        return result


def bent_parts(curve: DiscreteCurve) -> Iterator[BentPart]:
    """Yield the parts of a curve that bend most.

    They are the parts around bends, then the two legs at each control point, which hardly ever bend
    less in another way.

    Parameters
    ----------
    curve : DiscreteCurve
    """
    turned = _Turned(curve)
    yield from _around_bends(turned)
    yield from _legs_at_points(turned)


class _Turned:
    """Three turns of a closed curve, or an open curve, with its bending along the arc length.

    Attributes
    ----------
    curve : DiscreteCurve
    count : int
        Number n of nodes of the curve.
    own : (n,) int array
        Indices of the nodes of the middle turn.
    arc : (m,) float array
        Arc length of each of the m nodes of all turns.
    bending : (m + 1,) float array
        Bending of all nodes before each node, and of all.
    controls : (k,) int array
        Indices of the control points, of all turns.
    """

    def __init__(self, curve: DiscreteCurve) -> None:
        turns = 3 if curve.closed else 1
        self.curve, self.count = curve, len(curve.nodes.step_lengths)
        steps = np.tile(curve.nodes.step_lengths, turns)
        self.arc = np.cumsum(steps) - steps
        self.bending = np.append(0.0, np.cumsum(np.tile(node_bending(curve.nodes), turns)))
        self.own = np.arange(self.count) + (self.count if curve.closed else 0)
        shifts = self.count * np.arange(turns)[:, None]
        self.controls = (curve.control_nodes + shifts).ravel()

    def part(self, low: int, high: int) -> BentPart | None:
        """The part between two nodes; None if it has too few nodes, or the rest of the curve."""
        aside = DIRECTION * self.curve.length
        outside = np.searchsorted(self.arc, [self.arc[low] - aside, self.arc[high] + aside])
        before, after = outside.clip(0, len(self.arc) - 1).tolist()
        inside = self.controls[(self.controls > low) & (self.controls < high)]
        passed = np.unique(np.concatenate([[before, low, high, after], inside]))
        if low >= high or len(passed) > len(np.unique(passed % self.count)):
            return None
        first, last = np.searchsorted(passed, [low, high]).tolist()
        length = float(self.arc[passed[-1]] - self.arc[passed[0]])
        return BentPart(passed % self.count, first, last, length)


def _around_bends(turned: _Turned) -> Iterator[BentPart]:
    """The parts around the sharpest bends."""
    curve, arc, own = turned.curve, turned.arc, turned.own
    whole, positions = curve.length, curve.nodes.positions
    low = np.searchsorted(arc, arc[own] - HALF_WINDOW * whole)
    high = np.searchsorted(arc, arc[own] + HALF_WINDOW * whole, side="right")
    in_window = turned.bending[high] - turned.bending[low]
    least = LEAST_SHARE * (turned.bending[own[-1] + 1] - turned.bending[own[0]])
    while in_window.max() > least:
        middle = int(np.argmax(in_window))
        ends = arc[own[middle]] + whole * np.array([-HALF_LENGTH, HALF_LENGTH])
        part = turned.part(*np.searchsorted(arc, ends).clip(0, len(arc) - 1).tolist())
        if part is None:
            return
        yield part
        in_window[np.linalg.norm(positions - positions[middle], axis=1) < APART * whole] = 0.0


def _legs_at_points(turned: _Turned) -> Iterator[BentPart]:
    """The two legs at each control point, by descending bending; not at an end of the curve."""
    controls = turned.controls
    at = np.flatnonzero((controls >= turned.own[0]) & (controls <= turned.own[-1]))
    at = at[(at > 0) & (at < len(controls) - 1)]
    low, high = controls[at - 1], controls[at + 1]
    descending = np.argsort(turned.bending[low] - turned.bending[high], kind="stable")
    for each in descending.tolist():
        part = turned.part(int(low[each]), int(high[each]))
        if part is not None:
            yield part


def request_for_part(request: Request, curve: DiscreteCurve, part: BentPart) -> Request:
    """The request for other courses of a part, with the tension of the whole curve."""
    return replace(
        request,
        points=curve.nodes.places[part.passed],
        closed=False,
        order="given",
        corners=np.flatnonzero(np.isin(part.passed, curve.corner_nodes)),
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
        corners=np.isin(curve.control_nodes, curve.corner_nodes),
    )
