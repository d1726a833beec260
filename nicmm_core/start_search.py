"""Searches for starts: simple curves on a mesh from which relaxation begins.

A start is a course of a search (`courses`), the spline through many control points, or the initial
path (both in `path`). On a large mesh courses are searched for on a coarse mesh (`coarsening`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property

import numpy as np

from .coarsening.coarse_start import CoarseStarts
from .coarsening.retriangulated import Retriangulated, retriangulated
from .courses.bent_part import BentPart, request_for_part, with_part
from .courses.comparison import PARTS_APART, is_apart
from .courses.course_search import FIRST, PART, Search
from .courses.course_surface import Course, CourseSurface, joined_courses
from .geometry.array_types import IntArray
from .geometry.curve import SurfaceCurve
from .geometry.mesh import Mesh
from .mapped_surface import MappedSurface
from .new_legs import Leg, request_for_leg, with_new_legs
from .path.initial_path import find_initial_path, path_curve
from .path.spline_path import spline_samples
from .relaxation.close_points import GREATEST_TURN, has_short_legs, turns
from .relaxation.curve_along import curve_along
from .relaxation.curve_nodes import CurveSurface, curve_surface, nodes_at
from .relaxation.discrete_curve import DiscreteCurve
from .relaxation.simple_curve import simple_curve
from .request import Request

MOST_FAILURES = 4
"""Number of courses in a row that are not simple on the mesh after which a search ends.

On rough meshes each of them takes long.
"""

FEWEST_FOR_SPLINE = 6
"""Least number of control points for which the spline through them is tried.

Through fewer points, hardly any spline was better than the best course.
"""


class StartKind(Enum):
    """What a curve begins with."""

    COURSE = "course of a search"
    CLOSE_POINTS = "spline through close control points"
    SPLINE = "spline through control points"
    PATH = "initial path"


@dataclass(frozen=True)
class InitialCurve:
    """A simple curve on the mesh from which relaxation begins.

    Attributes
    ----------
    curve : SurfaceCurve or DiscreteCurve
    visited : (k,) int array
        Indices of the control points in the request, in the order visited.
    surface : CurveSurface
        The surface with the maps of the request.
    unit : float
        Square root of the area of the component.
    collisions : int
        Number of next designs for which strands are assumed to collide again.
    unsettled : (n,) int array or None
        Vertices near which the curve may move; None if it may move everywhere.
    """

    curve: SurfaceCurve | DiscreteCurve
    visited: IntArray
    surface: CurveSurface
    unit: float
    collisions: int = 0
    unsettled: IntArray | None = None


class StartSearch:
    """Searches one manifold for starts. What depends only on the mesh is computed once.

    Parameters
    ----------
    mesh : Mesh
        A connected mesh.
    is_canonical : bool
        Whether the mesh is a canonical copy. If so, courses are searched for on its Delaunay
        triangulation.

    Attributes
    ----------
    transferred : int
        Number of courses so far that have been transferred from the coarse mesh.
    """

    def __init__(self, mesh: Mesh, is_canonical: bool = False) -> None:
        self.mesh, self._is_canonical = mesh, is_canonical
        self.transferred = 0

    @cached_property
    def surface(self) -> MappedSurface:
        """The surface for relaxation.

        Its normals and φ_fea are those of the Delaunay triangulation, so curves on other
        triangulations have the same energy.
        """
        if self.on_delaunay is None:
            return MappedSurface(self.mesh)
        on_delaunay = self.on_delaunay[1].surface
        normals = on_delaunay.without_maps.vertex_normals
        return MappedSurface(self.mesh, curve_surface(self.mesh, normals), on_delaunay)

    @cached_property
    def on_delaunay(self) -> tuple[Retriangulated, StartSearch] | None:
        """The Delaunay triangulation with a search on it; None if this is a search on it."""
        found = retriangulated(self.mesh) if self._is_canonical else None
        return None if found is None else (found, StartSearch(found.mesh))

    def from_delaunay(self, request: Request, start: InitialCurve) -> InitialCurve | None:
        """A start on the Delaunay triangulation as one on the mesh; None if it is not simple there.

        The start has nodes. The request is that on the mesh.
        """
        assert self.on_delaunay is not None and isinstance(start.curve, DiscreteCurve)
        mapped, controls = self.surface.of(request), request.points[start.visited]
        found = self.on_delaunay[0].curve_back(mapped, start.curve, controls)
        if found is None:
            return None
        return replace(start, curve=found, surface=mapped, unit=self.surface.unit)

    def first(
        self, request: Request, courses: Iterator[InitialCurve]
    ) -> tuple[InitialCurve, StartKind]:
        """The start with which the search for a curve begins.

        It is the spline through control points that are close together; or else the first of some
        courses; or else the spline through many control points, or the initial path.

        Raises
        ------
        UnreachableError
            If no simple curve passes through the points in this order.
        """
        by_points = request.order == "given" and has_many_points(request)
        in_order = np.arange(len(request.points))
        if by_points and has_plain_energy(request) and self._points_turn_little(request):
            start = self.by_spline(request, in_order)
            if start is not None:
                assert isinstance(start.curve, DiscreteCurve)
                if has_short_legs(start.curve):
                    return start, StartKind.CLOSE_POINTS
        start = next(courses, None)
        if start is not None:
            return start, StartKind.COURSE
        start = self.by_spline(request, in_order) if by_points else None
        if start is not None:
            return start, StartKind.SPLINE
        return self.by_path(request), StartKind.PATH

    def _points_turn_little(self, request: Request) -> bool:
        """Whether lines between the control points, in the given order, turn little."""
        nodes = nodes_at(self.surface.without_maps, request.points, request.closed)
        angles = turns(nodes.positions, nodes.normals, request.closed)
        angles[request.corners] = 0.0
        return bool((angles <= GREATEST_TURN).all())

    def courses(
        self, request: Request, search: Search = FIRST, insist: bool = False
    ) -> Iterator[InitialCurve]:
        """Courses that are simple on the mesh, the best first.

        The search ends after `MOST_FAILURES` courses in a row that are not simple. If it is to
        insist, these count only after the first simple course.
        """
        failures, found = 0, not insist
        for start in self._joined_courses(request, search):
            if start is not None:
                failures, found = 0, True
                yield start
            else:
                failures += 1
                if found and failures >= MOST_FAILURES:
                    break

    def with_other_part(
        self, request: Request, start: InitialCurve, curve: DiscreteCurve, part: BentPart
    ) -> Iterator[InitialCurve]:
        """A curve with other courses of one part.

        They are apart from each other and from the curve; the best comes first.
        """
        known = [curve]
        part_request = request_for_part(request, curve, part)
        for course in self.courses(part_request, Search(PART)):
            assert isinstance(course.curve, DiscreteCurve)
            changed = with_part(start.surface, curve, part, course.curve)
            if changed is not None and is_apart(start.surface, changed, known, PARTS_APART):
                known.append(changed)
                yield replace(start, curve=changed)

    def with_new_legs(
        self, request: Request, curve: DiscreteCurve, legs: Sequence[Leg]
    ) -> Iterator[InitialCurve]:
        """A start with courses of its new legs; the best of each leg come first.

        The iterator is empty if no leg is new.

        Parameters
        ----------
        request : Request
        curve : DiscreteCurve
            The curve of the start.
        legs : sequence of Leg
            Its legs, from `legs_of`.
        """
        surface, new = self.surface.of(request), [i for i, leg in enumerate(legs) if leg.is_new]
        asked = [request_for_leg(surface, curve, legs, number, request) for number in new]
        found = [self.courses(of_leg, Search(PART)) for of_leg, _ in asked]
        for courses in zip(*found, strict=False):
            own = {}
            for number, (_, passed), course in zip(new, asked, courses, strict=True):
                assert isinstance(course.curve, DiscreteCurve)
                at_points = course.curve.control_nodes[passed]
                places = course.curve.nodes.places[at_points[0] : at_points[-1] + 1]
                own[number] = places, at_points - at_points[0]
            changed = with_new_legs(surface, curve, legs, own, request)
            if changed is not None:
                yield InitialCurve(*changed, surface, self.surface.unit)

    def by_path(self, request: Request) -> InitialCurve:
        """The initial path."""
        surface = self.surface.of(request)
        path = find_initial_path(
            self.mesh,
            request.points,
            request.order,
            surface.feature_map,
            request.closed,
            request.via_points,
        )
        return InitialCurve(path_curve(self.mesh, path), path.order, surface, self.surface.unit)

    def by_spline(self, request: Request, visited: IntArray) -> InitialCurve | None:
        """The spline through the control points in an order, on the nearest places of the mesh.

        None if the surface is too far away from it, or has no simple curve there.
        """
        surface, points = self.surface.of(request), request.points[visited]
        corners, closed = request.are_corners(visited), request.closed
        line, at_points = spline_samples(points.positions(self.mesh), closed, corners)
        curve = curve_along(surface, line, closed, at_points, points)
        if curve is None:
            return None
        return InitialCurve(curve.with_corners(corners), visited, surface, self.surface.unit)

    def _joined_courses(self, request: Request, search: Search) -> Iterator[InitialCurve | None]:
        """Courses joined on the mesh; None for each course that is not simple there."""
        if self.on_delaunay is not None:
            delaunay, on_delaunay = self.on_delaunay
            there = delaunay.request_to(request)
            for start in [] if there is None else on_delaunay.courses(there, search):
                yield self.from_delaunay(request, start)
            return
        mapped, unit = self.surface.of(request), self.surface.unit
        if self._coarse_starts.is_large:
            for found in self._coarse_starts.courses(request, search):
                self.transferred += 1
                yield None if found is None else InitialCurve(*found, mapped, unit)
            return

        def join(course: Course) -> InitialCurve | None:
            curve = simple_curve(
                self.surface.without_maps,
                course.places,
                course.control_nodes,
                request.points[course.visited],
                request.closed,
                corners=request.are_corners(course.visited),
            )
            return None if curve is None else InitialCurve(curve, course.visited, mapped, unit)

        yield from joined_courses(self._courses.courses(request, search), join)

    @cached_property
    def _courses(self) -> CourseSurface:
        return CourseSurface(self.surface)

    @cached_property
    def _coarse_starts(self) -> CoarseStarts:
        return CoarseStarts(self.surface.without_maps)


def has_many_points(request: Request) -> bool:
    """Whether control points alone, without via points, determine most of the course."""
    return len(request.points) >= FEWEST_FOR_SPLINE and not request.via_points


def has_plain_energy(request: Request) -> bool:
    """Whether only the length and the geodesic curvature of a curve determine its energy."""
    return not (request.has_maps or request.avoid or request.normal_bending)


def is_new(start: InitialCurve, curves: list[DiscreteCurve]) -> bool:
    """Whether a course is somewhere apart from each of some curves."""
    assert isinstance(start.curve, DiscreteCurve)
    return is_apart(start.surface, start.curve, curves)
