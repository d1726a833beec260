"""What a design gives back: how it ended, the curve, and what belongs to it."""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass
from dataclasses import field as dataclass_field
from functools import cached_property

from .errors import CurveError
from .geometry.array_types import FloatArray
from .geometry.curve import SurfaceCurve
from .start import Resumable


class Status(enum.Enum):
    """How a design ended; ``str()`` says what to change."""

    CONVERGED = "converged: one curve through all control points"
    ITERATION_LIMIT = (
        "stopped at the iteration limit before the energy converged; the curve is usable, a finer "
        "mesh, one without defects, or other control points may make it fairer"
    )
    DIVERGED = (
        "the energy left the range of numbers and the best curve before is returned; look for "
        "faces without area, or merge vertices by distance"
    )
    UNRELAXED = (
        "strands of the curve are so close to one another that it is returned as the level set "
        "gives it; use a finer mesh, fewer points or another order"
    )
    CANCELLED = (
        "cancelled by the progress function; the curve, if there was one already, is the best so "
        "far, and the same request gives the whole one"
    )
    NOT_ONE_CURVE = (
        "the level set is not one simple curve through all control points; the mesh may be too "
        "coarse there: subdivide it, or use the method 'nicmm', which always gives one"
    )

    def __str__(self) -> str:
        """What happened and what to change."""
        return self.value


@dataclass(frozen=True)
class Design:
    """The result of a design.

    Attributes
    ----------
    status : Status
    curves : list of SurfaceCurve
        One entry when all is well; none where a design was cancelled before there was a curve.
    iterations : int
        Of the network's training, of the solver, or of the relaxation.
    seconds : float
    energy : dict of str to float
        The terms of Eq. 2 without their weights: "sdf", "int", "smooth" and "fea", for lengths in
        square roots of the surface's area; empty where there is no curve.
    breaking_vertices : int
        Vertices whose predicted sign would have split the curve or missed a point, so that the
        initial level set replaces the predicted one around them; 0 when it was one loop by itself.
    find_field : callable
        Finds `field` when it is first asked for.
    resumable : Resumable or None
        What another design goes on from by ``start=``; None where `curves` has to do.
    """

    status: Status
    curves: list[SurfaceCurve]
    iterations: int
    seconds: float
    energy: dict[str, float]
    breaking_vertices: int
    find_field: Callable[[], FloatArray] = dataclass_field(repr=False, compare=False)
    resumable: Resumable | None = dataclass_field(default=None, repr=False, compare=False)

    @cached_property
    def field(self) -> FloatArray:
        """Level-set values in mesh units at the input mesh's vertices, shape (V,).

        Negative inside, or the distance without sign where the curve is open or bounds no region.
        Vertices that are not connected to the control points get the largest value: they are
        outside.

        Raises
        ------
        CurveError
            If the design was cancelled before there was a curve.
        """
        return self.find_field()


STATUS = {
    "converged": Status.CONVERGED,
    "cap": Status.ITERATION_LIMIT,
    "cancelled": Status.CANCELLED,
    "diverged": Status.DIVERGED,
    "unrelaxed": Status.UNRELAXED,
}
"""What the reason of a solver's stop means for the design."""


def cancelled_design(seconds: float) -> Design:
    """A design that was cancelled before there was a curve."""

    def no_field() -> FloatArray:
        raise CurveError(
            "design.field belongs to no curve: the progress function cancelled the design before "
            "there was one; ask for it again"
        )

    return Design(
        status=Status.CANCELLED,
        curves=[],
        iterations=0,
        seconds=seconds,
        energy={},
        breaking_vertices=0,
        find_field=no_field,
    )


def is_one_curve(curves: list[SurfaceCurve], closed: bool = True) -> bool:
    """Whether curves are a single one, closed or open, through all control points."""
    if len(curves) != 1 or curves[0].closed != closed:
        return False
    return bool((curves[0].control_index >= 0).all())
