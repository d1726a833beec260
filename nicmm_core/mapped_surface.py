"""The surface of a mesh with the maps of requests; φ_fea is computed once for the same maps."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

from .geometry.mesh import Mesh
from .maps.guidance import surface_unit
from .relaxation.curve_nodes import CurveSurface, curve_surface, with_maps
from .request import Request, same_maps


class MappedSurface:
    """A connected surface, with or without the maps of a request.

    Parameters
    ----------
    mesh : Mesh
        A connected mesh.
    surface : CurveSurface, optional
        Its surface, by default with the vertex normals of the mesh.
    same_vertices : MappedSurface, optional
        The surface of another mesh with the same vertices, from which φ_fea is taken.
    """

    def __init__(
        self,
        mesh: Mesh,
        surface: CurveSurface | None = None,
        same_vertices: MappedSurface | None = None,
    ) -> None:
        self.mesh, self._given, self._other = mesh, surface, same_vertices
        self._latest: tuple[Request, CurveSurface] | None = None

    @cached_property
    def without_maps(self) -> CurveSurface:
        """The surface alone."""
        return curve_surface(self.mesh) if self._given is None else self._given

    @cached_property
    def unit(self) -> float:
        """Square root of the area of the mesh."""
        return surface_unit(self.mesh)

    def of(self, request: Request) -> CurveSurface:
        """The surface with the maps and the weight of the normal curvature of a request.

        The maps are those of the vertices of the mesh.
        """
        surface = self.without_maps
        if request.has_maps:
            if self._latest is None or not same_maps(self._latest[0], request):
                self._latest = request, self._with_maps(request)
            surface = self._latest[1]
        if not request.normal_bending:
            return surface
        return replace(surface, normal_bending=request.normal_bending)

    def _with_maps(self, request: Request) -> CurveSurface:
        if self._other is None:
            maps = request.obstacles, request.alignment
            return with_maps(self.without_maps, *maps, self.unit)
        there = self._other.of(request)
        return replace(
            self.without_maps,
            feature_map=there.feature_map,
            feature_weight=there.feature_weight,
        )
