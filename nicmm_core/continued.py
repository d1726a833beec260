"""Chooses among the curves to which a start leads when control points have come or gone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from .errors import CurveError
from .relaxation.curve_energies import energies_of, scaled_bending
from .relaxation.discrete_curve import DiscreteCurve
from .relaxation.relaxing import Relaxed
from .request import Request
from .start import WITHOUT_START
from .start_search import InitialCurve

GAIN = 1.1
"""Factor by which the energy must be lower for each further part of the start that is given up."""

FURTHER_BENDING = 20.0
"""Increase of L ∮ κ_g² ds above which a curve may make a detour, half the value of a circle."""

WORST = 10.0
"""Factor of that bound above which a curve certainly makes a detour."""

UNEVEN = 8.0
"""Increase of L ∮ κ_g² ds above which a curve has become uneven, a fifth of the value of a circle.

Beside a bent line at the clearance of an avoided curve, where nodes hardly move, a curve may remain
uneven; then a new curve is fairer.
"""


class ContinuedCurve(NamedTuple):
    """A curve to which a start has led.

    Attributes
    ----------
    start : InitialCurve
        The start, fitted to the control points.
    relaxed : Relaxed
    given_up : int
        How much of the start has been given up: 0 if it has only been moved, 1 if the new legs have
        other courses, 2 if the neighbouring legs may have other courses as well.
    """

    start: InitialCurve
    relaxed: Relaxed
    given_up: int = 0


def has_detour(curve: DiscreteCurve, found: Sequence[ContinuedCurve], factor: float = 1.0) -> bool:
    """Whether all curves to which a start has led bend far more than it; True without any."""
    bending = (scaled_bending(each.relaxed.discrete_curve) for each in found)
    return min(bending, default=math.inf) > factor * (scaled_bending(curve) + FURTHER_BENDING)


def chosen(
    request: Request, curve: DiscreteCurve, found: Sequence[ContinuedCurve]
) -> ContinuedCurve:
    """The curve of least energy, unless one that gives up less of the start is almost as fair.

    Raises
    ------
    CurveError
        If all of them make a detour.
    """
    if has_detour(curve, found, WORST):
        raise CurveError(
            f"start would make a detour through the added control_points{WITHOUT_START}"
        )
    curves = [each.relaxed.discrete_curve for each in found]
    energies = energies_of(found[0].start.surface, curves, request.smoothness)
    weighted = [energy * GAIN**each.given_up for energy, each in zip(energies, found, strict=True)]
    return found[weighted.index(min(weighted))]


def is_uneven(before: DiscreteCurve, after: DiscreteCurve) -> bool:
    """Whether a curve bends far more than the one from which it was continued."""
    return scaled_bending(after) - scaled_bending(before) > UNEVEN
