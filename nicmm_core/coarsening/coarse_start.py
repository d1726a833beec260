"""Finds the start of a curve on a large mesh: on a coarse mesh, then mapped to the fine mesh."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from ..courses.course_surface import CourseSurface, edges_crossed
from ..errors import NicmmError
from ..geometry.array_types import IntArray
from ..geometry.mesh import Mesh
from ..geometry.numbering import Renumbered, renumbered
from ..geometry.surface_points import SurfacePoints, locate_control_points
from ..progress import checkpoint
from ..relaxation.curve_nodes import CurveSurface, curve_surface
from ..relaxation.noded_curve import NodedCurve, noded
from ..request import Request, renumbered_request
from .coarse_mesh import CoarseMesh, build_coarse_mesh
from .fine_curve import nodes_on_fine_mesh

CELLS = 4_000
"""Greatest number of cells of a coarse mesh."""

REDUCTION = 2
"""Least number of fine vertices per cell."""

SMALL, LARGE = 3_000, 6_000
"""Numbers of vertices up to which a mesh needs no coarse mesh, and above which it needs one."""

CROSSED = 7.0
"""Value of `edges_crossed` above which a mesh between these sizes needs a coarse mesh.

Such a mesh has needles.
"""


@dataclass(frozen=True)
class _CoarseSurface:
    """A coarse mesh, and canonical copies of its components to search for courses."""

    coarse: CoarseMesh
    surface: CurveSurface
    copies: dict[int, tuple[Renumbered, CourseSurface]] = field(default_factory=dict)

    def copy_under(self, points: SurfacePoints) -> tuple[Renumbered, CourseSurface]:
        """The copy of the component on which points lie."""
        component = int(self.coarse.mesh.face_component[points.faces[0]])
        if component not in self.copies:
            copy = renumbered(self.coarse.mesh, component)
            self.copies[component] = copy, CourseSurface(copy.mesh)
        return self.copies[component]


class CoarseStarts:
    """Finds starts on coarse meshes, one for each component, built on first use and cached.

    Parameters
    ----------
    surface : CurveSurface
        Surface of the fine mesh.
    """

    def __init__(self, surface: CurveSurface) -> None:
        self._mesh, self._fine = surface.mesh, surface
        self._made: dict[int, _CoarseSurface] = {}
        self._large: dict[int, bool] = {}

    def courses(
        self, request: Request, seed: int = 0
    ) -> Iterator[tuple[NodedCurve, IntArray] | None]:
        """Yield the courses on the coarse mesh, the best first, as curves on the fine mesh.

        With each comes the order in which it visits the control points. A course that is not simple
        on the fine mesh is None. There may be no courses where points are close together. `seed` is
        that of `CourseSurface.courses`.
        """
        with contextlib.suppress(NicmmError):
            here = self._coarse_surface(request)
            on_coarse = _on_coarse(self._mesh, here.coarse, request)
            copy, surface = here.copy_under(on_coarse.points)
            for course in surface.courses(renumbered_request(copy, on_coarse), seed):
                checkpoint()
                places = copy.original_points(course.places)
                nodes = noded(here.surface, places, course.control_nodes, request.closed)
                controls = request.points[course.visited]
                curve = nodes_on_fine_mesh(self._fine, here.coarse, nodes, controls)
                yield None if curve is None else (curve, course.visited)

    def is_large(self, request: Request) -> bool:
        """Whether the component of a request needs a coarse mesh."""
        component = int(self._mesh.face_component[request.points.faces[0]])
        if component not in self._large:
            count = self._n_vertices(component)
            needles = SMALL < count <= LARGE and edges_crossed(self._mesh, component) > CROSSED
            self._large[component] = count > LARGE or needles
        return self._large[component]

    def _n_vertices(self, component: int) -> int:
        """Number of vertices of a component."""
        inside = self._mesh.faces[self._mesh.face_component == component]
        return np.count_nonzero(np.bincount(inside.ravel()))

    def _coarse_surface(self, request: Request) -> _CoarseSurface:
        """The coarse mesh of the component of a request."""
        component = int(self._mesh.face_component[request.points.faces[0]])
        if component not in self._made:
            count = min(CELLS, self._n_vertices(component) // REDUCTION)
            coarse = build_coarse_mesh(self._mesh, self._fine.vertex_normals, component, count)
            self._made[component] = _CoarseSurface(coarse, curve_surface(coarse.mesh))
        return self._made[component]


def _on_coarse(fine: Mesh, coarse: CoarseMesh, request: Request) -> Request:
    """The request with its points and maps transferred to the coarse mesh.

    Raises
    ------
    ControlPointError, UnreachableError
        If control points coincide on the coarse mesh or lie on different components of it.
    """

    def nearest(points: SurfacePoints) -> SurfacePoints:
        return coarse.nearest_points(fine, points)

    return replace(
        request,
        points=locate_control_points(coarse.mesh, nearest(request.points), request.closed),
        via_points={key: nearest(points) for key, points in request.via_points.items()},
        obstacles=coarse.greatest_in_cells(request.obstacles),
        alignment=coarse.greatest_in_cells(request.alignment),
    )
