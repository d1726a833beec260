"""Finds the line along a feature of the surface next to a point, as a closed loop if there is one.

The feature is, in this order, that of marked edges, of the rim of painted weights, of sharp edges
and of the boundary, or a smooth ridge or valley. Each edge of the mesh has a strength, 1 on the
feature and 0 away from it. The loop is the cheapest path along edges from one side of the point to
the other, where the cost of an edge is its length, many times less on the feature. If most of it is
not on the feature, the line is followed in both directions instead, until the feature ends. A
smooth ridge is then moved to the greatest curvature between vertices.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse
from scipy.ndimage import gaussian_filter1d
from scipy.sparse import csgraph
from scipy.spatial import cKDTree

from ..arguments import checked_map, checked_number
from ..errors import ArgumentError, ControlPointError, UnreachableError
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.curve import resample
from ..geometry.mesh import Mesh, edge_lengths, unique_edges
from ..geometry.surface_points import SurfacePoints, locate_points, nearest_points
from ..geometry.tolerances import TINY
from ..maps.feature_maps import edge_map, principal_curvatures, sharp_edges
from ..progress import checkpoint
from ..repair.clean_surface import joined_surface

REACH = 4.0
"""Least distance from the point within which a feature is looked for, in mean edge lengths
there."""

WANTED = "a length of at least 0"

OFF = 50.0
"""Cost of an edge off the feature, relative to one on it. So a gap in the feature is bridged if the
rest of the loop is this many times longer."""

ON = 0.4
"""Strength from which an edge is on the feature."""

SHARE = 0.8
"""Least part of a loop, by its length, that is on the feature."""

GATES = (2.5, 5.0, 10.0, 20.0, 40.0)
"""Radii of the ball around a point of a smooth ridge in which a loop cannot turn back, in mean edge
lengths. Ridges may be many edges wide."""

LOOP = 4.0 * np.pi
"""Least length of a loop in radii of the ball; a shorter one runs around the ball on the ridge."""

SHORT = 0.5
"""Length below which a loop or line is ignored, relative to that of another feature."""

STRIKING = 1.5
"""Least curvature of a ridge or valley, relative to the mean curvature around it."""

AROUND = 3.0
"""Radius of these surroundings, in reaches."""

MOVES = 2
"""How often a ridge line is moved across."""

ACROSS = 1.5
"""Distance up to which a ridge is moved across its line, in mean edge lengths."""

SAMPLES = 13
"""Number of places across a ridge at which its curvature is compared."""

RINGS = 3
"""Number of edges around a vertex within which the curvature of a crest is the greatest."""

SMOOTHINGS = 3
"""How often curvature is replaced by the mean of a vertex and its neighbours, against noise."""

TYPICAL = 0.6
"""Curvature of a ridge that counts as full strength, relative to that next to the point."""

SMOOTH = 1.5
"""Standard deviation of the filter that smooths a ridge line, in mean edge lengths."""

TOLERANCE = 0.3
"""Greatest distance of the curve from the feature, in mean edge lengths along it."""


@dataclass(frozen=True)
class FeatureLine:
    """A line along a feature.

    Attributes
    ----------
    points : (n, 3) float array
        The line, from vertex to vertex, or between vertices of a smooth ridge.
    closed : bool
        Whether the last point is joined to the first.
    tolerance : float
        Greatest distance of a curve that follows it, in mesh units.
    """

    points: FloatArray
    closed: bool
    tolerance: float


@dataclass(frozen=True)
class _Feature:
    """The strengths of edges, and where the feature is next to the point.

    Attributes
    ----------
    strength : (e,) float array
    start, target : int
        Vertices on both sides of the point, on the feature.
    is_line : bool
        Whether it consists of edges; a smooth ridge is wider.
    curvature : (v,) float array, optional
        Curvature at the vertices, of a smooth ridge.
    crest : (v,) float array, optional
        The same relative to its greatest value around each vertex.
    """

    strength: FloatArray
    start: int
    target: int
    is_line: bool
    curvature: FloatArray | None = None
    crest: FloatArray | None = None


def feature_line(
    mesh: Mesh,
    point: ArrayLike | SurfacePoints,
    edges: ArrayLike | None,
    weights: ArrayLike | None,
    reach: float | None,
) -> FeatureLine:
    """The line along the feature next to a point; the parameters are those of `feature_loop`.

    Raises
    ------
    ControlPointError
        If the point is not a single point on the surface.
    UnreachableError
        If there is no feature within reach.
    ArgumentError
        If another argument cannot be used.
    """
    located = locate_points(mesh, _alone(point), "point")
    if len(located) != 1:
        raise ControlPointError(f"point has {len(located)} points; pass one")
    place = located.positions(mesh)[0]
    surface = joined_surface(mesh)
    graph = _EdgeGraph(surface.mesh)
    size = graph.size_near(place)
    wanted = 0.0 if reach is None else checked_number("reach", reach, WANTED)
    if wanted < 0.0:
        raise ArgumentError(f"reach is {reach!r}; pass {WANTED}")
    within = max(wanted, REACH * size)
    painted = checked_map("weights", weights, mesh)
    if painted is not None:
        on_surface = np.zeros(len(surface.mesh.vertices))
        np.maximum.at(on_surface, surface.place, painted)
        painted = on_surface
    marked = None
    if edges is not None:
        edge_map(mesh, edges)  # which checks them
        marked = surface.place[np.asarray(edges, dtype=np.int64).reshape(-1, 2)]
    features = _next_to(graph, place, within, size, marked, painted)
    if not features:
        raise UnreachableError(
            f"there is no sharp edge, ridge, valley, marked edge or boundary within {within:g} of "
            "the point; pass a point closer to the feature, a greater reach, or edges of the "
            "feature"
        )
    feature, vertices, closed = _best_line(graph, features, place, size)
    points = graph.mesh.vertices[vertices]
    step = float(np.linalg.norm(np.diff(points, axis=0), axis=1).mean())
    if feature.curvature is not None:
        for _ in range(MOVES):
            points = _on_crest(graph, points, closed, feature.curvature, step)
            points = nearest_points(mesh, points)[0].positions(mesh)
    return FeatureLine(points, closed, TOLERANCE * step)


def _alone(point: ArrayLike | SurfacePoints) -> ArrayLike | SurfacePoints:
    """A single vertex index or position as a list of one."""
    if isinstance(point, SurfacePoints):
        return point
    try:
        values = np.asarray(point)
    except ValueError:
        return point  # which is refused with a message
    if values.ndim == 0:
        return values[None]
    is_position = values.shape == (3,) and np.issubdtype(values.dtype, np.number)
    return values[None].astype(np.float64) if is_position else point


class _EdgeGraph:
    """The edges of a mesh as a graph."""

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        self.edges, self.count = unique_edges(mesh.faces)
        self.lengths = edge_lengths(mesh.vertices, self.edges)
        self.tree = cKDTree(mesh.vertices)

    def size_near(self, place: FloatArray) -> float:
        """Mean length of the edges of the vertices nearest to a place."""
        nearest = self.tree.query(place, k=min(4, len(self.mesh.vertices)))[1]
        near = np.isin(self.edges, nearest).any(axis=1)
        return float(self.lengths[near].mean()) if near.any() else self.mesh.mean_edge_length

    def matrix(self, used: BoolArray | IntArray, costs: FloatArray) -> sparse.csr_array:
        """Some of the edges with their costs, in both directions."""
        start, end = self.edges[used].T
        size = len(self.mesh.vertices)
        costs = costs[used]
        both = (np.concatenate([start, end]), np.concatenate([end, start]))
        return sparse.csr_array((np.concatenate([costs, costs]), both), shape=(size, size))

    def loop(
        self, feature: _Feature, place: FloatArray, size: float, across_gaps: bool
    ) -> IntArray | None:
        """The vertices of the loop along a feature through a place, or None without a loop."""
        on, costs = feature.strength >= ON, self._costs(feature)
        for gate in GATES:
            crossing = self._crossing(feature, place, gate * size)
            used = ~crossing if across_gaps else on & ~crossing
            path = self._path(used, costs, feature.start, feature.target)
            if path is None:
                return None
            is_long = feature.is_line or self.length(path) >= LOOP * gate * size
            if is_long and self._share_on(path, on) >= SHARE:
                return path
        return None

    def open_line(self, feature: _Feature, place: FloatArray, size: float) -> IntArray:
        """The vertices of the line along a feature in both directions from a place."""
        used = (feature.strength >= ON) & ~self._crossing(feature, place, GATES[1] * size)
        costs = self._costs(feature)
        one = self._farthest(used, costs, feature.start)
        used &= ~np.isin(self.edges, one).any(axis=1)  # the line does not meet itself
        other = self._farthest(used, costs, feature.target)
        return np.concatenate([other[::-1], one])

    def length(self, path: IntArray) -> float:
        """Length of a path."""
        return float(np.linalg.norm(np.diff(self.mesh.vertices[path], axis=0), axis=1).sum())

    def _costs(self, feature: _Feature) -> FloatArray:
        """Costs of the edges, (e,)."""
        off = (1.0 - feature.strength) ** 2
        if feature.crest is not None:
            off += (1.0 - feature.crest[self.edges].mean(axis=1)) ** 2
        costs: FloatArray = self.lengths * (1.0 / OFF + off)
        return costs

    def _crossing(self, feature: _Feature, place: FloatArray, radius: float) -> BoolArray:
        """The edges in a ball that lead from one side of a place on the feature to the other."""
        start, target = feature.start, feature.target
        if feature.is_line:
            result: BoolArray = np.isin(self.edges, [start, target]).all(axis=1)
            return result
        along = self.mesh.vertices[start] - self.mesh.vertices[target]
        middle = 0.5 * (self.mesh.vertices[start] + self.mesh.vertices[target])
        side = (self.mesh.vertices - middle) @ along
        near = np.linalg.norm(self.mesh.vertices - middle, axis=1) <= radius
        ends = self.edges
        crosses: BoolArray = (side[ends[:, 0]] < 0.0) != (side[ends[:, 1]] < 0.0)
        return crosses & near[ends].any(axis=1)

    def _path(self, used: BoolArray, costs: FloatArray, start: int, target: int) -> IntArray | None:
        """The cheapest path along some edges, of two or more; None where they do not join."""
        cost, before = self._cheapest(used, costs, start)
        if not np.isfinite(cost[target]):
            return None
        path = _path_to(target, start, before)
        return path if len(path) > 2 else None

    def _share_on(self, path: IntArray, on: BoolArray) -> float:
        """The part of a path, by its length, that is on the feature."""
        size = len(self.mesh.vertices)
        keys = self.edges.min(axis=1) * size + self.edges.max(axis=1)
        order = np.argsort(keys)
        wanted = np.minimum(path[:-1], path[1:]) * size + np.maximum(path[:-1], path[1:])
        edge = order[np.searchsorted(keys[order], wanted)]
        return float(self.lengths[edge][on[edge]].sum() / self.lengths[edge].sum())

    def _farthest(self, used: BoolArray, costs: FloatArray, start: int) -> IntArray:
        """The path from a vertex along some edges to the farthest vertex that they reach."""
        cost, before = self._cheapest(used, costs, start)
        return _path_to(int(np.where(np.isfinite(cost), cost, -1.0).argmax()), start, before)

    def _cheapest(
        self, used: BoolArray, costs: FloatArray, start: int
    ) -> tuple[FloatArray, IntArray]:
        """Cost of the cheapest path from a vertex to each one, and the vertex before it there."""
        checkpoint()
        cost, before = csgraph.dijkstra(
            self.matrix(used, costs), indices=start, return_predecessors=True
        )
        return cost, before


def _path_to(vertex: int, start: int, before: IntArray) -> IntArray:
    """The vertices of a path from a start, given the vertex before each one."""
    path = [vertex]
    while path[-1] != start:
        path.append(int(before[path[-1]]))
    return np.array(path[::-1], dtype=np.int64)


def _best_line(
    graph: _EdgeGraph, features: list[_Feature], place: FloatArray, size: float
) -> tuple[_Feature, IntArray, bool]:
    """The loop along the first feature that has one, otherwise an open line.

    A smooth ridge comes before gaps in lines, and before much shorter loops, since on a rough ridge
    some edges are sharp.
    """
    for across_gaps in (False, True):
        loops = [
            graph.loop(feature, place, size, across_gaps or not feature.is_line)
            for feature in features
        ]
        lengths = np.array([0.0 if loop is None else graph.length(loop) for loop in loops])
        for feature, loop, length in zip(features, loops, lengths, strict=True):
            if loop is not None and length >= SHORT * lengths.max():
                return feature, loop, True
    lines = [graph.open_line(feature, place, size) for feature in features]
    lengths = np.array([graph.length(line) for line in lines])
    chosen = int((lengths >= SHORT * lengths.max()).argmax())
    return features[chosen], lines[chosen], False


def _next_to(
    graph: _EdgeGraph,
    place: FloatArray,
    reach: float,
    size: float,
    marked: IntArray | None,
    weights: FloatArray | None,
) -> list[_Feature]:
    """The features next to a place: what was marked or painted alone, otherwise all kinds."""
    given = [] if marked is None else [np.sort(marked, axis=1)]
    given += [] if weights is None else [_rim(graph, weights)]
    for line in given:
        found = _line_near(graph, line, place, reach)
        if found is not None:
            return [found]
    lines = [sharp_edges(graph.mesh), graph.edges[graph.count == 1]]
    features = [_line_near(graph, line, place, reach) for line in lines]
    features.append(_ridge_near(graph, place, reach, size))
    return [each for each in features if each is not None]


def _rim(graph: _EdgeGraph, weights: FloatArray) -> IntArray:
    """The outline of the faces with a weight of more than half, (n, 2)."""
    inside = (weights > 0.5)[graph.mesh.faces].all(axis=1)
    edges, count = unique_edges(graph.mesh.faces[inside])
    return edges[count == 1]


def _line_near(
    graph: _EdgeGraph, line: IntArray, place: FloatArray, reach: float
) -> _Feature | None:
    """The feature that consists of edges, if one of them is near a place."""
    if not len(line):
        return None
    start, end = graph.mesh.vertices[line].transpose(1, 0, 2)
    way = end - start
    share = ((place - start) * way).sum(axis=1) / np.maximum((way * way).sum(axis=1), 1e-300)
    away = np.linalg.norm(start + share.clip(0.0, 1.0)[:, None] * way - place, axis=1)
    nearest = int(away.argmin())
    if not away[nearest] <= reach:
        return None
    size = len(graph.mesh.vertices)
    keys = line.min(axis=1) * size + line.max(axis=1)
    own = graph.edges.min(axis=1) * size + graph.edges.max(axis=1)
    strength = np.isin(own, keys).astype(np.float64)
    return _Feature(strength, int(line[nearest, 0]), int(line[nearest, 1]), True)


def _ridge_near(graph: _EdgeGraph, place: FloatArray, reach: float, size: float) -> _Feature | None:
    """The smooth ridge or valley near a place, whichever is more curved."""
    mesh = graph.mesh
    signed = _signed_curvature(graph)
    near = np.array(graph.tree.query_ball_point(place, reach), dtype=np.int64)
    around = np.array(graph.tree.query_ball_point(place, AROUND * reach), dtype=np.int64)
    if len(near) < 2:
        return None
    closeness = 1.0 - np.linalg.norm(mesh.vertices[near] - place, axis=1) / reach
    top = int(near[(np.abs(signed[near]) * closeness).argmax()])
    greatest = abs(float(signed[top]))
    if not greatest > STRIKING * float(np.abs(signed[around]).mean()):
        return None
    # A ridge and a valley beside it have different signs, if faces are oriented.
    curvature = signed * np.sign(signed[top])
    strength = (curvature / (TYPICAL * greatest)).clip(0.0, 1.0)[graph.edges].min(axis=1)
    around_each = _greatest_around(graph, curvature)
    is_curved = around_each > TINY
    crest = np.where(is_curved, curvature, 0.0) / np.where(is_curved, around_each, 1.0)
    crest = crest.clip(0.0, 1.0)
    # Along the ridge, there are many curved vertices near the top.
    ball = np.array(
        graph.tree.query_ball_point(mesh.vertices[top], GATES[1] * size), dtype=np.int64
    )
    offset = mesh.vertices[ball] - mesh.vertices[top]
    heavy = (curvature[ball] / greatest).clip(0.0, 1.0) ** 2
    _, axes = np.linalg.eigh(np.einsum("n,ni,nj->ij", heavy, offset, offset))
    beside = graph.edges[(graph.edges == top).any(axis=1)]
    other = np.where(beside[:, 0] == top, beside[:, 1], beside[:, 0])
    way = mesh.vertices[other] - mesh.vertices[top]
    backward = np.abs(way @ axes[:, 2]) / np.linalg.norm(way, axis=1)
    score = backward * curvature[other].clip(0.0)
    target = int(other[score.argmax()])
    return _Feature(strength, top, target, False, curvature, crest)


def _signed_curvature(graph: _EdgeGraph) -> FloatArray:
    """The principal curvature with the greater absolute value at each vertex, smoothed, (v,)."""
    curvatures = principal_curvatures(graph.mesh)
    largest = np.abs(curvatures).argmax(axis=1)
    found = np.take_along_axis(curvatures, largest[:, None], axis=1)[:, 0]
    if not graph.mesh.is_oriented:
        found = np.abs(found)
    every = np.arange(len(graph.edges))
    beside = graph.matrix(every, np.ones(len(every)))
    count = 1.0 + np.diff(beside.indptr)
    for _ in range(SMOOTHINGS):
        found = (found + beside @ found) / count
    result: FloatArray = found
    return result


def _greatest_around(graph: _EdgeGraph, values: FloatArray) -> FloatArray:
    """The greatest value within `RINGS` edges of each vertex, (v,)."""
    found = values.copy()
    start, end = graph.edges.T
    for _ in range(RINGS):
        before = found.copy()
        np.maximum.at(found, start, before[end])
        np.maximum.at(found, end, before[start])
    return found


def _on_crest(
    graph: _EdgeGraph, line: FloatArray, closed: bool, curvature: FloatArray, step: float
) -> FloatArray:
    """A line along a ridge, moved to the greatest curvature across it, (n, 3)."""
    length = np.linalg.norm(np.diff(line, axis=0), axis=1).sum()
    count = max(int(length / step), 8)
    even, _ = resample(line, count, closed)
    if closed:
        along = np.roll(even, -1, axis=0) - np.roll(even, 1, axis=0)
    else:
        along = np.gradient(even, axis=0)
    mesh = graph.mesh
    normals = mesh.vertex_faces @ (mesh.face_areas[:, None] * mesh.face_normals)
    normal = normals[graph.tree.query(even)[1]]
    across = np.cross(normal, along)
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-300)
    shift = np.linspace(-ACROSS * step, ACROSS * step, SAMPLES)
    places = even[:, None] + shift[None, :, None] * across[:, None]
    away, nearest = graph.tree.query(places.reshape(-1, 3), k=min(6, len(mesh.vertices)))
    heavy = np.exp(-((away / step) ** 2))
    value = (heavy * curvature[nearest]).sum(axis=1) / heavy.sum(axis=1)
    value = value.reshape(count, SAMPLES)
    # The centre of what is more curved than both ends.
    excess = (value - np.maximum(value[:, :1], value[:, -1:])).clip(0.0) ** 2
    total = excess.sum(axis=1)
    moved = np.where(total > 0.0, (excess @ shift) / np.where(total > 0.0, total, 1.0), 0.0)
    crest = even + moved[:, None] * across
    mode = "wrap" if closed else "nearest"
    smooth: FloatArray = gaussian_filter1d(crest, SMOOTH, axis=0, mode=mode)
    return smooth
