"""Searches a connected mesh for courses of a curve; a coarse mesh is refined first."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import TypeVar

import numpy as np

from ..geometry import tolerances
from ..geometry.array_types import IntArray
from ..geometry.mesh import Mesh
from ..geometry.normals import unsigned_normals
from ..geometry.refinement import Refined, refined
from ..geometry.surface_points import SurfacePoints, in_first_faces, joined
from ..mapped_surface import MappedSurface
from ..path.via_points import with_via_points
from ..path.visiting_order import shortest_order
from ..progress import checkpoint
from ..relaxation.curve_nodes import CurveSurface, curve_surface
from ..request import Request, mapped_request
from .course_search import COMBINED, FIRST, Search, combine_courses, find_courses
from .hop_graph import SEARCH_CELLS, HopGraph, build_hop_graph, distances_along_edges

MOST_CROSSED = 40.0
"""Value of `edges_crossed` above which no courses are searched for.

On meshes of needles, moving a node crosses thousands of faces.
"""

POINT_RESOLUTION = 1e-6
"""Unit to which barycentric coordinates of points are rounded for the search.

So rounding errors, of a point given by its position, do not decide between two courses.
"""

FEWEST_VERTICES = 1_000
"""Number of vertices below which the copy is refined."""


@dataclass(frozen=True)
class Course:
    """A relaxed course, given by its nodes on the mesh.

    Attributes
    ----------
    places : SurfacePoints
        The n nodes as points of the mesh.
    control_nodes : (k,) int array
        Indices of the control points among the nodes.
    visited : (k,) int array
        Indices of the control points in the request, in the order visited.
    is_finer : bool
        Whether it is the course before it with twice as many nodes.
    """

    places: SurfacePoints
    control_nodes: IntArray
    visited: IntArray
    is_finer: bool


Joined = TypeVar("Joined")


def joined_courses(
    courses: Iterable[Course], join: Callable[[Course], Joined | None]
) -> Iterator[Joined | None]:
    """Join the nodes of courses on a mesh; None for each course that is not simple there.

    A course with twice as many nodes is left out if it is simple with fewer ones.
    """
    is_simple = False
    for course in courses:
        checkpoint()
        if course.is_finer and is_simple:
            continue
        curve = join(course)
        is_simple = curve is not None
        yield curve


def edges_crossed(mesh: Mesh) -> float:
    """Mean number of edges that a straight line crosses over the width of a hop-graph cell.

    By Crofton's formula it is 2 / π times the length of the line times the total edge length per
    area: about 5 on a mesh of 4,000 vertices whose faces are nearly equilateral.
    """
    corners = mesh.vertices[mesh.faces]
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    area = float(mesh.face_areas.sum())
    # Every edge is a side of two faces.
    return float(sides.sum()) / np.pi * np.sqrt(area / SEARCH_CELLS[0]) / area


class CourseSurface:
    """Searches a mesh for courses; computes once what depends only on the surface.

    Parameters
    ----------
    given : MappedSurface
        A connected surface. The courses depend on the numbering and the coordinates of its mesh, so
        pass a canonical copy (`geometry.numbering`).
    """

    def __init__(self, given: MappedSurface) -> None:
        self._given, self._mesh = given, given.mesh
        self._graph: Callable[[int], HopGraph] = cache(
            lambda cells: build_hop_graph(self._surface.without_maps, cells)
        )

    @cached_property
    def _refined(self) -> Refined:
        times = 0
        while len(self._mesh.vertices) * 4**times < FEWEST_VERTICES:
            times += 1
        return refined(self._mesh, times)

    @cached_property
    def _surface(self) -> MappedSurface:
        """The surface that is searched."""
        mesh = self._refined.mesh
        if len(mesh.faces) == len(self._mesh.faces):
            return self._given
        normals = self._refined.interpolation @ unsigned_normals(self._mesh)
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        own = curve_surface(mesh)
        # Vertex normals have arbitrary signs, so interpolated ones may cancel.
        sound = length > tolerances.ROUNDED
        normals = np.where(sound, normals / np.where(sound, length, 1.0), own.vertex_normals)
        return MappedSurface(mesh, replace(own, vertex_normals=normals))

    def courses(self, request: Request, search: Search = FIRST) -> Iterator[Course]:
        """Yield courses for a request, the best first, each once more with twice as many nodes.

        Where strands are close together, traces between more nodes may avoid a crossing.

        Parameters
        ----------
        request : Request
        search : Search

        Raises
        ------
        ControlPointError, UnreachableError
            If via points coincide with control points or lie on another component.
        """
        request = _with_rounded_points(self._mesh, request)
        on_refined = self._refined.in_parts(request.points)
        along = distances_along_edges(self._surface.without_maps, on_refined)
        size = len(self._refined.mesh.vertices)
        visited = np.arange(len(on_refined))
        if request.order == "shortest":
            visited = shortest_order(along[:, size:], request.closed)
        if request.via_points:
            waypoints = with_via_points(
                self._mesh, request.points, request.via_points, request.order, request.closed
            )
            fixed = waypoints.is_control
            corners = np.zeros(len(fixed), dtype=bool)
            corners[np.flatnonzero(fixed)[request.corners]] = True
            on_refined = self._refined.in_parts(waypoints.points)
            along = distances_along_edges(self._surface.without_maps, on_refined)
        else:
            fixed, on_refined = np.ones(len(visited), dtype=bool), on_refined[visited]
            corners = request.are_corners(visited)
            along = along[visited][:, np.append(np.arange(size), size + visited)]
        if self._has_needles:
            return
        surface, any_order = self._with_maps(request), request.order == "shortest"
        any_order = any_order and not request.via_points
        if search.size is COMBINED:
            found = combine_courses(
                search.earlier or [], surface, corners[fixed], request.smoothness, any_order
            )
        else:
            found = find_courses(
                self._graph(SEARCH_CELLS[search.seed % len(SEARCH_CELLS)]),
                surface,
                on_refined,
                along,
                fixed,
                corners,
                request.closed,
                request.smoothness,
                any_order,
                search,
            )
        for nodes, visit, is_finer in found:
            places = self._refined.in_parents(nodes.places)
            control = np.flatnonzero(visit >= 0)
            yield Course(places, control, visited[visit[control]], is_finer)

    @cached_property
    def _has_needles(self) -> bool:
        return edges_crossed(self._refined.mesh) > MOST_CROSSED

    def _with_maps(self, request: Request) -> CurveSurface:
        """The surface that is searched, with the maps of a request."""
        if self._surface is self._given:
            return self._given.of(request)
        return self._surface.of(
            mapped_request(request, self._refined.in_parts, self._refined.interpolation.__matmul__)
        )


def _with_rounded_points(mesh: Mesh, request: Request) -> Request:
    """The request with points whose coordinates are rounded; unchanged if points would coincide."""
    points = _rounded(mesh, request.points)
    via_points = {key: _rounded(mesh, via) for key, via in request.via_points.items()}
    together = joined([points, *via_points.values()])
    places = np.column_stack([together.faces, together.barycentric])
    if len(np.unique(places, axis=0)) < len(places):
        return request
    return replace(request, points=points, via_points=via_points)


def _rounded(mesh: Mesh, points: SurfacePoints) -> SurfacePoints:
    """Points with rounded barycentric coordinates, each in the first face that contains it."""
    weights = np.round(points.barycentric / POINT_RESOLUTION) * POINT_RESOLUTION
    rows, greatest = np.arange(len(weights)), weights.argmax(axis=1)
    weights[rows, greatest] += 1.0 - weights.sum(axis=1)
    return in_first_faces(mesh, SurfacePoints(points.faces, weights))
