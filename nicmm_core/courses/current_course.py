"""Recognises which of several courses a curve takes."""

from __future__ import annotations

from collections.abc import Sequence

from ..geometry.curve import SurfaceCurve, resample
from ..geometry.mesh import Mesh
from .course_search import SAME_COURSE, farthest_between

SAMPLES = 500
"""Number of points at which two curves are compared."""


def current_course(mesh: Mesh, curve: SurfaceCurve, courses: Sequence[SurfaceCurve]) -> int | None:
    """Index of the curve nearest to a curve, or None if none of them takes the same course.

    Parameters
    ----------
    mesh : Mesh
        Mesh on which all curves lie.
    curve : SurfaceCurve
    courses : sequence of SurfaceCurve
        At least one curve through the same points, each along another course.
    """
    ours, *others = (resample(each.points, SAMPLES, each.closed)[0] for each in (curve, *courses))
    distances = [farthest_between(ours, other) for other in others]
    nearest = min(range(len(distances)), key=distances.__getitem__)
    return nearest if distances[nearest] <= SAME_COURSE * mesh.diagonal else None
