"""Curves to avoid, with their junctions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..geometry import tolerances
from ..geometry.array_types import FloatArray, IntArray
from ..geometry.curve import SurfaceCurve, arc_lengths, checked_curve, weights_in_faces
from ..geometry.curve_places import nearest_segment
from ..geometry.mesh import Mesh
from ..geometry.segment_distances import FaceSegments
from ..geometry.surface_points import SurfacePoints
from ..repair.divided_faces import side_lengths

FADE = 2.0
"""Length of an avoided curve, on either side of a junction, without clearance; in clearances."""

GAP = 0.02
"""Half the width of the gap at a junction, as a fraction of the longest edge there."""

GAP_OF_CLEARANCE = 0.5
"""Greatest half width of a gap, in clearances."""


@dataclass(frozen=True)
class Avoided:
    """A curve to avoid, checked, with its junctions.

    Attributes
    ----------
    curve : SurfaceCurve
        A curve on the given mesh.
    segment_faces : (n,) int array
        A face that contains each point and the next one.
    junctions : (j,) float array
        Arc lengths from its first point at which control points lie.
    """

    curve: SurfaceCurve
    segment_faces: IntArray
    junctions: FloatArray

    def equals(self, other: Avoided) -> bool:
        """Whether two curves and their junctions are the same."""
        return (
            self.curve.closed == other.curve.closed
            and np.array_equal(self.curve.faces, other.curve.faces)
            and np.array_equal(self.curve.barycentric, other.curve.barycentric)
            and np.array_equal(self.junctions, other.junctions)
        )

    @cached_property
    def arcs(self) -> FloatArray:
        """Arc length at the beginning of each segment, and the total length."""
        return arc_lengths(self.curve.steps)

    def pieces(self, mesh: Mesh, breaks: FloatArray) -> tuple[FaceSegments, FloatArray]:
        """The segments of the curve, divided at some arc lengths.

        Returns
        -------
        FaceSegments
        (s,) float array
            Arc length in the middle of each.
        """
        arcs, curve = self.arcs, self.curve
        total, count = arcs[-1], len(arcs) - 1
        breaks = breaks % total if curve.closed else breaks
        breaks = np.unique(breaks[(breaks > 0.0) & (breaks < total)])
        breaks = breaks[~np.isin(breaks, arcs)]
        at = np.sort(np.concatenate([arcs, breaks]))
        segment = (np.searchsorted(arcs, at[:-1], side="right") - 1).clip(0, count - 1)
        length = np.maximum(arcs[segment + 1] - arcs[segment], tolerances.TINY)
        faces = self.segment_faces[segment]
        following = (segment + 1) % len(curve.faces)
        low, high = (
            weights_in_faces(mesh, curve.faces[ends], curve.barycentric[ends], faces)
            for ends in (segment, following)
        )
        begin, stop = (
            ((each - arcs[segment]) / length).clip(0.0, 1.0)[:, None] for each in (at[:-1], at[1:])
        )
        found = FaceSegments(
            faces, (1.0 - begin) * low + begin * high, (1.0 - stop) * low + stop * high
        )
        return found, 0.5 * (at[:-1] + at[1:])

    def positions(self, arc: FloatArray) -> FloatArray:
        """Positions at arc lengths, (s, 3)."""
        curve, arcs = self.curve, self.arcs
        line = np.concatenate([curve.points, curve.points[:1]]) if curve.closed else curve.points
        return np.stack([np.interp(arc, arcs, line[:, axis]) for axis in range(3)], axis=1)

    def from_junctions(self, arc: FloatArray) -> FloatArray:
        """Distance along the curve from arc lengths, (s,), to the nearest junction."""
        if not len(self.junctions):
            return np.full(len(arc), np.inf)
        away = np.abs(arc[:, None] - self.junctions)
        if self.curve.closed:
            away = np.minimum(away, self.arcs[-1] - away)
        return away.min(axis=1)

    def ends(self, reach: FloatArray | float) -> FloatArray:
        """Arc lengths at a distance from each junction, on either side."""
        return np.concatenate([self.junctions - reach, self.junctions + reach])


def avoided_curves(
    mesh: Mesh, curves: Sequence[SurfaceCurve], points: SurfacePoints
) -> list[Avoided]:
    """Curves to avoid, with the control points on them as junctions."""
    return [_avoided_curve(mesh, curve, points) for curve in curves]


def _avoided_curve(mesh: Mesh, curve: SurfaceCurve, points: SurfacePoints) -> Avoided:
    curve, segment_faces = checked_curve(mesh, curve, across_gaps=True)
    found = Avoided(curve, segment_faces, np.zeros(0))
    within = tolerances.COINCIDENT * mesh.diagonal
    junctions = []
    for position in points.positions(mesh):
        segment, share, away = nearest_segment(curve, position)
        if away <= within:
            arcs = found.arcs[segment : segment + 2]
            junctions.append((1.0 - share) * arcs[0] + share * arcs[1])
    return replace(found, junctions=np.array(junctions))


def gap_width(mesh: Mesh, avoided: Avoided, arc: float, clearance: float) -> float:
    """Half the width of the gap at a junction."""
    segment = int(
        (np.searchsorted(avoided.arcs, arc, side="right") - 1).clip(0, len(avoided.arcs) - 2)
    )
    corners = mesh.faces[avoided.segment_faces[segment]]
    width = GAP * float(side_lengths(mesh.vertices, mesh.faces[mesh.faces_at(corners)]).max())
    return min(width, GAP_OF_CLEARANCE * clearance) if clearance > 0.0 else width
