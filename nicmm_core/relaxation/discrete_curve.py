"""Represents a curve as a polyline exactly on the mesh, with nodes that move it.

Each segment of the polyline lies in one face. The nodes are about equally spaced points of the
polyline. When they move, the polyline between them is replaced by straight traces over the faces.
Where a trace fails or crosses another one, its two nodes and the polyline between them stay as they
were. So the result is always a simple curve through the same control points in the same order.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import nicmm_kernels
import numpy as np

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.crossings import crossing_segments
from ..geometry.curve import SurfaceCurve, curve_on_mesh
from ..geometry.mesh import Mesh
from ..geometry.surface_points import SurfacePoints
from ..geometry.tracing import trace_from
from ..progress import checkpoint
from .curve_nodes import CurveSurface, Nodes, nodes_at
from .node_traces import step_limits

SAME_PLACE = 1e-5
"""Distance, relative to the curve's length, within which a new node replaces an old point."""

FEWEST_OF_A_LEG = 6
"""Least number of nodes on a leg, including the control point at its start."""

REACH = 3.0
"""Length of curve on either side over which its direction is measured at folds, in mean edge
lengths."""

SHORTEST_TURN = 1.0 / 16.0
"""Upper limit of that length, relative to the length of the curve."""

SHORT = 0.05
"""Length of a segment, relative to the mean distance between nodes, below which results omit it.

A tube along the curve would show such a segment as a notch.
"""


@dataclass(frozen=True)
class DiscreteCurve:
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

    @property
    def corner_nodes(self) -> IntArray:
        """Indices of the nodes at which the curve may turn freely."""
        corners = self.nodes.corners
        return np.zeros(0, dtype=np.int64) if corners is None else np.flatnonzero(corners)

    @property
    def for_kernels(self) -> nicmm_kernels.CurveArrays:
        """The curve as compiled kernels read it."""
        corners = self.nodes.corners
        is_control = np.zeros(len(self.node_index), dtype=bool)
        is_control[self.control_nodes] = True
        return nicmm_kernels.CurveArrays(
            self.closed,
            *self.nodes.places.for_kernels,
            is_control,
            np.zeros(len(is_control), dtype=bool) if corners is None else corners,
            np.ascontiguousarray(self.node_index, np.int64),
            *self.polyline.for_kernels,
        )

    def with_corners(self, corners: BoolArray) -> DiscreteCurve:
        """The same curve, which may turn freely at some of the control points, (k,)."""
        if not corners.any():
            return replace(self, nodes=replace(self.nodes, corners=None))
        at_nodes = np.zeros(len(self.node_index), dtype=bool)
        at_nodes[self.control_nodes] = corners
        return replace(self, nodes=replace(self.nodes, corners=at_nodes))

    def surface_curve(self, mesh: Mesh) -> SurfaceCurve:
        """The polyline in the form of a result."""
        at_controls = self.node_index[self.control_nodes]
        polyline = self.polyline
        return curve_on_mesh(mesh, self.closed, polyline.faces, polyline.barycentric, at_controls)


def without_short_segments(mesh: Mesh, curve: DiscreteCurve) -> SurfaceCurve:
    """The polyline without nodes close to edges if it stays simple; otherwise the whole polyline.

    The neighbours of a node strictly inside a face can be joined within this face.
    """
    return without_points(mesh, curve, short_segments(mesh, curve))


def short_segments(mesh: Mesh, curve: DiscreteCurve) -> BoolArray:
    """Which points of the polyline are nodes at short segments; no two consecutive ones."""
    polyline = curve.polyline
    inside = np.zeros(len(polyline), dtype=bool)
    inside[np.delete(curve.node_index, curve.control_nodes)] = True
    inside &= (polyline.barycentric > 0.0).all(axis=1)
    inside[1:] &= ~inside[:-1]  # Of two consecutive nodes, one stays.
    positions = polyline.positions(mesh)
    length = np.linalg.norm(np.roll(positions, -1, axis=0) - positions, axis=1)
    short = length < SHORT * float(curve.nodes.lengths.mean())
    near_edges: BoolArray = inside & (short | np.roll(short, 1))
    return near_edges


def without_points(mesh: Mesh, curve: DiscreteCurve, left_out: BoolArray) -> SurfaceCurve:
    """The polyline without some nodes, if it stays simple; otherwise the whole polyline."""
    polyline, kept = curve.polyline, ~left_out
    if kept.all() or len(crossing_segments(mesh.faces, polyline[kept], curve.closed)):
        return curve.surface_curve(mesh)
    at_controls = (np.cumsum(kept) - 1)[curve.node_index[curve.control_nodes]]
    polyline = polyline[kept]
    return curve_on_mesh(mesh, curve.closed, polyline.faces, polyline.barycentric, at_controls)


def place_nodes(
    surface: CurveSurface, curve: SurfaceCurve, count: int, corners: BoolArray | None = None
) -> DiscreteCurve:
    """Place nodes on a curve that passes through its control points in order.

    Parameters
    ----------
    surface : CurveSurface
    curve : SurfaceCurve
    count : int
        Approximate number of nodes.
    corners : (k,) bool array, optional
        Control points at which the curve may turn freely.
    """
    first = int(curve.control_index[0])
    faces, barycentric = np.roll(curve.faces, -first), np.roll(curve.barycentric, -first, axis=0)
    placed = nicmm_kernels.place_on_polyline(
        surface.for_kernels,
        *SurfacePoints(faces, barycentric).for_kernels,
        curve.closed,
        (curve.control_index - first) % len(faces),
        np.zeros(len(curve.control_index), dtype=bool) if corners is None else corners,
        count,
        placement_rules(surface),
    )
    return curve_from_kernels(surface, placed)


def curve_from_kernels(surface: CurveSurface, given: nicmm_kernels.CurveArrays) -> DiscreteCurve:
    """A curve that a compiled kernel has found."""
    places = SurfacePoints(given.faces, given.barycentric)
    corners = given.is_corner if given.is_corner.any() else None
    nodes = nodes_at(surface, places, given.closed, corners=corners)
    polyline = SurfacePoints(given.polyline_faces, given.polyline_barycentric)
    return DiscreteCurve(nodes, np.flatnonzero(given.is_control), polyline, given.node_index)


def placement_rules(surface: CurveSurface) -> nicmm_kernels.PlacementRules:
    """How nodes are placed on polylines: evenly on each leg, but not inside folds."""
    reach = REACH * surface.mesh.mean_edge_length
    return nicmm_kernels.PlacementRules(
        tolerances.INSIDE, SAME_PLACE, reach, SHORTEST_TURN, FEWEST_OF_A_LEG
    )


def noded(
    surface: CurveSurface, places: SurfacePoints, control_nodes: IntArray, closed: bool
) -> DiscreteCurve:
    """A curve that consists of nodes alone, before anything is traced between them."""
    nodes = nodes_at(surface, places, closed)
    return DiscreteCurve(nodes, control_nodes, places, np.arange(len(places)))


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
    moved = nodes_at(surface, places, nodes.closed, nodes.curves, nodes.corners)
    return moved, blocked, passed


def is_simple(surface: CurveSurface, curve: DiscreteCurve) -> bool:
    """Whether the curve neither crosses nor touches itself."""
    return not len(crossing_segments(surface.mesh.faces, curve.polyline, curve.closed))


def traced_through(
    surface: CurveSurface, curve: DiscreteCurve, nodes: Nodes, still: BoolArray | None = None
) -> DiscreteCurve | None:
    """The curve traced through nodes at new places, simple or not; None if a trace fails.

    Between two consecutive nodes that have not moved, `still` (n,), the polyline is kept.
    """
    kept = None if still is None else still & np.roll(still, -1)
    polyline, node_index, lost = traced_polyline(surface, curve, nodes, kept)
    if lost.any():
        return None
    return DiscreteCurve(nodes, curve.control_nodes, polyline, node_index)


def traced_polyline(
    surface: CurveSurface, curve: DiscreteCurve, nodes: Nodes, kept: BoolArray | None = None
) -> tuple[SurfacePoints, IntArray, BoolArray]:
    """The polyline of straight traces between nodes at new places.

    Parameters
    ----------
    surface : CurveSurface
    curve : DiscreteCurve
    nodes : Nodes
        The n nodes at new places.
    kept : (n,) bool array, optional
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
    checkpoint()
    before = curve.for_kernels
    faces, barycentric, node_index, lost = nicmm_kernels.trace_polyline(
        surface.for_kernels,
        nodes.for_kernels,
        nodes.places.for_kernels,
        before.is_control,
        np.zeros(len(before.is_control), dtype=bool) if kept is None else kept,
        before.node_index,
        (before.polyline_faces, before.polyline_barycentric),
        step_limits(surface),
        checkpoint,
    )
    return SurfacePoints(faces, barycentric), node_index, lost
