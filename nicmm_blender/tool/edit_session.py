# SPDX-License-Identifier: GPL-3.0-or-later
"""An editing session: the control points and settings of a curve, with undo.

It does not depend on windows and events. Every change does a bounded amount of work: a few
iterations from the last curve, which `step` continues until the curve has converged. If the last
curve cannot be used, for example after a point jumps far, the curve has to be designed from
scratch, which takes longer: `waiting` is set, and `step` does it. If a request cannot be met, the
last curve stays, and `problem` holds the reason.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ...nicmm_core.options import FEWEST_CLOSED, FEWEST_OPEN
from ..scene import curve_record
from ..scene.curve_record import Asked
from ..scene.messages import InputError, in_words

ITERATIONS = 3
"""Iterations in a step, which take one or two frames."""

MOST_STEPS = 60
"""Steps after a change before the curve is designed from scratch; most need fewer than five."""

SMOOTHER = 1.25
"""Factor between two levels of smoothness."""

SMOOTHNESS_LIMITS = (0.01, 100.0)


@dataclass(frozen=True)
class State:
    """The state that one undo step restores.

    `points` are SurfacePoints of the core. `found` is the last Design, the SurfaceCurve that was
    opened, or None; `problem` is the reason why it does not meet the request, `notice` a remark on
    it, and `converged` whether it is the final one for these points.
    """

    points: object
    asked: Asked
    found: object = None
    problem: str = ""
    notice: str = ""
    converged: bool = False


class EditSession:
    """An editing session on one mesh.

    Parameters
    ----------
    surface : surface.Surface
    designer : nicmm_core.Designer
        Of the same triangles.
    weights : callable
        Maps the name of a vertex group to its weights, and "" to None.
    asked : Asked
    points, curve : optional
        Control points and curve to start with.
    """

    def __init__(
        self,
        surface,
        designer,
        weights: Callable[[str], np.ndarray | None],
        asked: Asked,
        points=None,
        curve=None,
    ) -> None:
        from ... import nicmm_core as nicmm

        self._nicmm = nicmm
        self.surface, self.designer = surface, designer
        self._read_weights = weights
        self._weights: dict[str, np.ndarray | None] = {}
        if points is None:
            points = nicmm.SurfacePoints(np.zeros(0, dtype=np.int64), np.zeros((0, 3)))
        self.state = State(points, asked)
        self.waiting = False
        self._steps_left = 0
        self._done: list[State] = []
        self._undone: list[State] = []
        self._before_drag: State | None = None
        self._dragging = False
        if curve is None:
            self._ask()
        else:
            self.state = replace(self.state, found=curve, converged=True)

    @property
    def points(self):
        """The control points, the core's SurfacePoints."""
        return self.state.points

    @property
    def asked(self) -> Asked:
        return self.state.asked

    @property
    def curve(self):
        """The present curve, a SurfaceCurve of the core, or None before there is one."""
        found = self.state.found
        return found.curves[0] if isinstance(found, self._nicmm.Design) else found

    @property
    def problem(self) -> str:
        """Why the curve does not meet the request; empty if it does."""
        return self.state.problem

    @property
    def closed(self) -> bool:
        """Whether the curve is closed now: two points are joined by an open curve."""
        return self.asked.closed and len(self.points) >= FEWEST_CLOSED

    @property
    def idle(self) -> bool:
        """Whether `step` has no work left."""
        return not self.waiting and not self._steps_left

    @property
    def untouched(self) -> bool:
        """Whether there is nothing to undo."""
        return not self._done

    def positions(self) -> np.ndarray:
        """Positions of the control points in the object's local space, (k, 3)."""
        return self.surface.points(self.points.faces, self.points.barycentric)

    def polyline(self) -> np.ndarray:
        """The curve's points in the object's local space, (n, 3); the first again if closed."""
        if self.curve is None:
            return np.zeros((0, 3))
        line = self.surface.points(self.curve.faces, self.curve.barycentric)
        return np.concatenate([line, line[:1]]) if self.curve.closed else line

    # Changes; each can be undone.

    def add(self, face: int, barycentric) -> int:
        """Append a point and return its index."""
        self._keep()
        return self._insert(len(self.points), face, barycentric)

    def set_points(self, positions: np.ndarray) -> None:
        """Replace all points by positions on the surface in the object's local space, (k, 3)."""
        from ...nicmm_core.geometry.surface_points import locate_points

        solved = positions @ self.surface.linear.T
        points = locate_points(self.designer.mesh, solved, "points")
        self._keep()
        self.state = replace(self.state, points=points)
        self._ask()

    def insert(self, segment: int, share: float) -> int:
        """Insert a point on the curve, between two of its points; return its index.

        Parameters: the segment of `polyline`, and the fraction of its length.
        """
        from ...nicmm_core.geometry.curve import leg_of_segment, point_on_segment

        self._keep()
        place = point_on_segment(self.designer.mesh, self.curve, segment, share)
        number = leg_of_segment(self.curve, segment) + 1
        return self._insert(number, place.faces[0], place.barycentric[0])

    def remove(self, number: int) -> None:
        """Remove a point."""
        self._keep()
        left = np.delete(np.arange(len(self.points)), number)
        self.state = replace(self.state, points=self.points[left])
        self._ask()

    def grab(self) -> None:
        """Begin to move a point; all moves until `drop` are one undo step."""
        self._before_drag, self._dragging = self.state, True

    def move(self, number: int, face: int, barycentric) -> None:
        """Move the grabbed point."""
        if self._before_drag is not None:
            self._keep(self._before_drag)
            self._before_drag = None
        faces, weights = self.points.faces.copy(), self.points.barycentric.copy()
        faces[number], weights[number] = face, barycentric
        points = self._nicmm.SurfacePoints(faces, weights)
        self.state = replace(self.state, points=points)
        self._ask()

    def drop(self) -> None:
        """End a move."""
        self._before_drag = None
        self._dragging = False

    def drop_back(self) -> None:
        """End a move and undo it."""
        if self._dragging and self._before_drag is None:
            self.undo()
            self._undone.pop()
        self.drop()

    def ask_for(self, **changes) -> None:
        """Change settings of the curve, named as in `Asked`."""
        asked = replace(self.asked, **changes)
        if asked != self.asked:
            self._keep()
            self.state = replace(self.state, asked=asked)
            # With other maps the best course may be a different one.
            self._ask(from_scratch=changes.keys() != {"smoothness"})

    def smoother(self, steps: int) -> None:
        """Raise the smoothness by some levels, or lower it by a negative number of them."""
        wanted = self.asked.smoothness * SMOOTHER**steps
        self.ask_for(smoothness=float(np.clip(wanted, *SMOOTHNESS_LIMITS)))

    def undo(self) -> bool:
        """Undo the last change; False without a change to undo."""
        return self._go(self._done, self._undone)

    def redo(self) -> bool:
        """Redo the last change that was undone; False without such a change."""
        return self._go(self._undone, self._done)

    # Work.

    def step(self) -> bool:
        """Do a bounded amount of work, or design from scratch if `waiting`; False if idle."""
        if self.idle:
            return False
        if self.waiting:
            self._design()
        else:
            self._go_on()
        return True

    def converge(self) -> None:
        """Work until the curve has converged."""
        while self.step():
            pass

    def what_is_missing(self) -> str:
        """Why there is no curve to keep; empty if there is one."""
        if self.problem:
            return self.problem
        if self.curve is None:
            return "A curve needs at least two points, a closed one three. Click on the surface"
        return ""

    def _keep(self, state: State | None = None) -> None:
        self._done.append(self.state if state is None else state)
        self._undone.clear()

    def _go(self, source: list, target: list) -> bool:
        if not source:
            return False
        target.append(self.state)
        self.state = source.pop()
        self.drop()
        self._drop_work()
        if not (self.problem or self.state.converged):
            self._ask()
        return True

    def _insert(self, number: int, face: int, barycentric) -> int:
        points = self._nicmm.SurfacePoints(
            np.insert(self.points.faces, number, face),
            np.insert(self.points.barycentric, number, barycentric, axis=0),
        )
        self.state = replace(self.state, points=points)
        self._ask()
        return number

    def _drop_work(self) -> None:
        self.waiting, self._steps_left = False, 0

    def _ask(self, from_scratch: bool = False) -> None:
        """Respond to a change, with bounded work now, or with a design `from_scratch` later."""
        self._drop_work()
        if len(self.points) < FEWEST_OPEN:
            self.state = replace(self.state, found=None, problem="", notice="", converged=True)
            return
        self.state = replace(self.state, converged=False, problem="")
        if from_scratch or self.state.found is None:
            self.waiting = True
            return
        self._steps_left = MOST_STEPS
        self._go_on()

    def _go_on(self) -> None:
        self._steps_left -= 1
        try:
            design = self._answer(start=self.state.found, max_iterations=ITERATIONS)
        except self._nicmm.CurveError:
            self._drop_work()
            self.waiting = True
            return
        if design is None:
            self._drop_work()
        elif design.status is not self._nicmm.Status.ITERATION_LIMIT:
            self._steps_left = 0
        elif not self._steps_left:
            self.waiting = True
        self._take(design)

    def _design(self) -> None:
        self._drop_work()
        self._take(self._answer())

    def _answer(self, **bounds):
        """The core's design, or None with the reason in `problem`."""
        self.state = replace(self.state, problem="")
        try:
            return self.designer.design(self.points, **self._options(), **bounds)
        except self._nicmm.CurveError:
            raise
        except (self._nicmm.NicmmError, InputError) as error:
            self.state = replace(self.state, problem=self._in_words(error))
            return None

    def _take(self, design) -> None:
        """Store a design."""
        nicmm = self._nicmm
        if design is None:
            return
        good = (nicmm.Status.CONVERGED, nicmm.Status.ITERATION_LIMIT)
        self.state = replace(
            self.state,
            found=design,
            notice="" if design.status in good else str(design.status),
            converged=self.idle,
        )

    def _options(self) -> dict:
        """The options of the core, with the method that can continue from a curve."""
        options = curve_record.arguments_of(self.asked, self._weights_of)
        return {**options, "closed": self.closed, "method": "nicmm"}

    def _weights_of(self, name: str) -> np.ndarray | None:
        if name not in self._weights:
            self._weights[name] = self._read_weights(name)
        return self._weights[name]

    def _in_words(self, error: Exception) -> str:
        """The core's message for the user, with points counted from one."""
        return in_words(error, self.asked.obstacle_group)
