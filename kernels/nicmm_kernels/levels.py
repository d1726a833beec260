# SPDX-License-Identifier: GPL-3.0-or-later
"""Nodes on polylines, and the relaxation of a curve that is traced over the surface."""

from __future__ import annotations

import ctypes
import enum
from typing import Any, NamedTuple

import numpy as np

from . import library, steps
from .library import (
    BOOL,
    COUNT,
    FLOAT,
    INT,
    NUMBER,
    POINTER,
    BoolArray,
    FloatArray,
    IntArray,
    Kernel,
    address,
    optional_address,
    rows,
)
from .nodes import SurfaceArrays, SurfacePointers
from .steps import RelaxationRules
from .traces import PointList


class LevelOutcome(enum.IntEnum):
    """What follows after an iteration."""

    GOES_ON = 0
    CONVERGED = 1
    LIMITED = 2
    """There were no iterations or no work left."""
    STALLED = 3
    """The energy has not fallen below the least one for some iterations."""
    LOST = 4
    """A trace has failed."""


class PlacementRules(ctypes.Structure):
    """How nodes are placed on a polyline.

    Parameters
    ----------
    least_inside : float
        Least barycentric coordinate of a point strictly inside its face.
    same_place : float
        Distance within which a node replaces a point of the polyline, relative to the length of the
        curve.
    reach : float
        Length of curve on either side over which its direction is measured at folds, in mesh units.
    shortest_turn : float
        Upper limit of that, relative to the length of the curve.
    fewest_of_leg : int
        Least number of nodes on a leg, including the control point at its start.
    """

    _fields_ = [
        ("least_inside", NUMBER),
        ("same_place", NUMBER),
        ("reach", NUMBER),
        ("shortest_turn", NUMBER),
        ("fewest_of_leg", COUNT),
    ]


class LevelRules(ctypes.Structure):
    """How a curve is relaxed with about the same number of nodes.

    Parameters
    ----------
    placement : PlacementRules
    detour : float
        Greatest length of a trace, relative to the distance of its nodes.
    fold_margin : float
        Additional length, in mesh units, before parts over folded faces are subtracted.
    touching : float
        Distance in barycentric coordinates up to which strands touch.
    spacing_ratio : float
        Ratio of the longest to the shortest step of a leg above which nodes are respaced.
    least_decrease : float
        Decrease of the energy in an iteration, relative to the bending energy, up to which the
        curve has converged.
    count : int
        Approximate number of nodes.
    is_traced : bool
        Whether the curve is traced after every iteration.
    """

    _fields_ = [
        ("placement", PlacementRules),
        ("detour", NUMBER),
        ("fold_margin", NUMBER),
        ("touching", NUMBER),
        ("spacing_ratio", NUMBER),
        ("least_decrease", NUMBER),
        ("count", COUNT),
        ("is_traced", COUNT),
    ]


class LevelState(ctypes.Structure):
    """How far a curve has been relaxed.

    Attributes
    ----------
    outcome : int
        A `LevelOutcome`.
    has_moved : bool
        Whether the last iteration lowered the energy.
    iterations, most_iterations : int
        Number of iterations so far, and the number after which no further one is made.
    releases, stalled : int
        Numbers of releases of nodes, and of the latest iterations without a new least energy.
    work, most_work : float
        Number of moves of all nodes so far, including those that were only tried, and the number
        after which none is tried. A move across many faces counts as several.
    damping : float
        Of the next trial step.
    least_energy : float
        Least energy so far.
    """

    _fields_ = [
        ("outcome", COUNT),
        ("has_moved", COUNT),
        ("iterations", COUNT),
        ("most_iterations", COUNT),
        ("releases", COUNT),
        ("stalled", COUNT),
        ("work", NUMBER),
        ("most_work", NUMBER),
        ("damping", NUMBER),
        ("least_energy", NUMBER),
    ]


class _Curve(ctypes.Structure):
    _fields_ = [
        ("room", COUNT),
        ("n", COUNT),
        ("closed", COUNT),
        ("faces", POINTER),
        ("barycentric", POINTER),
        ("is_control", POINTER),
        ("is_corner", POINTER),
        ("is_stuck", POINTER),
        ("positions", POINTER),
        ("node_index", POINTER),
        ("polyline", PointList),
    ]


class _CurveBuffers(ctypes.Structure):
    _fields_ = [
        ("curve", _Curve),
        ("next", _Curve),
        ("spare", _Curve),
    ]


_PLACEMENT_ITEMS = Kernel("placement_items", COUNT, COUNT)
_PLACE = Kernel(
    "place_curve", SurfacePointers, PlacementRules, PointList, COUNT, COUNT, POINTER, POINTER,
    COUNT, POINTER, COUNT, _Curve,
)  # fmt: skip
_LEVEL_ITEMS = Kernel("level_items", COUNT, COUNT, COUNT)
_BEGIN = Kernel(
    "begin_level", SurfacePointers, RelaxationRules, LevelRules, _CurveBuffers, COUNT, POINTER,
    COUNT,
)  # fmt: skip
_RELAX = Kernel(
    "relax_on_level", SurfacePointers, RelaxationRules, LevelRules, POINTER, _CurveBuffers, COUNT,
    POINTER, COUNT, COUNT, LevelState,
)  # fmt: skip
_TRACE = Kernel(
    "trace_level", SurfacePointers, RelaxationRules, LevelRules, _CurveBuffers, COUNT, POINTER,
    COUNT, ctypes.POINTER(COUNT),
)  # fmt: skip


class CurveArrays(NamedTuple):
    """A curve as a polyline on the mesh, with nodes among its points.

    Attributes
    ----------
    closed : bool
        Whether the last point is joined to the first.
    faces : (n,) int array
        Faces of the nodes.
    barycentric : (n, 3) float array
        Coordinates in them; positive except at control points.
    is_control : (n,) bool array
        Which nodes are control points; the first one is.
    is_corner : (n,) bool array
        At which of them the curve may turn freely.
    node_index : (n,) int array
        Index of each node in the polyline, ascending.
    polyline_faces : (p,) int array
        Face of the segment after each point of the polyline.
    polyline_barycentric : (p, 3) float array
        The points in these faces.
    """

    closed: bool
    faces: IntArray
    barycentric: FloatArray
    is_control: BoolArray
    is_corner: BoolArray
    node_index: IntArray
    polyline_faces: IntArray
    polyline_barycentric: FloatArray


class _Buffer:
    """Room for a curve, as the library reads and writes it."""

    def __init__(self, room: int, points: int) -> None:
        self.faces, self.barycentric = np.empty(room, dtype=np.int64), np.empty((room, 3))
        self.is_control, self.is_corner, self.is_stuck = np.zeros((3, room), dtype=np.bool_)
        self.positions, self.node_index = np.empty((room, 3)), np.empty(room, dtype=np.int64)
        self.polyline = np.empty(points, dtype=np.int64), np.empty((points, 3))
        of_polyline = PointList(points, 0, *(array.ctypes.data for array in self.polyline))
        self.curve = _Curve(
            room, 0, 0, self.faces.ctypes.data, self.barycentric.ctypes.data,
            self.is_control.ctypes.data, self.is_corner.ctypes.data, self.is_stuck.ctypes.data,
            self.positions.ctypes.data, self.node_index.ctypes.data, of_polyline,
        )  # fmt: skip

    def arrays(self) -> CurveArrays:
        """A copy of the curve."""
        n, p = self.curve.n, self.curve.polyline.count
        return CurveArrays(
            bool(self.curve.closed),
            self.faces[:n].copy(),
            self.barycentric[:n].copy(),
            self.is_control[:n].copy(),
            self.is_corner[:n].copy(),
            self.node_index[:n].copy(),
            self.polyline[0][:p].copy(),
            self.polyline[1][:p].copy(),
        )

    def take(self, given: CurveArrays, is_stuck: BoolArray) -> None:
        """Store a curve."""
        n, p = len(given.faces), len(given.polyline_faces)
        self.curve.n, self.curve.closed, self.curve.polyline.count = n, int(given.closed), p
        self.faces[:n], self.barycentric[:n] = given.faces, given.barycentric
        self.is_control[:n], self.is_corner[:n] = given.is_control, given.is_corner
        self.is_stuck[:n] = is_stuck
        self.node_index[:n] = given.node_index
        self.polyline[0][:p], self.polyline[1][:p] = given[6:]


def place_on_polyline(
    surface: SurfaceArrays,
    faces: IntArray,
    barycentric: FloatArray,
    closed: bool,
    controls: IntArray,
    corners: BoolArray,
    count: int,
    rules: PlacementRules,
) -> CurveArrays:
    """Place about `count` evenly spaced nodes on a polyline.

    Parameters
    ----------
    surface : SurfaceArrays
    faces : (p,) int array
        Face of the segment after each point of the polyline.
    barycentric : (p, 3) float array
        The points in these faces.
    closed : bool
        Whether the last point is joined to the first.
    controls : (k,) int array
        Indices of the control points in the polyline, ascending from 0.
    corners : (k,) bool array
        At which of them the curve may turn freely.
    count : int
    rules : PlacementRules

    Returns
    -------
    CurveArrays
        The same polyline with the nodes.
    """
    p, k = rows("faces", faces), rows("controls", controls)
    points = PointList(
        p, p, address("faces", faces, INT, p), address("barycentric", barycentric, FLOAT, p, 3)
    )
    room = _node_room(count, k, rules)
    placed, items = _Buffer(room, p + room), _PLACEMENT_ITEMS.result(room, p)
    scratch = np.empty(items)
    _PLACE(
        surface.pointers, rules, points, int(closed), k, address("controls", controls, INT, k),
        address("corners", corners, BOOL, k), count, scratch.ctypes.data, items, placed.curve,
    )  # fmt: skip
    return placed.arrays()


def _node_room(count: int, k: int, rules: PlacementRules) -> int:
    """Greatest number of nodes that are placed on the legs between k control points."""
    return count + (rules.fewest_of_leg + 1) * (k + 1)


class CurveRelaxation:
    """A curve that is relaxed on one level after the other.

    Parameters
    ----------
    surface : SurfaceArrays
    curve : CurveArrays
        A simple curve.
    """

    def __init__(self, surface: SurfaceArrays, curve: CurveArrays) -> None:
        n, p = rows("faces", curve.faces), rows("polyline_faces", curve.polyline_faces)
        address("faces", curve.faces, INT, n)
        address("barycentric", curve.barycentric, FLOAT, n, 3)
        address("is_control", curve.is_control, BOOL, n)
        address("is_corner", curve.is_corner, BOOL, n)
        address("node_index", curve.node_index, INT, n)
        address("polyline_faces", curve.polyline_faces, INT, p)
        address("polyline_barycentric", curve.polyline_barycentric, FLOAT, p, 3)
        self._surface, self._buffers = surface, [_Buffer(n, p)]
        self._buffers[0].take(curve, np.zeros(n, dtype=np.bool_))

    @property
    def arrays(self) -> CurveArrays:
        """The present curve."""
        return self._buffers[0].arrays()

    @property
    def positions(self) -> FloatArray:
        """Positions of the present nodes, (n, 3), after the first level has begun."""
        current = self._buffers[0]
        return current.positions[: current.curve.n].copy()

    def begin_level(self, rules: RelaxationRules, level: LevelRules) -> None:
        """Respace the nodes if there are too many or too few of them, or if they are uneven."""
        self._call(_BEGIN, rules, level)

    def iterate(
        self,
        rules: RelaxationRules,
        level: LevelRules,
        movable: BoolArray | None,
        state: LevelState,
    ) -> None:
        """Make an iteration, which changes the state.

        After much work the call ends before a step has lowered the energy; then another call
        continues. Without iterations or work left, it only finds out whether the curve has
        converged.

        Parameters
        ----------
        rules : RelaxationRules
        level : LevelRules
        movable : (n,) bool array or None
            Which nodes may move; None for all but the control points.
        state : LevelState
        """
        self._call(_RELAX, rules, level, (library.MOST_WORK, state), movable=movable)

    def trace(self, rules: RelaxationRules, level: LevelRules) -> bool:
        """Trace the curve where it has moved since it was traced; whether no trace failed."""
        is_lost = COUNT(0)
        self._call(_TRACE, rules, level, (is_lost,))
        return not is_lost.value

    def _call(
        self,
        kernel: Kernel,
        rules: RelaxationRules,
        level: LevelRules,
        after: tuple[Any, ...] = (),
        **movable: BoolArray | None,
    ) -> None:
        """Call a kernel, with more room if needed, and take its result as the present curve."""
        current, most_faces = self._buffers[0].curve, rules.traces.most_faces
        k = int(self._buffers[0].is_control[: current.n].sum())
        n = max(current.n, _node_room(level.count, k, level.placement))
        points = current.polyline.count + n + most_faces
        if current.room < n or current.polyline.room < points:
            self._make_room(n, 2 * points, steps.PAIRS_OF_A_NODE * n)
        while True:
            curves = _CurveBuffers(*(each.curve for each in self._buffers))
            code = kernel.result(
                self._surface.pointers, rules, level,
                *(optional_address("movable", m, BOOL, current.n) for m in movable.values()),
                curves, self._pair_room, self._scratch.ctypes.data, len(self._scratch), *after,
            )  # fmt: skip
            if code != library.TOO_SMALL or points > n * most_faces:
                break
            points *= 2
            self._make_room(n, 2 * points, steps.more_room(self._pair_room, n))
        kernel.check(code)
        found = self._buffers.pop(1)
        found.curve = _Curve.from_buffer_copy(curves.next)  # not a view that keeps all former ones
        self._buffers.insert(0, found)

    def _make_room(self, n: int, points: int, pair_room: int) -> None:
        """Make room for n nodes, for polylines of some points, and for pairs of nodes."""
        before = self._buffers[0]
        self._buffers = [_Buffer(n, points) for _ in range(3)]
        self._buffers[0].take(before.arrays(), before.is_stuck[: before.curve.n])
        self._pair_room = pair_room
        self._scratch = np.empty(_LEVEL_ITEMS.result(n, points, pair_room))
