"""The result of a design: its status, the curve, and the energy and level set of the curve."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from dataclasses import field as dataclass_field
from functools import cached_property
from typing import Any

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
        How the design ended.
    curves : list of SurfaceCurve
        One curve, unless the status is `NOT_ONE_CURVE`. Empty if the design was cancelled before
        there was a curve.
    iterations : int
        Number of iterations of the relaxation or of the level-set solver.
    seconds : float
        Duration of the design.
    energy : dict of str to float
        The terms of Eq. 2 without their weights: "sdf", "int", "smooth" and "fea", with lengths in
        units of the square root of the surface's area. Empty if there is no curve.
    breaking_vertices : int
        Number of vertices that the methods "nicmm" and "variational" had to hold, over all steps,
        because another sign of φ there would have split the curve or detached it from a control
        point. Always 0 with the method "elastic".
    find_field : callable
        Computes `field` on first access.
    resumable : Resumable or None
        State from which a design with ``start=`` continues; None if it continues from `curves`.
    alternatives : list of Design
        Curves along other courses, the lowest energy first. Each is somewhere at least 2 % of the
        diagonal away from this curve and from the other alternatives. Empty unless requested.
    repairs : dict of str to int
        What was repaired on the copy of the mesh on which the curve was designed, and how often,
        such as ``{"faces turned": 12, "vertices joined": 40}``. Empty for a sound mesh.
    asymmetry : float or None
        With a mirror, the greatest distance of the curve to its mirror image, in mesh units; less
        than a millionth of the diagonal if the surface is symmetric. None without a mirror.
    relative_energy : float
        For an alternative, its energy divided by that of the fairest curve; 1 for all other
        designs. The energy is that by which alternatives are sorted. What maps contribute to the
        difference counts in units of the energy without maps, since with maps it may be negative.
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
    repairs: dict[str, int] = dataclass_field(default_factory=dict)
    asymmetry: float | None = None
    relative_energy: float = 1.0

    def __repr__(self) -> str:
        return (
            f"<Design: {self.status}; {self.iterations} iterations, {self.seconds:.2f} s; "
            f"curves: {self.curves}>"
        )

    @cached_property
    def field(self) -> FloatArray:
        """Level-set values at the vertices of the input mesh, in mesh units, shape (V,).

        They are negative inside the curve. If the curve is open or bounds no region, they are
        unsigned distances. Vertices that are not connected to the control points count as outside
        and get the largest value.

        Raises
        ------
        CurveError
            If the design was cancelled before there was a curve.
        """
        return self.find_field()


def with_curves_of_designs(given: Any) -> Any:
    """Replace designs in a list by their curves, if they have one each; leave the rest."""
    if not isinstance(given, list | tuple):
        return given
    return [
        each.curves[0] if isinstance(each, Design) and len(each.curves) == 1 else each
        for each in given
    ]


def cancelled_design(seconds: float) -> Design:
    """The result of a design that was cancelled before there was a curve."""

    def no_field() -> FloatArray:
        raise CurveError(
            "design.field is not available: the design was cancelled before there was a curve; "
            "design the curve again without cancelling"
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
