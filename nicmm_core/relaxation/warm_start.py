"""Starts the relaxation from a relaxed curve: moves its control points, or lets only a part move.

The move of a node decreases smoothly with its distance from the control point, so that relaxation
starts from a curve without a kink. This works for small moves only; `start` rejects others. If only
the weights of a map have changed, only the nodes near these weights move.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.mesh import Mesh
from ..geometry.surface_points import SurfacePoints
from .curve_nodes import CurveSurface, Nodes, nodes_at
from .discrete_curve import DiscreteCurve, is_simple, shifted, traced_through
from .relaxing import Movable, RelaxationConfig

WARM = RelaxationConfig(
    levels=(512,),
    steps=1,
    longest_move=4.0,
    least_decrease=1e-3,
    defer_tracing=True,
)
"""Settings of the relaxation of a curve that has enough nodes and has nearly converged.

Since tracing is deferred, an iteration consists of only one step.
"""

REACH = 0.2
"""Distance from changed weights of a map up to which a curve may move.

It is relative to the diagonal or to √area, whichever is larger. The reach of a map is relative to
√area.
"""

LONGEST_MOVE = 0.1
"""Greatest distance that a control point may have moved, relative to the curve's length."""

FOLLOW_RADIUS = 4.0
"""Arc length within which nodes move along with a control point, relative to its move."""


def with_moved_controls(
    surface: CurveSurface, curve: DiscreteCurve, controls: SurfacePoints
) -> DiscreteCurve | None:
    """Move the control points of a curve to new places nearby, and nearby nodes with them.

    Parameters
    ----------
    surface : CurveSurface
    curve : DiscreteCurve
        A simple curve that passes through its control points in order.
    controls : SurfacePoints
        New places of the control points, in the order visited.

    Returns
    -------
    DiscreteCurve or None
        A simple curve; None if the moves are too large to give one.
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
    # Between nodes that do not move the polyline is kept, since a straight trace may fail there.
    moved_nodes = nodes_at(surface, places, curve.closed, corners=nodes.corners)
    changed = traced_through(surface, curve, moved_nodes, still)
    if changed is None or not is_simple(surface, changed):
        return None
    return changed


def _shifts(nodes: Nodes, at_controls: IntArray, move: FloatArray) -> FloatArray:
    """Shift of each node due to the moves of nearby control points, (n, 3)."""
    total = float(nodes.lengths.sum())
    arc = np.concatenate([[0.0], np.cumsum(nodes.lengths)])[: len(nodes.positions)]
    shift = np.zeros((len(arc), 3))
    for here, vector in zip(arc[at_controls], move, strict=True):
        reach = FOLLOW_RADIUS * np.linalg.norm(vector)
        if reach > 0.0:
            away = np.abs(arc - here)
            if nodes.closed:
                away = np.minimum(away, total - away)
            share = np.clip(1.0 - away / reach, 0.0, 1.0)
            shift += (share * share * (3.0 - 2.0 * share))[:, None] * vector
    return shift


def movable_near(mesh: Mesh, vertices: IntArray, unit: float) -> Movable:
    """Let only the nodes near some vertices of a mesh move; `unit` is √area."""
    reach = REACH * max(mesh.diagonal, unit)
    if not len(vertices):
        return lambda positions: np.zeros(len(positions), dtype=bool)
    tree = cKDTree(mesh.vertices[vertices])

    def movable(positions: FloatArray) -> BoolArray:
        near: BoolArray = tree.query(positions, distance_upper_bound=reach)[0] <= reach
        return near

    return movable
