"""Compares relaxed curves of one request by their energies and by their distances."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.spatial import cKDTree

from ..geometry.array_types import FloatArray
from ..geometry.curve import SurfaceCurve, resample
from ..geometry.mesh import Mesh
from ..relaxation.curve_nodes import CurveSurface
from ..relaxation.discrete_curve import DiscreteCurve

SAME_COURSE = 0.02
"""Distance, relative to the diagonal of the mesh, up to which two courses count as the same."""

PARTS_APART = 0.005
"""The same for courses of a part of a curve; less, since a part may lead around a finger."""

SAMPLES = 500
"""Number of points at which two curves are compared."""


def distinct_by_energy(
    surface: CurveSurface, curves: Sequence[DiscreteCurve], energies: Sequence[float]
) -> Iterator[int]:
    """Indices of curves by ascending energy, without those that equal a curve of less energy."""
    chosen: list[DiscreteCurve] = []
    for number in np.argsort(energies, kind="stable").tolist():
        if is_apart(surface, curves[number], chosen):
            chosen.append(curves[number])
            yield number


def is_apart(
    surface: CurveSurface,
    curve: DiscreteCurve,
    others: Sequence[DiscreteCurve],
    distance: float = SAME_COURSE,
) -> bool:
    """Whether a curve is somewhere apart from each of the others, by a share of the diagonal."""
    limit = distance * surface.mesh.diagonal
    positions = curve.nodes.positions
    return all(farthest_between(positions, other.nodes.positions) > limit for other in others)


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


def farthest_between(one: FloatArray, other: FloatArray) -> float:
    """Hausdorff distance between two sets of points, (n, 3) and (m, 3)."""
    return float(max(cKDTree(one).query(other)[0].max(), cKDTree(other).query(one)[0].max()))
