# SPDX-License-Identifier: GPL-3.0-or-later
"""A curve while it is edited: its control points, what it is asked for, and what can be taken back.

Nothing here knows of windows and events. Every change is answered by a bounded amount of work:
a few iterations from the last curve, and `step` goes on until it has converged. Where the last
curve cannot be used, as after a long jump of a point, `waiting` says that the curve has to be
designed anew, which takes longer; `step` does that too. A request that cannot be met leaves the
last curve that could, and `problem` says why.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ...nicmm_core.options import FEWEST_CLOSED, FEWEST_OPEN
from ..scene import curve_record
from ..scene.curve_record import Asked
from ..scene.mesh_data import InputError, in_words

ITERATIONS = 3
"""Of a step: a frame or two of live drawing."""

MOST_STEPS = 60
"""Steps from a change until the curve is taken as it is; most need fewer than five."""

SMOOTHER = 1.25
"""Factor of one step of smoothness."""

SMOOTHNESS_LIMITS = (0.01, 100.0)


@dataclass(frozen=True)
class State:
    """What one step of undo brings back.

    `points` are the core's SurfacePoints. `found` is the last Design, a SurfaceCurve that was
    opened, or None, and `problem` says why it does not answer the request; `notice` is a remark on
    it. `converged` says whether it is the final one for these points.
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
    surface : mesh_data.Triangles
    designer : nicmm_core.Designer
        Of the same triangles.
    weights : callable
        From the name of a vertex group to its weights, None for no name.
    asked : Asked
    points, curve : optional
        Control points and curve to go on from.
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
        """The curve as it is now, the core's SurfaceCurve, or None before there is one."""
        found = self.state.found
        return found.curves[0] if isinstance(found, self._nicmm.Design) else found

    @property
    def problem(self) -> str:
        """Why the curve is not the one that was asked for; empty where it is."""
        return self.state.problem

    @property
    def closed(self) -> bool:
        """Whether the points ask for a closed curve now: two of them can only be joined."""
        return self.asked.closed and len(self.points) >= FEWEST_CLOSED

    @property
    def resting(self) -> bool:
        """Whether nothing is left to be done by `step`."""
        return not self.waiting and not self._steps_left

    @property
    def untouched(self) -> bool:
        """Whether nothing was done that undo could take back."""
        return not self._done

    def positions(self) -> np.ndarray:
        """Where the control points are in the object's own space, (k, 3)."""
        return self.surface.points(self.points.faces, self.points.barycentric)

    def polyline(self) -> np.ndarray:
        """The curve's points in the object's own space, (n, 3); the first again if closed."""
        if self.curve is None:
            return np.zeros((0, 3))
        line = self.surface.points(self.curve.faces, self.curve.barycentric)
        return np.concatenate([line, line[:1]]) if self.curve.closed else line

    # Changes; each can be taken back.

    def add(self, face: int, barycentric) -> int:
        """Put a point after the last one, and return its number."""
        self._keep()
        return self._insert(len(self.points), face, barycentric)

    def set_points(self, positions: np.ndarray) -> None:
        """Replace all points by places on the surface in the object's own space, (k, 3)."""
        from ...nicmm_core.geometry.surface_points import locate_points

        solved = positions @ self.surface.linear.T
        points = locate_points(self.designer.mesh, solved, "points")
        self._keep()
        self.state = replace(self.state, points=points)
        self._ask()

    def insert(self, segment: int, share: float) -> int:
        """Put a point on the curve, between two of its points; return the new one's number.

        Parameters: which segment of `polyline`, and how far along it.
        """
        from ...nicmm_core.geometry.curve import leg_of_segment, point_on_segment

        self._keep()
        place = point_on_segment(self.designer.mesh, self.curve, segment, share)
        number = leg_of_segment(self.curve, segment) + 1
        return self._insert(number, place.faces[0], place.barycentric[0])

    def remove(self, number: int) -> None:
        """Take a point away."""
        self._keep()
        left = np.delete(np.arange(len(self.points)), number)
        self.state = replace(self.state, points=self.points[left])
        self._ask()

    def grab(self) -> None:
        """Begin to move points; all moves until `drop` are one step of undo."""
        self._before_drag, self._dragging = self.state, True

    def move(self, number: int, face: int, barycentric) -> None:
        """Move a point that was grabbed."""
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
        """End a move and take it back."""
        if self._dragging and self._before_drag is None:
            self.undo()
            self._undone.pop()
        self.drop()

    def ask_for(self, **changes) -> None:
        """Change what the curve is asked for, by the names of `Asked`."""
        asked = replace(self.asked, **changes)
        if asked != self.asked:
            self._keep()
            self.state = replace(self.state, asked=asked)
            # Other maps may lead to another course.
            self._ask(anew=changes.keys() != {"smoothness"})

    def smoother(self, steps: int) -> None:
        """Raise the smoothness by some steps, or lower it by a negative number of them."""
        wanted = self.asked.smoothness * SMOOTHER**steps
        self.ask_for(smoothness=float(np.clip(wanted, *SMOOTHNESS_LIMITS)))

    def undo(self) -> bool:
        """Take the last change back; False where there is none."""
        return self._go(self._done, self._undone)

    def redo(self) -> bool:
        """Make the last change that was taken back again; False where there is none."""
        return self._go(self._undone, self._done)

    # Work.

    def step(self) -> bool:
        """Do a bounded amount of work, or design anew where `waiting`; whether something was."""
        if self.resting:
            return False
        if self.waiting:
            self._design()
        else:
            self._go_on()
        return True

    def settle(self) -> None:
        """Work until the curve has converged."""
        while self.step():
            pass

    def what_is_missing(self) -> str:
        """Why there is no curve to keep, in words; empty where there is."""
        if self.problem:
            return self.problem
        if self.curve is None:
            return "A curve needs two points at least, a closed one three. Click on the surface"
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
        self._rest()
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

    def _rest(self) -> None:
        self.waiting, self._steps_left = False, 0

    def _ask(self, anew: bool = False) -> None:
        """Answer a change: at once as far as bounded work goes, or later where `anew`."""
        self._rest()
        if len(self.points) < FEWEST_OPEN:
            self.state = replace(self.state, found=None, problem="", notice="", converged=True)
            return
        self.state = replace(self.state, converged=False, problem="")
        if anew or self.state.found is None:
            self.waiting = True
            return
        self._steps_left = MOST_STEPS
        self._go_on()

    def _go_on(self) -> None:
        self._steps_left -= 1
        try:
            design = self._answer(start=self.state.found, max_iterations=ITERATIONS)
        except self._nicmm.CurveError:
            self._rest()
            self.waiting = True
            return
        if design is None:
            self._rest()
        elif design.status is not self._nicmm.Status.ITERATION_LIMIT:
            self._steps_left = 0
        elif not self._steps_left:
            self.waiting = True
        self._take(design)

    def _design(self) -> None:
        self._rest()
        self._take(self._answer())

    def _answer(self, **bounds):
        """The core's design, or None where it has none; `problem` says why."""
        self.state = replace(self.state, problem="")
        try:
            return self.designer.design(self.points, **self._options(), **bounds)
        except self._nicmm.CurveError:
            raise
        except (self._nicmm.NicmmError, InputError) as error:
            self.state = replace(self.state, problem=self._in_words(error))
            return None

    def _take(self, design) -> None:
        """Show what a design brought."""
        nicmm = self._nicmm
        if design is None:
            return
        good = (nicmm.Status.CONVERGED, nicmm.Status.ITERATION_LIMIT)
        self.state = replace(
            self.state,
            found=design,
            notice="" if design.status in good else str(design.status),
            converged=self.resting,
        )

    def _options(self) -> dict:
        """The options of the core; points in the order given, and its method that goes on."""
        options = curve_record.arguments_of(self.asked, self._weights_of)
        return {**options, "closed": self.closed, "method": "nicmm"}

    def _weights_of(self, name: str) -> np.ndarray | None:
        if name not in self._weights:
            self._weights[name] = self._read_weights(name)
        return self._weights[name]

    def _in_words(self, error: Exception) -> str:
        """The core's message, with its points numbered as the user counts them."""
        return in_words(error, self.asked.obstacle_group)
