"""Converts polylines near a surface to `SurfaceCurve`, so that they can be measured."""

from __future__ import annotations

import igl
import numpy as np
from scipy.spatial import cKDTree

from nicmm_core.geometry.array_types import FloatArray, IntArray
from nicmm_core.geometry.curve import SurfaceCurve, curve_on_mesh
from nicmm_core.geometry.mesh import Mesh
from nicmm_core.geometry.normals import vertex_normals
from nicmm_core.paper.problem import Problem

PARTS_OF_A_SEGMENT = 16
"""Points on each segment at which distances are measured."""


class NearestPoints:
    """Nearest-point queries on one mesh, with a search tree that is built once.

    Parameters
    ----------
    mesh : Mesh
        Triangle mesh.
    """

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        self._vertices = np.array(mesh.vertices)
        self._faces = np.array(mesh.faces)
        self._tree = igl.AABB()
        self._tree.init(self._vertices, self._faces)
        self._vertex_normals = vertex_normals(mesh.vertices, mesh.faces)

    def project(self, positions: FloatArray) -> tuple[FloatArray, IntArray, FloatArray]:
        """Distance, face and barycentric coordinates of each position's nearest surface point."""
        squared, faces, nearest = self._tree.squared_distance(
            self._vertices, self._faces, np.ascontiguousarray(positions)
        )
        faces = np.atleast_1d(faces).astype(np.int64)
        corners = np.ascontiguousarray(self._vertices[self._faces[faces]].transpose(1, 0, 2))
        barycentric = igl.barycentric_coordinates(np.atleast_2d(nearest), *corners)
        barycentric = np.clip(barycentric, 0.0, None)
        barycentric /= barycentric.sum(axis=1, keepdims=True)
        return np.sqrt(np.atleast_1d(squared)), faces, barycentric

    def normals(self, faces: IntArray, barycentric: FloatArray) -> FloatArray:
        """Unit normals, interpolated from the vertex normals."""
        corners = self._vertex_normals[self._faces[faces]]
        normals = (barycentric[:, :, None] * corners).sum(axis=1)
        return normals / np.linalg.norm(normals, axis=1, keepdims=True)

    def curve(
        self, positions: FloatArray, control_index: IntArray, closed: bool = True
    ) -> SurfaceCurve:
        """Curve through the surface points nearest to the given positions.

        The points lie on the surface; the segments between them may leave it.
        """
        _, faces, barycentric = self.project(positions)
        return curve_on_mesh(self.mesh, closed, faces, barycentric, control_index)

    def greatest_distance(self, positions: FloatArray) -> float:
        """Greatest distance from the segments of a closed polyline to the mesh."""
        along = np.linspace(0.0, 1.0, PARTS_OF_A_SEGMENT, endpoint=False)[:, None, None]
        following = np.roll(positions, -1, axis=0)
        places = (1.0 - along) * positions + along * following
        return float(self.project(places.reshape(-1, 3))[0].max())


def initial_path(mesh: Mesh, problem: Problem) -> SurfaceCurve:
    """Initial path along edges that a design starts from."""
    loop, working = problem.loop, problem.working
    control_index = np.searchsorted(
        loop.vertices, loop.control_vertices, sorter=np.argsort(loop.vertices)
    )
    control_index = np.argsort(loop.vertices)[control_index]
    return NearestPoints(mesh).curve(working.vertices[loop.vertices], control_index)


def misses(positions: FloatArray, control_positions: FloatArray) -> float:
    """Greatest distance from a control point to a closed polyline."""
    along = np.linspace(0.0, 1.0, PARTS_OF_A_SEGMENT, endpoint=False)[:, None, None]
    places = (1.0 - along) * positions + along * np.roll(positions, -1, axis=0)
    return float(cKDTree(places.reshape(-1, 3)).query(control_positions)[0].max())
