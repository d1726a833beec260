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

WIDEST_DETOUR = 4.0
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
    if np.linalg.norm(move, axis=1).max() > LONGEST_MOVE * float(nodes.lengths.sum()):
        return None
    shift = _shifts(nodes, at_controls, move)
    shift -= (shift * nodes.normals).sum(axis=1, keepdims=True) * nodes.normals
    length = np.linalg.norm(shift, axis=1)
    length[at_controls] = 0.0
    direction = shift / np.maximum(length, tolerances.TINY)[:, None]
    places = shifted(surface, nodes, direction, length)[0].places
    faces, barycentric = places.faces.copy(), places.barycentric.copy()
    faces[at_controls], barycentric[at_controls] = controls.faces, controls.barycentric
    places = SurfacePoints(faces, barycentric)
    changed = drawn(surface, curve, nodes_at(surface, places, curve.closed))
    if changed is None or not is_simple(surface, changed):
        return None
    return changed


def part_of_the_way(
    surface: CurveSurface, curve: ExactCurve, controls: SurfacePoints, farthest: float
) -> SurfacePoints | None:
    """Control points between those of a curve and new places, on straight ways over the faces.

    Parameters
    ----------
    surface : CurveSurface
    curve : ExactCurve
    controls : SurfacePoints
        The new places, in the order visited.
    farthest : float
        How far they go, relative to the curve's length; at least to the next edge.

    Returns
    -------
    SurfacePoints or None
        None where there is no such way that is not much of a detour.
    """
    mesh, nodes = surface.mesh, curve.nodes
    longest = farthest * float(nodes.lengths.sum())
    starts = nodes.places[curve.control_nodes]
    away = np.linalg.norm(controls.positions(mesh) - starts.positions(mesh), axis=1)
    faces, barycentric = controls.faces.copy(), controls.barycentric.copy()
    for far in np.flatnonzero(away > longest):
        here = np.array([far])
        start = SurfacePoints(starts.faces[here], strictly_inside(starts.barycentric[here]))
        normals = nodes.normals[curve.control_nodes[here]]
        ends = nodes_at(surface, controls[here], curve.closed).normals
        plane = normals + np.sign((normals * ends).sum() or 1.0) * ends
        way = join(mesh, start, controls[here], plane, WIDEST_DETOUR)
        if not way.reached.all() or not len(way.crossings):
            return None
        line = np.concatenate([start.positions(mesh), way.crossings.positions(mesh)])
        gone = np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))
        at = max(int(np.searchsorted(gone, longest, side="right")) - 1, 0)
        faces[far], barycentric[far] = way.crossings.faces[at], way.crossings.barycentric[at]
    return SurfacePoints(faces, barycentric)


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
