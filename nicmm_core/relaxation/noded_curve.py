"""Represents a curve as a polyline exactly on the mesh, with nodes that move it.

Each segment of the polyline lies in one face. The nodes are about equally spaced points of the
polyline. When they move, the polyline between them is replaced by straight traces over the faces.
Where a trace fails or crosses another one, its two nodes and the polyline between them stay as they
were. So the result is always a simple curve through the same control points in the same order.
"""

from __future__ import annotations

from dataclasses import dataclass

import nicmm_kernels
import numpy as np
from scipy.interpolate import CubicHermiteSpline, make_interp_spline

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.crossings import crossing_segments
from ..geometry.curve import SurfaceCurve, curve_on_mesh
from ..geometry.mesh import Mesh
from ..geometry.surface_points import SurfacePoints, in_faces, joined
from ..geometry.tracing import strictly_inside, trace_from
from ..progress import checkpoint
from .curve_nodes import CurveSurface, Nodes, nodes_at
from .node_spacing import arc_lengths, node_arcs
from .node_traces import step_limits

SAME_PLACE = 1e-5
"""Distance, relative to the curve's length, within which a new node replaces an old point."""

SHORT = 0.05
"""Length of a segment, relative to the mean distance between nodes, below which results omit it.

A tube along the curve would show such a segment as a notch.
"""


@dataclass(frozen=True)
class NodedCurve:
    """A polyline on the mesh and its nodes; the first point is a node.

    Attributes
    ----------
    nodes : Nodes
        The n nodes; all but the control points lie strictly inside faces.
    control_nodes : (k,) int array
        Indices of the control points among the nodes, in order.
    polyline : SurfacePoints
        Points of the polyline, each in the face of the segment after it.
    node_index : (n,) int array
        Index of each node in the polyline, ascending.
    """

    nodes: Nodes
    control_nodes: IntArray
    polyline: SurfacePoints
    node_index: IntArray

    @property
    def closed(self) -> bool:
        """Whether the last point joins the first."""
        return self.nodes.closed

    @property
    def length(self) -> float:
        """Sum of the distances between neighbouring nodes, in mesh units."""
        return float(self.nodes.lengths.sum())

    def surface_curve(self, mesh: Mesh) -> SurfaceCurve:
        """The polyline in the form of a result."""
        at_controls = self.node_index[self.control_nodes]
        polyline = self.polyline
        return curve_on_mesh(mesh, self.closed, polyline.faces, polyline.barycentric, at_controls)


def without_short_segments(mesh: Mesh, curve: NodedCurve) -> SurfaceCurve:
    """The polyline without nodes close to edges if it stays simple; otherwise the whole polyline.

    The neighbours of a node strictly inside a face can be joined within this face.
    """
    polyline = curve.polyline
    inside = np.zeros(len(polyline), dtype=bool)
    inside[np.delete(curve.node_index, curve.control_nodes)] = True
    inside &= (polyline.barycentric > 0.0).all(axis=1)
    inside[1:] &= ~inside[:-1]  # Of two consecutive nodes, one stays.
    positions = polyline.positions(mesh)
    length = np.linalg.norm(np.roll(positions, -1, axis=0) - positions, axis=1)
    short = length < SHORT * float(curve.nodes.lengths.mean())
    kept = ~(inside & (short | np.roll(short, 1)))
    if kept.all() or len(crossing_segments(mesh.faces, polyline[kept], curve.closed)):
        return curve.surface_curve(mesh)
    at_controls = (np.cumsum(kept) - 1)[curve.node_index[curve.control_nodes]]
    polyline = polyline[kept]
    return curve_on_mesh(mesh, curve.closed, polyline.faces, polyline.barycentric, at_controls)


def noded_curve(surface: CurveSurface, curve: SurfaceCurve, count: int) -> NodedCurve:
    """Place nodes on a curve that passes through its control points in order.

    Parameters
    ----------
    surface : CurveSurface
    curve : SurfaceCurve
    count : int
        Approximate number of nodes.
    """
    first = int(curve.control_index[0])
    faces, barycentric = np.roll(curve.faces, -first), np.roll(curve.barycentric, -first, axis=0)
    control_index = (curve.control_index - first) % len(faces)
    polyline = SurfacePoints(faces, barycentric)
    return _with_nodes(surface, polyline, control_index, count, curve.closed)


def noded(
    surface: CurveSurface, places: SurfacePoints, control_nodes: IntArray, closed: bool
) -> NodedCurve:
    """A curve that consists of nodes alone, before anything is traced between them."""
    nodes = nodes_at(surface, places, closed)
    return NodedCurve(nodes, control_nodes, places, np.arange(len(places)))


def respaced(surface: CurveSurface, curve: NodedCurve, count: int) -> NodedCurve:
    """The same polyline with about `count` equally spaced nodes."""
    at_controls = curve.node_index[curve.control_nodes]
    return _with_nodes(surface, curve.polyline, at_controls, count, curve.closed)


def smoothed(surface: CurveSurface, coarse: NodedCurve, fine: NodedCurve) -> NodedCurve:
    """Move fine nodes onto a smooth curve through the coarse nodes of the same polyline.

    Between coarse nodes the polyline is straight. So with four times as many nodes it bends only at
    a quarter of them, which costs four times the bending energy. A cubic spline through the coarse
    nodes gives the moves of the fine nodes along their conormals.

    Parameters
    ----------
    surface : CurveSurface
    coarse : NodedCurve
        A simple curve.
    fine : NodedCurve
        The same polyline with more nodes.

    Returns
    -------
    NodedCurve
        A simple curve. Nodes that cannot be moved stay where they are, and all nodes do if two
        coarse nodes coincide.
    """
    at, total = _arc_lengths(surface.mesh, coarse)
    through = coarse.nodes.positions
    if coarse.closed:
        at, through = np.append(at, total), np.concatenate([through, through[:1]])
    if (np.diff(at) <= 0.0).any():
        return fine  # There is no slope between nodes that coincide.
    chord = np.diff(through, axis=0) / np.diff(at)[:, None]
    slope = 0.5 * (np.concatenate([chord[:1], chord]) + np.concatenate([chord, chord[-1:]]))
    if coarse.closed:
        slope[[0, -1]] = 0.5 * (chord[0] + chord[-1])
    along = _arc_lengths(surface.mesh, fine)[0]
    straight = make_interp_spline(at, through, k=1)(along)
    aside = CubicHermiteSpline(at, through, slope)(along) - straight
    step = (aside * fine.nodes.conormals).sum(axis=1)
    step[fine.control_nodes] = 0.0
    return retraced(surface, fine, moved_along_conormals(surface, fine.nodes, step)[0])[0]


def _arc_lengths(mesh: Mesh, curve: NodedCurve) -> tuple[FloatArray, float]:
    """Arc lengths at the nodes, (n,), and the length of the whole polyline."""
    arc = arc_lengths(curve.polyline.positions(mesh), curve.closed)
    return arc[curve.node_index], float(arc[-1])


def moved_along_conormals(
    surface: CurveSurface, nodes: Nodes, step: FloatArray
) -> tuple[Nodes, BoolArray, int]:
    """Move nodes along `Nodes.conormals` by signed lengths, (n,); returns the same as `shifted`."""
    return shifted(surface, nodes, nodes.conormals * np.sign(step)[:, None], np.abs(step))


def shifted(
    surface: CurveSurface, nodes: Nodes, direction: FloatArray, length: FloatArray
) -> tuple[Nodes, BoolArray, int]:
    """Move nodes over the surface, without tracing the polyline between them.

    Parameters
    ----------
    surface : CurveSurface
    nodes : Nodes
    direction : (n, 3) float array
        Unit vectors approximately tangent to the surface; ignored where the length is zero.
    length : (n,) float array
        Distances to move; zero at control points.

    Returns
    -------
    Nodes
        The moved nodes, with new normals and φ_fea.
    (n,) bool array
        Which nodes reached a boundary and stopped next to it.
    int
        Greatest number of faces that a node has passed.
    """
    places, blocked, passed = trace_from(
        surface.mesh, nodes.places, direction, length, surface.folded
    )
    return nodes_at(surface, places, nodes.closed, nodes.curves), blocked, passed


def is_simple(surface: CurveSurface, curve: NodedCurve) -> bool:
    """Whether the curve neither crosses nor touches itself."""
    return not len(crossing_segments(surface.mesh.faces, curve.polyline, curve.closed))


def traced_through(
    surface: CurveSurface, curve: NodedCurve, nodes: Nodes, still: BoolArray | None = None
) -> NodedCurve | None:
    """The curve traced through nodes at new places, simple or not; None if a trace fails.

    Between two consecutive nodes that have not moved, `still` (n,), the polyline is kept.
    """
    kept = np.zeros(len(nodes.positions), dtype=bool)
    if still is not None:
        kept = still & np.roll(still, -1)
        if not curve.closed:
            kept[-1] = False
    polyline, node_index, lost = _traced_polyline(surface, curve, nodes, kept)
    if lost.any():
        return None
    return NodedCurve(nodes, curve.control_nodes, polyline, node_index)


def straight_traces(
    surface: CurveSurface, curve: NodedCurve, nodes: Nodes
) -> tuple[SurfacePoints, IntArray, BoolArray]:
    """The polyline of straight traces between nodes at new places; see `_traced_polyline`."""
    return _traced_polyline(surface, curve, nodes, np.zeros(len(nodes.positions), dtype=bool))


def retraced(
    surface: CurveSurface, curve: NodedCurve, nodes: Nodes
) -> tuple[NodedCurve, BoolArray]:
    """Retrace a curve through nodes at new places, wherever it stays simple.

    Parameters
    ----------
    surface : CurveSurface
    curve : NodedCurve
        A simple curve.
    nodes : Nodes
        Its n nodes at new places; control points have not moved.

    Returns
    -------
    NodedCurve
        A simple curve.
    (n,) bool array
        Which nodes were put back to their old places.
    """
    old, new = curve.nodes.places, nodes.places
    stays = np.zeros(len(old), dtype=bool)
    kept = np.zeros(len(old), dtype=bool)
    while True:
        checkpoint()
        if stays.any():
            places = SurfacePoints(
                np.where(stays, old.faces, new.faces),
                np.where(stays[:, None], old.barycentric, new.barycentric),
            )
            nodes = nodes_at(surface, places, curve.closed)
        polyline, node_index, bad = _traced_polyline(surface, curve, nodes, kept)
        if not bad.any():
            pairs = crossing_segments(surface.mesh.faces, polyline, curve.closed)
            bad[np.searchsorted(node_index, pairs.ravel(), side="right") - 1] = True
        if not bad.any():
            return NodedCurve(nodes, curve.control_nodes, polyline, node_index), stays
        if not (bad & ~kept).any():
            return curve, np.ones(len(old), dtype=bool)
        kept |= bad
        stays |= bad | np.roll(bad, 1)


def _with_nodes(
    surface: CurveSurface,
    polyline: SurfacePoints,
    control_index: IntArray,
    count: int,
    closed: bool,
) -> NodedCurve:
    """Insert equally spaced nodes on each leg and drop old points inside faces at their places."""
    mesh, n = surface.mesh, len(polyline)
    arc = arc_lengths(polyline.positions(mesh), closed)
    at, control_nodes = node_arcs(surface, polyline, arc, control_index, count, closed)
    n_segments = len(arc) - 1
    segment = np.clip(np.searchsorted(arc, at, side="right") - 1, 0, n_segments - 1)
    along = (at - arc[segment]) / np.maximum(np.diff(arc)[segment], tolerances.TINY)
    along = np.clip(along, 0.0, 1.0)[:, None]
    faces = polyline.faces[segment]
    end = in_faces(mesh, polyline[(segment + 1) % n], faces).barycentric
    barycentric = strictly_inside((1.0 - along) * polyline.barycentric[segment] + along * end)
    faces[control_nodes] = polyline.faces[control_index]
    barycentric[control_nodes] = polyline.barycentric[control_index]
    places = SurfacePoints(faces, barycentric)

    # All other old points remain, so the polyline keeps its shape.
    inside = (polyline.barycentric > 0.0).all(axis=1)
    nodes_along = np.append(at, arc[-1])
    ahead = np.searchsorted(nodes_along, arc[:n]).clip(max=len(at))
    nearest = np.minimum(nodes_along[ahead] - arc[:n], arc[:n] - nodes_along[ahead - 1])
    nearest = np.where(ahead > 0, nearest, 0.0)
    dropped = inside & (nearest < SAME_PLACE * arc[-1])
    dropped[control_index] = True
    old = np.flatnonzero(~dropped)
    # A node is sorted after the start of its segment, even if both are at the same place.
    segment[control_nodes] = control_index
    before = np.concatenate([segment, old])
    order = np.lexsort((np.concatenate([at, np.full(len(old), -np.inf)]), before))
    merged = joined([places, polyline[old]])[order]
    node_index = np.flatnonzero(order < len(at))
    nodes = nodes_at(surface, places, closed)
    return NodedCurve(nodes, control_nodes, merged, node_index)


def _traced_polyline(
    surface: CurveSurface, curve: NodedCurve, nodes: Nodes, kept: BoolArray
) -> tuple[SurfacePoints, IntArray, BoolArray]:
    """The polyline traced through nodes at new places.

    Parameters
    ----------
    surface : CurveSurface
    curve : NodedCurve
    nodes : Nodes
        The n nodes at new places.
    kept : (n,) bool array
        Nodes after which the polyline is kept; neither they nor the next nodes have moved.

    Returns
    -------
    SurfacePoints
        The polyline.
    (n,) int array
        Index of each node in the polyline.
    (n,) bool array
        Nodes whose trace to the next node failed; there the polyline has no points in between.
    """
    controls = np.zeros(len(nodes.positions), dtype=bool)
    controls[curve.control_nodes] = True
    checkpoint()
    faces, barycentric, node_index, lost = nicmm_kernels.trace_polyline(
        surface.for_kernels,
        nodes.for_kernels,
        nodes.places.for_kernels,
        controls,
        kept,
        np.ascontiguousarray(curve.node_index, np.int64),
        curve.polyline.for_kernels,
        step_limits(surface),
        checkpoint,
    )
    return SurfacePoints(faces, barycentric), node_index, lost
