"""Cuts a triangle along segments: a constrained Delaunay triangulation.

Points are given by barycentric coordinates, so points on a side of the triangle share an exact zero
and are exactly collinear. Signs of areas are computed exactly; only the choice among valid
triangulations depends on rounding.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from fractions import Fraction

from ..geometry.array_types import FloatArray

SURE = 1e-13
"""Magnitude of a determinant of barycentric coordinates above which rounding keeps its sign."""

ANGLE_MARGIN = 1e-9
"""Excess over π of the sum of the angles opposite an edge above which the edge is flipped."""

Weights = tuple[float, float, float]
Triangle = tuple[int, int, int]


class ConstraintError(Exception):
    """Segments cross, or a segment passes through a point; `points` lists the points involved."""

    def __init__(self, points: tuple[int, ...]) -> None:
        super().__init__(points)
        self.points = points


def orientation(a: Weights, b: Weights, c: Weights) -> int:
    """1 if a, b, c turn left, -1 if they turn right, 0 if they are collinear; always exact."""
    value = _determinant(*a, *b, *c)
    if abs(value) <= SURE:
        exact = _determinant(*map(Fraction, (*a, *b, *c)))
        return (exact > 0) - (exact < 0)
    return 1 if value > 0.0 else -1


def _determinant(a, b, c, d, e, f, g, h, i):  # type: ignore[no-untyped-def]
    # In this form a column of zeros gives an exact zero.
    return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)


class FaceTriangulation:
    """Triangulation of one face, built point by point and segment by segment.

    Parameters
    ----------
    weights : list of (float, float, float)
        Barycentric coordinates of the points; the first three points are the corners.
    flat : (n, 2) float array
        Positions of the points in the plane of the face, from which angles are computed.
    """

    def __init__(self, weights: FloatArray | list[Weights], flat: FloatArray) -> None:
        self.weights = [(float(a), float(b), float(c)) for a, b, c in weights]
        self.flat = [(float(x), float(y)) for x, y in flat]
        self._third: dict[tuple[int, int], int] = {}
        self._fixed: set[tuple[int, int]] = set()
        self._add(0, 1, 2)

    @property
    def triangles(self) -> list[Triangle]:
        """Each triangle once, with the orientation of the face."""
        return [(a, b, c) for (a, b), c in self._third.items() if a < b and a < c]

    def add_on_side(self, corner: int, points: list[int]) -> None:
        """Insert points, in order, on the side that starts at a corner."""
        before, end = corner, (corner + 1) % 3
        for point in points:
            third = self._third[before, end]
            self._remove(before, end, third)
            self._add(before, point, third)
            self._add(point, end, third)
            before = point

    def add_inside(self, point: int) -> None:
        """Insert a point strictly inside the face."""
        for a, b, c in self.triangles:
            turns = [self._turn(*pair, point) for pair in ((a, b), (b, c), (c, a))]
            if min(turns) >= 0:
                break
        else:
            raise ConstraintError((point,))
        on = [pair for pair, turn in zip(((a, b), (b, c), (c, a)), turns, strict=True) if not turn]
        if len(on) > 1:
            (same,) = set(on[0]) & set(on[1])
            raise ConstraintError((point, same))
        self._remove(a, b, c)
        for start, end in ((a, b), (b, c), (c, a)):
            if (start, end) not in on:
                self._add(start, end, point)
        for start, end in on:
            beyond = self._third.get((end, start))
            if beyond is None:
                raise ConstraintError((point, start, end))
            self._remove(end, start, beyond)
            self._add(beyond, end, point)
            self._add(start, beyond, point)

    def add_segment(self, start: int, end: int) -> None:
        """Make a segment an edge of the triangulation."""
        crossed = list(self._edges_between(start, end))
        while crossed:
            a, b = crossed.pop(0)
            c, d = self._third[a, b], self._third[b, a]
            if not self._is_convex(a, b, c, d):
                crossed.append((a, b))
                continue
            self._flip(a, b)
            if self._turn(start, end, c) * self._turn(start, end, d) < 0:
                crossed.append((c, d))
        self._fixed |= {(start, end), (end, start)}

    def improve(self) -> None:
        """Flip edges that are not segments until the triangulation is Delaunay."""
        waiting = list(self._third)
        # Lawson's flips end after O(n²) steps; the cap ends cycles caused by rounding.
        for _ in range(8 * len(self.weights) ** 2 + len(waiting)):
            if not waiting:
                return
            a, b = waiting.pop()
            if (a, b) in self._fixed or (a, b) not in self._third or (b, a) not in self._third:
                continue
            c, d = self._third[a, b], self._third[b, a]
            opposite = self._angle(c, a, b) + self._angle(d, b, a)
            if opposite > math.pi + ANGLE_MARGIN and self._is_convex(a, b, c, d):
                self._flip(a, b)
                waiting += [(a, d), (d, b), (b, c), (c, a)]

    def _edges_between(self, start: int, end: int) -> Iterator[tuple[int, int]]:
        """Edges that a segment crosses, in order, each with its end on the right first."""
        if (start, end) in self._third or (end, start) in self._third:
            return
        for (corner, right), left in list(self._third.items()):
            if corner != start:
                continue
            turns = [self._turn(start, end, side) for side in (right, left)]
            for side, turn in zip((right, left), turns, strict=True):
                if turn == 0 and self._is_ahead(start, side, end):
                    raise ConstraintError((start, end, side))
            if turns[0] < 0 < turns[1]:
                break
        else:
            raise ConstraintError((start, end))
        while True:
            if (right, left) in self._fixed or (left, right) not in self._third:
                raise ConstraintError((start, end, right, left))
            yield right, left
            beyond = self._third[left, right]
            if beyond == end:
                return
            turn = self._turn(start, end, beyond)
            if turn == 0:
                raise ConstraintError((start, end, beyond))
            right, left = (right, beyond) if turn > 0 else (beyond, left)

    def _is_ahead(self, start: int, between: int, end: int) -> bool:
        """Whether a point collinear with a segment lies on the ray from its start to its end.

        The coordinate that changes most along the segment decides.
        """
        a, b, c = (self.weights[point] for point in (start, between, end))
        axis = max(range(3), key=lambda k: abs(c[k] - a[k]))
        return (b[axis] - a[axis]) * (c[axis] - a[axis]) > 0.0

    def _is_convex(self, a: int, b: int, c: int, d: int) -> bool:
        """Whether edge ab can be flipped to cd, where c and d are the corners opposite to it."""
        return self._turn(a, d, c) > 0 and self._turn(d, b, c) > 0

    def _turn(self, a: int, b: int, c: int) -> int:
        return orientation(self.weights[a], self.weights[b], self.weights[c])

    def _angle(self, apex: int, a: int, b: int) -> float:
        x, y = self.flat[apex]
        p, q = self.flat[a][0] - x, self.flat[a][1] - y
        r, s = self.flat[b][0] - x, self.flat[b][1] - y
        return math.atan2(abs(p * s - q * r), p * r + q * s)

    def _flip(self, a: int, b: int) -> None:
        c, d = self._third[a, b], self._third[b, a]
        self._remove(a, b, c)
        self._remove(b, a, d)
        self._add(a, d, c)
        self._add(d, b, c)

    def _add(self, a: int, b: int, c: int) -> None:
        self._third[a, b], self._third[b, c], self._third[c, a] = c, a, b

    def _remove(self, a: int, b: int, c: int) -> None:
        del self._third[a, b], self._third[b, c], self._third[c, a]
