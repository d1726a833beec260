# SPDX-License-Identifier: GPL-3.0-or-later
"""The via points of a curve: they select its course, and each belongs to a leg of the curve.

A leg runs from a control point to the next one, and has the index of the control point at which it
begins. On an open curve no leg begins at the last control point.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...nicmm_core.options import FEWEST_CLOSED
from .point_lists import with_point

if TYPE_CHECKING:
    from ...nicmm_core import SurfacePoints


@dataclass(frozen=True)
class ViaPoints:
    """Via points in the order in which the curve visits them.

    Attributes
    ----------
    legs : (m,) int array
        The leg of each via point, ascending.
    points : SurfacePoints of the core
        The m via points.
    """

    legs: np.ndarray
    points: SurfacePoints

    def __len__(self) -> int:
        return len(self.legs)

    def by_leg(self) -> dict[int, SurfacePoints]:
        """The via points as the argument `via_points` of the core."""
        return {int(leg): self.points[self.legs == leg] for leg in np.unique(self.legs)}

    def fitting(self, count: int, closed: bool) -> ViaPoints:
        """Those whose leg exists on a curve through `count` points."""
        return self._subset(np.flatnonzero(self.legs < number_of_legs(count, closed)))

    def without_leg(self, leg: int) -> ViaPoints:
        """Without those of one leg."""
        return self._subset(np.flatnonzero(self.legs != leg))

    def inserted(self, number: int, leg: int, place: SurfacePoints) -> ViaPoints:
        """With another via point, which gets an index among them if its leg allows that."""
        legs = np.insert(self.legs, number, leg)
        return sorted_by_leg(legs, with_point(self.points, number, place))

    def moved(self, number: int, place: SurfacePoints) -> ViaPoints:
        """With one of them at another place."""
        return ViaPoints(self.legs, with_point(self.points, number, place, replaced=True))

    def without(self, number: int) -> ViaPoints:
        """Without one of them."""
        return self._subset(np.delete(np.arange(len(self)), number))

    def after_insertion(
        self, number: int, count: int, closed: bool, is_behind: np.ndarray
    ) -> ViaPoints:
        """Via points on the new legs after a control point has been inserted at an index.

        Parameters
        ----------
        number : int
            Index of the new control point.
        count : int
            Number of control points before.
        closed : bool
            Whether the curve was closed.
        is_behind : (m,) bool array
            Which via points are behind the new point, if they are on the leg that it divides.
        """
        divided = self.legs == leg_before(number, count, closed)
        legs = self.legs + (self.legs >= number)
        return sorted_by_leg(np.where(divided & is_behind, number, legs), self.points)

    def after_removal(self, number: int, count: int, closed: bool) -> ViaPoints:
        """Via points on the new legs after one of `count` control points has been removed.

        The two legs at the point become one. At the end of an open curve, its leg is removed.
        """
        legs: np.ndarray = self.legs - (self.legs >= number)
        if closed and count >= FEWEST_CLOSED:
            # Those of the leg that began at point 0 come last on the leg that both legs become.
            order = np.argsort(legs < 0, kind="stable")
            return sorted_by_leg(legs[order] % (count - 1), self.points[order])
        kept = np.flatnonzero((legs >= 0) & (legs < count - 2))
        return ViaPoints(legs[kept], self.points[kept])

    def _subset(self, index: np.ndarray) -> ViaPoints:
        return ViaPoints(self.legs[index], self.points[index])


def sorted_by_leg(legs: np.ndarray, points: SurfacePoints) -> ViaPoints:
    """Via points on legs in any order; those of one leg keep their order."""
    order = np.argsort(legs, kind="stable")
    return ViaPoints(legs[order], points[order])


def no_via_points() -> ViaPoints:
    """No via points."""
    from ... import nicmm_core as nicmm

    empty = np.zeros(0, dtype=np.int64)
    return ViaPoints(empty, nicmm.SurfacePoints(empty, np.zeros((0, 3))))


def number_of_legs(count: int, closed: bool) -> int:
    """The number of legs of a curve through points; with fewer than three it is always open."""
    return count if closed and count >= FEWEST_CLOSED else max(count - 1, 0)


def leg_before(number: int, count: int, closed: bool) -> int:
    """The leg that a control point divides which is inserted at an index; -1 if it divides none."""
    if closed and count >= FEWEST_CLOSED:
        return (number - 1) % count
    return number - 1 if 0 < number < count else -1
