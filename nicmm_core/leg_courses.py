"""Searches for other courses of one leg of a curve, while the other legs keep theirs.

The leg is designed alone, as an open curve with alternatives. Each of these replaces the leg of the
curve, which is then relaxed. Neighbouring legs change a little where the curve now leaves their
control points in another direction.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from .courses.comparison import SAME_COURSE, farthest_between
from .design_result import Design, cancelled_design
from .designer import Designer
from .errors import CurveError
from .geometry.array_types import FloatArray
from .geometry.curve import SurfaceCurve, points_of_leg, resample, with_other_leg
from .geometry.mesh import Mesh
from .geometry.surface_points import SurfacePoints
from .mapped_surface import MappedSurface
from .progress import Progress
from .relaxation.curve_energies import relative_energies
from .status import Status

SEARCH_FRACTION = 0.8
"""Approximate fraction of the total time that the search for the leg takes."""

SAMPLES = 200
"""Number of points at which two legs are compared."""


def leg_courses(
    designer: Designer,
    points: SurfacePoints,
    curve: SurfaceCurve,
    leg: int,
    *,
    alternatives: int,
    progress: Progress,
    **options: Any,
) -> Design:
    """Design a curve along the courses that one of its legs can take.

    Parameters
    ----------
    designer : Designer
        Designer of the mesh of the curve.
    points : SurfacePoints
        Control points of the curve, in the order visited.
    curve : SurfaceCurve
        The curve through the points.
    leg : int
        Index of the control point at which the leg begins.
    alternatives : int
        Largest number of further courses of the leg that are sought.
    progress : callable
        See `Designer.design`. If it cancels the search, the design that is returned has no curve.
    **options
        Other options of `Designer.design`, for the method "elastic".

    Returns
    -------
    Design
        The fairest curve. Its `alternatives` have the others by ascending energy. One of them all
        takes the course of the given curve. In each of the others the leg changes more than any
        other leg, and by more than `SAME_COURSE`.
    """
    of_leg = {**options, "closed": False, "via_points": None, "corners": None}
    ends = points[np.array([leg, (leg + 1) % len(points)])]

    def search(fraction: float, line: FloatArray) -> object:
        return progress(SEARCH_FRACTION * fraction, line)

    found = designer.design(ends, alternatives=alternatives, progress=search, **of_leg)
    if found.status is Status.CANCELLED:
        return cancelled_design(found.seconds)
    starts = [
        curve,
        *(
            with_other_leg(designer.mesh, curve, leg, each.curves[0])
            for each in (found, *found.alternatives)
        ),
    ]
    designs: list[Design] = []
    for number, start in enumerate(starts):
        fraction = SEARCH_FRACTION + (1.0 - SEARCH_FRACTION) * number / len(starts)
        if progress(fraction, start.points) is False:
            return cancelled_design(found.seconds)
        try:
            design = designer.design(points, start=start, **options)
        except CurveError:  # the leg would cross another one
            if not designs:
                raise
            continue
        if not designs or _differs(designer.mesh, design, designs, leg):
            designs.append(design)
    return _by_energy(designs)


def _differs(mesh: Mesh, design: Design, designs: list[Design], leg: int) -> bool:
    """Whether a design differs from all others in one leg, and from the first one mainly there."""
    limit = SAME_COURSE * mesh.diagonal
    lines = [_legs(each.curves[0]) for each in (*designs, design)]
    changes = [farthest_between(*pair) for pair in zip(lines[0], lines[-1], strict=True)]
    is_new = all(farthest_between(lines[-1][leg], other[leg]) > limit for other in lines[:-1])
    return is_new and changes[leg] >= max(changes)


def _legs(curve: SurfaceCurve) -> list[FloatArray]:
    """Points at equal distances on each leg of a curve."""
    count = len(curve.control_index) - (not curve.closed)
    return [
        resample(curve.points[points_of_leg(curve, leg)], SAMPLES, False)[0] for leg in range(count)
    ]


def _by_energy(designs: list[Design]) -> Design:
    """The fairest design, with the others as its alternatives and with their energies."""
    states = [design.resumable for design in designs if design.resumable is not None]
    first = states[0]
    surface = MappedSurface(first.mesh).of(first.request)
    curves = [state.curve for state in states]
    energies = relative_energies(surface, curves, first.request.smoothness)
    best, *others = [
        replace(designs[number], relative_energy=energies[number], alternatives=[])
        for number in np.argsort(energies, kind="stable").tolist()
    ]
    return replace(best, alternatives=others)
