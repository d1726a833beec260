"""Whether control points are so close together that they determine the course of a curve.

They do if lines between them turn little, and a curve through them makes no detour and bends hardly
more than these lines.
"""

from __future__ import annotations

import numpy as np

from ..geometry.array_types import FloatArray
from ..geometry.vectors import cross, dot, lengths
from .curve_energies import scaled_bending
from .discrete_curve import DiscreteCurve

GREATEST_TURN = 1.0
"""Greatest of the `turns` of close points, except at corners, in radians."""

LONGEST_LEG = 1.25
"""Greatest length of a leg, relative to the distance between its ends in space."""

MORE_BENDING, FURTHER_BENDING = 1.5, 5.0
"""Greatest L ∮ κ_g² ds, relative to that of the lines between close points, and added to this."""


def turns(points: FloatArray, normals: FloatArray, closed: bool) -> FloatArray:
    """Angles in tangent planes between the lines from points to their two neighbours, in radians.

    Parameters
    ----------
    points, normals : (k, 3) float array
        Control points, and the normals of the surface there.
    closed : bool
        Whether the last point is followed by the first. Otherwise, the ends have no angle.

    Returns
    -------
    (k,) float array
        Zero where the next point lies straight ahead.
    """
    points, normals = points.T, normals.T
    leaving = np.roll(points, -1, axis=1) - points
    arriving = np.roll(leaving, 1, axis=1)
    leaving, arriving = (each - dot(each, normals) * normals for each in (leaving, arriving))
    angles = np.arctan2(lengths(cross(arriving, leaving)), dot(arriving, leaving))
    if not closed:
        angles[[0, -1]] = 0.0
    return angles


def has_short_legs(curve: DiscreteCurve) -> bool:
    """Whether a curve makes no detour between its control points."""
    controls, legs = curve.control_nodes, slice(None if curve.closed else -1)
    points = curve.nodes.positions[controls]
    apart = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
    return bool((_leg_lengths(curve)[legs] <= LONGEST_LEG * apart[legs]).all())


def bends_like_points(curve: DiscreteCurve) -> bool:
    """Whether a curve bends hardly more than the lines between its control points."""
    nodes, controls = curve.nodes, curve.control_nodes
    angles = turns(nodes.positions[controls], nodes.normals[controls], curve.closed)
    angles[np.isin(controls, curve.corner_nodes)] = 0.0
    leg_lengths = _leg_lengths(curve)
    of_points = 0.5 * (leg_lengths + np.roll(leg_lengths, 1))
    bending = curve.length * float((angles**2 / of_points).sum())
    return scaled_bending(curve) <= MORE_BENDING * bending + FURTHER_BENDING


def _leg_lengths(curve: DiscreteCurve) -> FloatArray:
    """Length of the leg after each control point, (k,); zero after the end of an open curve."""
    return np.add.reduceat(curve.nodes.step_lengths, curve.control_nodes)
