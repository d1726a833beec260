"""Finds the start of a curve on a large mesh: on a coarse mesh, then mapped to the fine mesh."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from ..courses.course_surface import CourseSurface, edges_crossed
from ..errors import MeshError, NicmmError
from ..geometry.array_types import FloatArray, IntArray
from ..geometry.curve import SurfaceCurve
from ..geometry.mesh import Mesh
from ..geometry.numbering import Renumbered, renumbered
from ..geometry.surface_points import SurfacePoints, locate_control_points
from ..network.single_pass import infer
from ..progress import checkpoint, placed, subrange
from ..relaxation.curve_nodes import CurveSurface, curve_surface
from ..relaxation.discrete_curve import DiscreteCurve, noded
from ..request import Request, renumbered_request
from .coarse_mesh import CoarseMesh, build_coarse_mesh
from .fine_curve import curve_on_fine_mesh, nodes_on_fine_mesh

CELLS = 4_000
"""Number of cells of the first coarse mesh; training meshes have about as many vertices."""

REDUCTION = 2
"""Least number of fine vertices per cell."""

SMALL, LARGE = 3_000, 6_000
"""Numbers of vertices up to which a mesh needs no coarse mesh, and above which it needs one."""

CROSSED = 7.0
"""Value of `edges_crossed` above which a mesh between these sizes needs a coarse mesh.

Such a mesh has needles.
"""

GROWTH = 4
"""Factor of the number of cells after no curve was found on a coarse mesh."""


COARSE_SHARE = 0.3
"""Approximate share of building the coarse mesh in the time until the first start is found."""


@dataclass(frozen=True)
class CoarseStart:
    """A curve from which relaxation on the fine mesh starts.

    Attributes
    ----------
    curve : DiscreteCurve or SurfaceCurve
        A simple curve on the fine mesh.
    visited : (k,) int array
        Indices of the control points in the request, in the order visited.
    breaking_vertices : int
        Number of breaking vertices of the level set on the coarse mesh, if there was one.
    """

    curve: DiscreteCurve | SurfaceCurve
    visited: IntArray
    breaking_vertices: int = 0


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
    """Finds starts on coarse meshes of one mesh, each built on first use and cached.

    Parameters
    ----------
    surface : CurveSurface
        Surface of the fine mesh.
    """

    def __init__(self, surface: CurveSurface) -> None:
        self._mesh, self._fine = surface.mesh, surface
        self._made: dict[tuple[int, int], _CoarseSurface] = {}
        self._large: dict[int, bool] = {}

    def courses(self, request: Request, seed: int = 0) -> Iterator[CoarseStart | None]:
        """Yield the courses on a coarse mesh, the best first; None if not simple on the fine mesh.

        A small mesh has no coarse mesh and so no courses, and none may be found where points are
        close together. `seed` is that of `CourseSurface.courses`.
        """
        level = next(self._levels(request), None)
        if level is None:
            return
        with contextlib.suppress(NicmmError):
            on_coarse = _on_coarse(self._mesh, level.coarse, request)
            copy, surface = level.copy_under(on_coarse.points)
            for course in surface.courses(renumbered_request(copy, on_coarse), seed):
                checkpoint()
                places = copy.original_points(course.places)
                nodes = noded(level.surface, places, course.control_nodes, request.closed)
                controls = request.points[course.visited]
                curve = nodes_on_fine_mesh(self._fine, level.coarse, nodes, controls)
                yield None if curve is None else CoarseStart(curve, course.visited)

    def by_network(self, request: Request) -> CoarseStart | None:
        """The curve of the coarsest mesh on which the network finds one, or None.

        A small mesh has no coarse mesh, and the network may find no curve where points or strands
        are close together; the caller then falls back to full resolution.
        """
        for level in self._levels(request):
            with contextlib.suppress(NicmmError):
                start = self._by_network_on(level, request)
                if start is not None:
                    return start
        return None

    def is_large(self, request: Request) -> bool:
        """Whether the component of a request needs a coarse mesh."""
        component = int(self._mesh.face_component[request.points.faces[0]])
        if component not in self._large:
            count = self._n_vertices(component)
            needles = SMALL < count <= LARGE and edges_crossed(self._mesh, component) > CROSSED
            self._large[component] = count > LARGE or needles
        return self._large[component]

    def _levels(self, request: Request) -> Iterator[_CoarseSurface]:
        """The coarse meshes of the component of a request, the coarsest first."""
        if not self.is_large(request):
            return
        component = int(self._mesh.face_component[request.points.faces[0]])
        most = self._n_vertices(component) // REDUCTION
        count = min(CELLS, most)
        while count <= most:
            with contextlib.suppress(MeshError):
                yield self._surface(component, count)
            count *= GROWTH

    def _n_vertices(self, component: int) -> int:
        """Number of vertices of a component."""
        inside = self._mesh.faces[self._mesh.face_component == component]
        return np.count_nonzero(np.bincount(inside.ravel()))

    def _by_network_on(self, level: _CoarseSurface, request: Request) -> CoarseStart | None:
        """The network's curve on one coarse mesh, mapped to the fine mesh; None if it fails."""
        coarse = level.coarse
        on_coarse = _on_coarse(self._mesh, coarse, request)
        copy, _ = level.copy_under(on_coarse.points)
        with subrange(COARSE_SHARE, 0.9), placed(copy.in_original):
            zeros = infer(copy.mesh, renumbered_request(copy, on_coarse)).zeros
        if not zeros.is_simple_curve(copy.mesh, request.closed):
            return None
        curve = copy.curve_to_original(zeros.curves[0])
        visited = _visited(curve, on_coarse.points.positions(coarse.mesh))
        result = curve_on_fine_mesh(
            self._fine, coarse, level.surface, curve, request.points[visited]
        )
        return None if result is None else CoarseStart(result, visited, zeros.breaking_vertices)

    def _surface(self, component: int, count: int) -> _CoarseSurface:
        """The coarse mesh of a component with about `count` cells."""
        key = component, count
        if key not in self._made:
            coarse = build_coarse_mesh(self._mesh, self._fine.vertex_normals, component, count)
            self._made[key] = _CoarseSurface(coarse, curve_surface(coarse.mesh))
        return self._made[key]


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
        obstacles=_in_cells(coarse, request.obstacles),
        alignment=_in_cells(coarse, request.alignment),
    )


def _in_cells(coarse: CoarseMesh, weights: FloatArray | None) -> FloatArray | None:
    """The greatest weight in each cell, so that no obstacle and no lane is lost."""
    return None if weights is None else coarse.greatest_in_cells(weights)


def _visited(curve: SurfaceCurve, positions: FloatArray) -> IntArray:
    """Indices of control points, given by positions (k, 3), in the order of a curve."""
    passed = curve.points[curve.control_index]
    return np.linalg.norm(passed[:, None] - positions, axis=2).argmin(axis=1)
