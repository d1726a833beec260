"""What a design gives back: how it ended, the curve, and what belongs to it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from dataclasses import field as dataclass_field
from functools import cached_property

from .errors import CurveError
from .geometry.array_types import FloatArray
from .geometry.curve import SurfaceCurve
from .start import Resumable
from .status import Status


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
    alternatives : list of Design
        Curves along other courses, the fairest first, each at least 2 % of the diagonal away from
        the others somewhere; empty unless they were asked for.
    """

    status: Status
    curves: list[SurfaceCurve]
    iterations: int
    seconds: float
    energy: dict[str, float]
    breaking_vertices: int
    find_field: Callable[[], FloatArray] = dataclass_field(repr=False, compare=False)
    resumable: Resumable | None = dataclass_field(default=None, repr=False, compare=False)
    alternatives: list[Design] = dataclass_field(default_factory=list)

    def __repr__(self) -> str:
        return (
            f"<Design: {self.status}; {self.iterations} iterations, {self.seconds:.2f} s; "
            f"curves: {self.curves}>"
        )

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
