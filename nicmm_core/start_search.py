"""Searches for starts: simple curves on a mesh from which relaxation begins.

A start is a course of a search (`courses`), or the curve of the network if no course is found. On a
large mesh both are found on a coarse mesh (`coarsening`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

from .coarsening.coarse_start import CoarseStarts
from .courses.attempts import MOST_FAILURES
from .courses.bent_part import BentPart, request_for_part, with_part
from .courses.comparison import is_apart
from .courses.course_surface import CourseSurface
from .geometry.array_types import IntArray
from .geometry.curve import SurfaceCurve
from .geometry.mesh import Mesh
from .maps.guidance import component_unit
from .network.single_pass import infer
from .path.initial_loop import path_curve
from .progress import checkpoint
from .relaxation.curve_nodes import CurveSurface, curve_surface, with_maps
from .relaxation.discrete_curve import DiscreteCurve
from .relaxation.simple_curve import simple_curve
from .request import Request, same_maps


@dataclass(frozen=True)
class Start:
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
    breaking : int
        Number of breaking vertices of the level set, if the start is its zero set.
    collisions : int
        Number of next designs for which strands are assumed to collide again.
    unsettled : (n,) int array or None
        Vertices near which the curve may move; None if it may move everywhere.
    """

    curve: SurfaceCurve | DiscreteCurve
    visited: IntArray
    surface: CurveSurface
    unit: float
    breaking: int = 0
    collisions: int = 0
    unsettled: IntArray | None = None


class StartSearch:
    """Searches one manifold for starts. What depends only on the mesh is computed once.

    Parameters
    ----------
    mesh : Mesh
    """

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        self._units: dict[int, float] = {}  # by component
        self._mapped: tuple[Request, CurveSurface] | None = None  # of the last request with maps

    def courses(
        self, request: Request, seed: int = 0, most_failures: int | None = None
    ) -> Iterator[Start]:
        """Courses that are simple on the mesh, the best first; seeds above 0 use random lengths.

        The search ends after `most_failures` courses in a row that are not simple.
        """
        failures = 0
        for start in self._joined_courses(request, seed):
            failures = failures + 1 if start is None else 0
            if start is not None:
                yield start
            elif failures == most_failures:
                break

    def with_other_part(
        self, request: Request, start: Start, curve: DiscreteCurve, part: BentPart
    ) -> Iterator[Start]:
        """A curve with other courses of one part that are apart from each other, the best first."""
        found: list[DiscreteCurve] = []
        part_request = request_for_part(request, curve, part)
        for course in self.courses(part_request, most_failures=MOST_FAILURES):
            if not is_new(course, found):
                continue
            assert isinstance(course.curve, DiscreteCurve)
            changed = with_part(start.surface, curve, part, course.curve)
            if changed is not None:
                found.append(course.curve)
                yield replace(start, curve=changed)

    def by_network(self, request: Request) -> Start:
        """The zero set of the network's level set, or the path if the zero set is not simple."""
        coarse = self._coarse_starts.by_network(request)
        if coarse is not None:
            return Start(
                curve=coarse.curve,
                visited=coarse.visited,
                surface=self.surface(request),
                unit=self.unit(request),
                breaking=coarse.breaking_vertices,
            )
        found = infer(self.mesh, request)
        problem, zeros = found.problem, found.zeros
        # A zero set may touch itself where the mesh is too coarse; the path does not.
        one = zeros.is_simple_curve(self.mesh, request.closed)
        curve = zeros.curves[0] if one else path_curve(self.mesh, problem.working, problem.loop)
        return Start(
            curve=curve,
            visited=problem.loop.order,
            surface=self.surface(request),
            unit=problem.unit,
            breaking=zeros.breaking_vertices,
        )

    def surface(self, request: Request) -> CurveSurface:
        """The surface for relaxation, with the maps of a request."""
        if not request.has_maps:
            return self._surface
        last = self._mapped
        if last is None or not self._same_maps(last[0], request):
            obstacles, alignment = request.obstacles, request.alignment
            mapped = with_maps(self._surface, obstacles, alignment, self.unit(request))
            last = self._mapped = request, mapped
        return last[1]

    def unit(self, request: Request) -> float:
        """Square root of the area of the component of a request."""
        component = self._component(request)
        if component not in self._units:
            self._units[component] = component_unit(self.mesh, component)
        return self._units[component]

    def _joined_courses(self, request: Request, seed: int) -> Iterator[Start | None]:
        """Courses joined on the mesh; None for each course that is not simple there."""
        there, unit = self.surface(request), self.unit(request)
        if self._coarse_starts.is_large(request):
            for found in self._coarse_starts.courses(request, seed):
                yield None if found is None else Start(found.curve, found.visited, there, unit)
            return
        for course in self._courses.courses(request, seed):
            checkpoint()
            curve = simple_curve(
                self._surface,
                course.places,
                course.control_nodes,
                request.points[course.visited],
                request.closed,
            )
            yield None if curve is None else Start(curve, course.visited, there, unit)

    def _same_maps(self, one: Request, other: Request) -> bool:
        """Whether two requests have the same maps on the same component."""
        return self._component(one) == self._component(other) and same_maps(one, other)

    def _component(self, request: Request) -> int:
        return int(self.mesh.face_component[request.points.faces[0]])

    @cached_property
    def _surface(self) -> CurveSurface:
        return curve_surface(self.mesh)

    @cached_property
    def _courses(self) -> CourseSurface:
        return CourseSurface(self.mesh)

    @cached_property
    def _coarse_starts(self) -> CoarseStarts:
        return CoarseStarts(self._surface)


def is_new(start: Start, curves: list[DiscreteCurve]) -> bool:
    """Whether a course is somewhere apart from each of some curves."""
    assert isinstance(start.curve, DiscreteCurve)
    return is_apart(start.surface, start.curve, curves)
