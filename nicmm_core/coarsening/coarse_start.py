"""Finds the start of a curve on a large mesh: on a coarse mesh, then mapped to the fine mesh."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property, partial

import numpy as np

from ..courses.course_search import Search
from ..courses.course_surface import Course, CourseSurface, edges_crossed, joined_courses
from ..errors import NicmmError
from ..geometry.array_types import IntArray
from ..geometry.mesh import Mesh
from ..geometry.numbering import Renumbered, renumbered
from ..geometry.surface_points import SurfacePoints, locate_control_points
from ..mapped_surface import MappedSurface
from ..relaxation.curve_nodes import CurveSurface, curve_surface
from ..relaxation.discrete_curve import DiscreteCurve, noded
from ..request import Request, mapped_request
from .coarse_mesh import CoarseMesh, build_coarse_mesh
from .fine_curve import nodes_on_fine_mesh

COARSE_CELLS = 4_000
"""Greatest number of cells of a coarse mesh."""

SMALL, LARGE = 3_000, 6_000
"""Numbers of vertices up to which a mesh needs no coarse mesh, and above which it needs one."""


class CoarseStarts:
    """Finds starts on the coarse mesh of a connected mesh.

    Parameters
    ----------
    surface : CurveSurface
        Surface of the fine mesh.
    """

    def __init__(self, surface: CurveSurface) -> None:
        self._mesh, self._fine = surface.mesh, surface
        self._copies: dict[int, tuple[Renumbered, CourseSurface]] = {}

    def courses(
        self, request: Request, search: Search
    ) -> Iterator[tuple[DiscreteCurve, IntArray] | None]:
        """Yield the courses on the coarse mesh, the best first, as curves on the fine mesh.

        With each comes the order in which it visits the control points. A course that is not simple
        on the fine mesh is None. There may be no courses where points are close together.
        """
        with contextlib.suppress(NicmmError):
            on_coarse = _on_coarse(self._mesh, self._coarse, request)
            copy, surface = self._copy_under(on_coarse.points)
            on_copy = mapped_request(on_coarse, copy.points_to, copy.weights_to)
            join = partial(self._on_fine, request, copy)
            yield from joined_courses(surface.courses(on_copy, search), join)

    def _on_fine(
        self, request: Request, copy: Renumbered, course: Course
    ) -> tuple[DiscreteCurve, IntArray] | None:
        """A course on the canonical copy of the coarse mesh as a curve on the fine mesh."""
        places = copy.points_back(course.places)
        nodes = noded(self._coarse_surface, places, course.control_nodes, request.closed)
        nodes = nodes.with_corners(request.are_corners(course.visited))
        controls = request.points[course.visited]
        curve = nodes_on_fine_mesh(self._fine, self._coarse, nodes, controls)
        return None if curve is None else (curve, course.visited)

    @cached_property
    def is_large(self) -> bool:
        """Whether the mesh needs a coarse mesh."""
        count = np.count_nonzero(self._mesh.referenced)
        # A mesh of medium size needs a coarse mesh if it has needles.
        needles = SMALL < count <= LARGE and edges_crossed(self._mesh) > 7.0
        return count > LARGE or needles

    @cached_property
    def _coarse(self) -> CoarseMesh:
        """The coarse mesh, built on first use."""
        # At least two fine vertices for each cell.
        count = min(COARSE_CELLS, np.count_nonzero(self._mesh.referenced) // 2)
        return build_coarse_mesh(self._mesh, self._fine.vertex_normals, count)

    @cached_property
    def _coarse_surface(self) -> CurveSurface:
        return curve_surface(self._coarse.mesh)

    def _copy_under(self, points: SurfacePoints) -> tuple[Renumbered, CourseSurface]:
        """The canonical copy of the coarse component on which points lie, to search for courses."""
        component = int(self._coarse.mesh.face_component[points.faces[0]])
        if component not in self._copies:
            copy = renumbered(self._coarse.mesh, component)
            self._copies[component] = copy, CourseSurface(MappedSurface(copy.mesh))
        return self._copies[component]


def _on_coarse(fine: Mesh, coarse: CoarseMesh, request: Request) -> Request:
    """The request with its points and maps transferred to the coarse mesh.

    Raises
    ------
    ControlPointError, UnreachableError
        If control points coincide on the coarse mesh or lie on different components of it.
    """
    there = mapped_request(request, partial(coarse.nearest_points, fine), coarse.greatest_in_cells)
    return replace(there, points=locate_control_points(coarse.mesh, there.points, request.closed))
