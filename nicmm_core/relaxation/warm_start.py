"""Start from the curve before: its control points move, and the curve beside them with them.

A point that is dragged takes the nearby nodes along, less and less with their distance, so that
relaxation starts from a curve without a kink. It works for small moves; others start anew.
"""

from __future__ import annotations

import numpy as np

from .. import tolerances
from ..array_types import FloatArray, IntArray
from ..surface_points import SurfacePoints
from .curve_nodes import CurveSurface, Nodes, nodes_at
from .exact_curve import ExactCurve, drawn, is_simple, shifted
from .face_walks import join, strictly_inside
from .relaxing import RelaxationConfig

WARM = RelaxationConfig(levels=(512,), least_decrease=1e-3, drawn_at_rest=True)
"""Relaxation from there: the curve is fine already and near its rest."""

LONGEST_MOVE = 0.1
"""Farthest that a control point may have moved, relative to the curve's length."""

WIDEST_DETOUR = 1.5
"""Longest way of a control point over the faces, relative to its move in space."""

TAKEN_ALONG = 4.0
"""Distance along the curve up to which nodes move with a control point, in moves."""


def moved_along(
    surface: CurveSurface, curve: ExactCurve, controls: SurfacePoints
) -> ExactCurve | None:
    """A curve with its control points at new places nearby.

    Parameters
    ----------
    surface : CurveSurface
    curve : ExactCurve
        Simple, and through its control points in order.
    controls : SurfacePoints
        The new places, in the order visited.

    Returns
    -------
    ExactCurve or None
        Simple; None where the moves are too far for that.
    """
    mesh = surface.mesh
    nodes, at_controls = curve.nodes, curve.control_nodes
    move = controls.positions(mesh) - nodes.positions[at_controls]
    away = np.linalg.norm(move, axis=1)
    if away.max() > LONGEST_MOVE * float(nodes.lengths.sum()):
        return None
    moves = away > 0.0
    shift = _shifts(nodes, at_controls, move)
    shift -= (shift * nodes.normals).sum(axis=1, keepdims=True) * nodes.normals
    length = np.linalg.norm(shift, axis=1)
    length[at_controls] = 0.0
    direction = shift / np.maximum(length, tolerances.TINY)[:, None]
    places = shifted(surface, nodes, direction, length)[0].places
    faces, barycentric = places.faces.copy(), places.barycentric.copy()
    going = at_controls[moves]
    faces[going], barycentric[going] = controls.faces[moves], controls.barycentric[moves]
    still = length == 0.0
    still[going] = False
    places = SurfacePoints(faces, barycentric)
    # A stretch that once could not be drawn straight stays as it is where nothing moves.
    changed = drawn(surface, curve, nodes_at(surface, places, curve.closed), still)
    if changed is None or not is_simple(surface, changed):
        return None
    return changed


def part_of_the_way(
    surface: CurveSurface, curve: ExactCurve, controls: SurfacePoints, farthest: float
) -> SurfacePoints | None:
    """Control points that go from those of a curve towards new places, over the faces.

    Parameters
    ----------
    surface : CurveSurface
    curve : ExactCurve
    controls : SurfacePoints
        The new places, in the order visited.
    farthest : float
        How far they go, relative to the curve's length.

    Returns
    -------
    SurfacePoints or None
        None where no straight way leads to one of them without much of a detour.
    """
    mesh, nodes = surface.mesh, curve.nodes
    longest = farthest * float(nodes.lengths.sum())
    starts = nodes.places[curve.control_nodes]
    origins, goals = starts.positions(mesh), controls.positions(mesh)
    faces, barycentric = controls.faces.copy(), controls.barycentric.copy()
    for far in np.flatnonzero(np.linalg.norm(goals - origins, axis=1) > longest):
        here = np.array([far])
        start = SurfacePoints(starts.faces[here], strictly_inside(starts.barycentric[here]))
        line = _way_over_faces(surface, curve, start, controls[here], here)
        if line is None:
            return None
        gone = np.linalg.norm(np.diff(line.positions(mesh), axis=0, prepend=origins[here]), axis=1)
        at = max(int(np.searchsorted(np.cumsum(gone), longest, side="right")) - 1, 0)
        faces[far], barycentric[far] = line.faces[at], line.barycentric[at]
    return SurfacePoints(faces, barycentric)


def _way_over_faces(
    surface: CurveSurface,
    curve: ExactCurve,
    start: SurfacePoints,
    goal: SurfacePoints,
    control: IntArray,
) -> SurfacePoints | None:
    """Where the straight way of one control point crosses edges; None where none leads there."""
    normals = curve.nodes.normals[curve.control_nodes[control]]
    ends = nodes_at(surface, goal, curve.closed).normals
    plane = normals + np.sign((normals * ends).sum() or 1.0) * ends
    way = join(surface.mesh, start, goal, plane, WIDEST_DETOUR)
    return way.crossings if way.reached.all() and len(way.crossings) else None


def _shifts(nodes: Nodes, at_controls: IntArray, move: FloatArray) -> FloatArray:
    """How far each node is taken along, (n, 3): by the control points before and after it."""
    total = float(nodes.lengths.sum())
    arc = np.concatenate([[0.0], np.cumsum(nodes.lengths)])[: len(nodes.positions)]
    shift = np.zeros((len(arc), 3))
    for here, vector in zip(arc[at_controls], move, strict=True):
        reach = TAKEN_ALONG * np.linalg.norm(vector)
        if reach > 0.0:
            away = np.abs(arc - here)
            if nodes.closed:
                away = np.minimum(away, total - away)
            share = np.clip(1.0 - away / reach, 0.0, 1.0)
            shift += (share * share * (3.0 - 2.0 * share))[:, None] * vector
    return shift
