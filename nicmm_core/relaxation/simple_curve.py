"""Joins nodes to a simple curve on a mesh.

Nodes are joined by straight traces. Where the surface is too rough for a trace, the shortest path
along edges replaces it. Where neighbouring nodes have changed places, as at ridges that a coarser
mesh has cut off, the curve crosses itself in small loops; their nodes are removed.
"""

from __future__ import annotations

import itertools

import nicmm_kernels
import numpy as np

from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.crossings import crossing_segments
from ..geometry.mesh import Mesh
from ..geometry.surface_points import SurfacePoints, joined
from ..geometry.tracing import strictly_inside
from ..progress import checkpoint
from .curve_nodes import CurveSurface, Nodes
from .discrete_curve import DiscreteCurve, noded, traced_polyline
from .node_traces import LONGEST_BYPASS

ROUNDS = 4
"""Rounds in which loops are removed; traces between the remaining nodes may cross again."""

Paths = dict[tuple[int, int], SurfacePoints]
"""Paths along edges by the numbers of their two nodes."""


def simple_curve(
    surface: CurveSurface,
    places: SurfacePoints,
    control_nodes: IntArray,
    controls: SurfacePoints,
    closed: bool,
    normals: FloatArray | None = None,
    corners: BoolArray | None = None,
) -> DiscreteCurve | None:
    """Join nodes to a simple curve through control points.

    Parameters
    ----------
    surface : CurveSurface
    places : SurfacePoints
        Places of n nodes.
    control_nodes : (k,) int array
        Indices of the nodes at control points; the first one is 0.
    controls : SurfacePoints
        The k control points, which replace the places of these nodes.
    closed : bool
    normals : (n, 3) float array, optional
        Normals at the nodes, which the planes of traces contain; by default those of the surface.
    corners : (k,) bool array, optional
        Control points at which the curve may turn freely.

    Returns
    -------
    DiscreteCurve or None
        A simple curve through the control points and most of the other nodes. None if a step cannot
        be traced or replaced by a path, or if crossings remain after `ROUNDS` rounds.
    """
    faces, barycentric = places.faces.copy(), strictly_inside(places.barycentric)
    faces[control_nodes], barycentric[control_nodes] = controls.faces, controls.barycentric
    places = SurfacePoints(faces, barycentric)
    numbers, paths = np.arange(len(places)), Paths()
    for _ in range(ROUNDS):
        checkpoint()
        bare = noded(surface, places, control_nodes, closed)
        curve = _joined(surface, bare, normals, numbers, paths)
        if curve is None:
            return None
        crossings = crossing_segments(surface.mesh.faces, curve.polyline, closed)
        if not len(crossings):
            return curve if corners is None else curve.with_corners(corners)
        outside = _outside_loops(curve, crossings)
        if outside.all():
            return None
        places, numbers = places[outside], numbers[outside]
        normals = None if normals is None else normals[outside]
        control_nodes = (np.cumsum(outside) - 1)[control_nodes]
    return None


def _joined(
    surface: CurveSurface,
    curve: DiscreteCurve,
    normals: FloatArray | None,
    numbers: IntArray,
    paths: Paths,
) -> DiscreteCurve | None:
    """The curve through the nodes of a curve, simple or not; None if a gap remains.

    New paths along edges are added to `paths`, with the numbers of the nodes, (n,).
    """
    nodes = curve.nodes
    traced = nodes
    if normals is not None:
        traced = Nodes(nodes.places, nodes.closed, nodes.positions, normals, nodes.phi_fea)
    polyline, node_index, lost = traced_polyline(surface, curve, traced)
    pairs = {
        node: (int(numbers[node]), int(numbers[(node + 1) % len(lost)]))
        for node in np.flatnonzero(lost).tolist()
    }
    new = np.array([node for node, pair in pairs.items() if pair not in paths], dtype=np.int64)
    found = _paths_along_edges(surface.mesh, nodes, new, (new + 1) % len(lost))
    if found is None:
        return None
    paths.update((pairs[node], path) for node, path in zip(new.tolist(), found, strict=True))
    bypasses = {node: paths[pair] for node, pair in pairs.items()}
    return _with_paths(curve, polyline, node_index, bypasses)


def _outside_loops(curve: DiscreteCurve, crossings: IntArray) -> BoolArray:
    """Which nodes, (n,), lie outside the loops between crossing segments, (p, 2).

    Of the two parts of a closed curve, the one with fewer nodes is the loop. A loop with a control
    point cannot be removed; its two neighbours are removed instead, which changes its traces.
    """
    n = len(curve.node_index)
    control = np.zeros(n, dtype=bool)
    control[curve.control_nodes] = True
    steps = np.searchsorted(curve.node_index, crossings, side="right") - 1
    outside = np.ones(n, dtype=bool)
    for low, high in np.unique(np.sort(steps, axis=1), axis=0).tolist():
        first, last = low, high
        if curve.closed and 2 * (high - low) > n:
            first, last = high, low + n
        loop = np.arange(first + 1, last + 1) % n
        if control[loop].any():
            loop = np.array([first, last + 1]) % n
        outside[loop] = False
    return outside | control


def _paths_along_edges(
    mesh: Mesh, nodes: Nodes, start: IntArray, end: IntArray
) -> list[SurfacePoints] | None:
    """The shortest paths along edges from some nodes to others, each without its end.

    None if there is no path for one of them.
    """
    if not len(start):
        return []
    places, positions = nodes.places, nodes.positions
    longest = LONGEST_BYPASS * np.linalg.norm(positions[start] - positions[end], axis=1)
    for node in (start, end):  # a path begins and ends with a way to a corner
        corners = mesh.vertices[mesh.faces[places.faces[node]]]
        longest += np.linalg.norm(corners - positions[node, None], axis=2).max(axis=1)
    reached, counts, faces, barycentric = nicmm_kernels.paths_along_edges(
        mesh.edge_graph,
        places[start].for_kernels,
        places[end].for_kernels,
        longest,
        checkpoint,
    )
    if not reached.all():
        return None
    bounds = np.append(0, counts.cumsum())
    points = SurfacePoints(faces, barycentric)
    return [points[low:high] for low, high in itertools.pairwise(bounds.tolist())]


def _with_paths(
    curve: DiscreteCurve,
    polyline: SurfacePoints,
    node_index: IntArray,
    paths: dict[int, SurfacePoints],
) -> DiscreteCurve:
    """The polyline with paths along edges in place of failed traces."""
    if not paths:
        return DiscreteCurve(curve.nodes, curve.control_nodes, polyline, node_index)
    bounds = np.append(node_index, len(polyline)).tolist()
    parts = [
        paths.get(node, polyline[slice(*bounds[node : node + 2])])
        for node in range(len(node_index))
    ]
    lengths = np.array([len(part) for part in parts])
    return DiscreteCurve(
        curve.nodes, curve.control_nodes, joined(parts), np.cumsum(lengths) - lengths
    )
