# SPDX-License-Identifier: GPL-3.0-or-later
"""Updates a curve while one of its points is dragged, with a bounded amount of work for each move.

Each move starts from the last curve. If that is impossible, for example after a jump, the curve has
to be designed from scratch, which takes longer; `waiting` is then set.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from ..scene import design_request, surface_cache
from ..scene.design_request import DesignRequest, message_of

if TYPE_CHECKING:
    from ...nicmm_core import Design, SurfaceCurve
    from ..scene.control_points import ControlPoints

ITERATIONS = 3
"""Maximum number of iterations for each move; they take one or two frames."""

POINTS = 2000
"""Points of the curve times iterations per move; an iteration takes time for every point."""

MOST_STEPS = 60
"""Steps after a move before the curve is designed from scratch; most need fewer than five."""


class LiveCurve:
    """A curve whose control points move.

    Attributes
    ----------
    request : DesignRequest
        Request with the current points and the last curve as its start.
    keeps_course : bool
        Whether the curve keeps its course; otherwise every move needs a design from scratch.
    has_new_point : bool
        Whether the start does not pass all control points yet. Then the next step also searches for
        the course of the new leg, without a limit on its work.
    waiting : bool
        Whether the curve has to be designed from scratch, or with a new point.
    steps_left : int
        Number of steps that may still follow; 0 if the curve has converged.
    problem : str
        Why there is no curve through the points; empty if there is one.
    """

    def __init__(
        self, request: DesignRequest, keeps_course: bool = True, has_new_point: bool = False
    ) -> None:
        self.request, self.keeps_course = request, keeps_course
        self.has_new_point = has_new_point
        self.waiting, self.steps_left = request.start is None or not keeps_course, 0
        self.problem = ""
        self.image: SurfaceCurve | None = None

    @property
    def curve(self) -> SurfaceCurve | None:
        """The last curve, a SurfaceCurve of the core, or None."""
        from ... import nicmm_core as nicmm

        found = self.request.start
        return found.curves[0] if isinstance(found, nicmm.Design) else found

    @property
    def curves(self) -> list[SurfaceCurve]:
        """The last curve, and its mirror image if the request asks for a pair."""
        return [each for each in (self.curve, self.image) if each is not None]

    @property
    def design(self) -> Design | None:
        """The last design, with the mirror image of a pair; None if it has not converged."""
        from ... import nicmm_core as nicmm

        found = self.request.start
        if self.steps_left or not isinstance(found, nicmm.Design):
            return None
        return replace(found, curves=self.curves)

    def move(self, points: ControlPoints) -> None:
        """Move the control points, or a via point, and take a first step."""
        self.request = replace(self.request, points=points.places)
        self.waiting = self.request.start is None or not self.keeps_course
        self.steps_left = MOST_STEPS
        if not self.waiting:
            self.step()

    def set_result(self, design: Design | Exception) -> None:
        """Store the result of a design from scratch, which may be an exception."""
        self.waiting, self.has_new_point, self.steps_left = False, False, 0
        if isinstance(design, Exception):
            self.problem = str(design)
        elif design.curves:
            self.image = design.curves[1] if len(design.curves) > 1 else None
            start = design_request.without_image(design)
            self.request, self.problem = replace(self.request, start=start), ""

    def step(self) -> None:
        """Continue for a few iterations."""
        from ... import nicmm_core as nicmm

        curve = self.curve
        if curve is None or not self.steps_left:
            return
        self.steps_left -= 1
        request, surface = self.request, self.request.surface
        iterations = min(max(POINTS // len(curve.faces), 1), ITERATIONS)
        try:
            with surface_cache.designer_of(surface) as designer:
                design = designer.design(
                    request.points,
                    order="given",
                    max_iterations=None if self.has_new_point else iterations,
                    start=request.start,
                    **request.options,
                )
                image = design_request.with_image(designer, request, design).curves[1:]
        except nicmm.CurveError:
            self.waiting, self.steps_left = True, 0
        except nicmm.NicmmError as error:
            self.problem, self.steps_left = message_of(error, request), 0
        else:
            self.request, self.problem = replace(request, start=design), ""
            self.has_new_point = False
            self.image = image[0] if image else None
            if design.status is not nicmm.Status.ITERATION_LIMIT:
                self.steps_left = 0
            elif not self.steps_left:
                self.waiting = True
