"""Start from the curve before: its control points move, and the curve beside them with them.

A point that is dragged takes the nearby nodes along, less and less with their distance, so that
relaxation starts from a curve without a kink. It works for small moves; others start anew.
"""

from __future__ import annotations

import numpy as np

from ..geometry import tolerances
from ..geometry.array_types import FloatArray, IntArray
from ..geometry.surface_points import SurfacePoints
from .curve_nodes import CurveSurface, Nodes, nodes_at
from .levenberg_marquardt import StepConfig
from .noded_curve import NodedCurve, is_simple, shifted, traced_through
from .relaxing import RelaxationConfig

WARM = RelaxationConfig(
    levels=(512,),
    stepping=StepConfig(steps=1, longest_move=4.0),
    least_decrease=1e-3,
    defer_tracing=True,
)
"""Relaxation from there: the curve has enough nodes and has nearly converged.

Nothing is traced on the way, so that an iteration is one step.
"""

LONGEST_MOVE = 0.1
"""Farthest that a control point may have moved, relative to the curve's length."""

TAKEN_ALONG = 4.0
"""Distance along the curve up to which nodes move with a control point, in moves."""


def moved_along(
    surface: CurveSurface, curve: NodedCurve, controls: SurfacePoints
) -> NodedCurve | None:
    """A curve with its control points at new places nearby.

    Parameters
    ----------
    surface : CurveSurface
    curve : NodedCurve
        Simple, and through its control points in order.
    controls : SurfacePoints
        The new places, in the order visited.

    Returns
    -------
    NodedCurve or None
        Simple; None where the moves are too far for that.
    """
    mesh = surface.mesh
    nodes, at_controls = curve.nodes, curve.control_nodes
    move = controls.positions(mesh) - nodes.positions[at_controls]
    moves = move.any(axis=1)
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
    changed = traced_through(surface, curve, nodes_at(surface, places, curve.closed), still)
    if changed is None or not is_simple(surface, changed):
        return None
    return changed


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
