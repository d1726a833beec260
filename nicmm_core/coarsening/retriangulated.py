"""The same surface in its Delaunay triangulation, on which curves are found.

So they do not depend on the diagonals along which the faces of the given mesh were divided.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from ..geometry import tolerances
from ..geometry.array_types import FloatArray, IntArray
from ..geometry.delaunay import delaunay_faces, sorted_faces
from ..geometry.mesh import Mesh
from ..geometry.surface_points import SurfacePoints, coincide
from ..geometry.vectors import dot
from ..relaxation.curve_nodes import CurveSurface, Nodes
from ..relaxation.discrete_curve import DiscreteCurve
from ..relaxation.simple_curve import simple_curve
from ..request import Request, mapped_request
from .coarse_mesh import CoarseMesh

LEAST_FACING = 0.3
"""Least cosine between the normal of a node and that of the face to which it moves."""


@dataclass(frozen=True)
class Retriangulated:
    """A mesh and its Delaunay triangulation, which has the same vertices.

    Attributes
    ----------
    original : Mesh
    delaunay : CoarseMesh
        Its cells are the single vertices.
    """

    original: Mesh
    delaunay: CoarseMesh

    @property
    def mesh(self) -> Mesh:
        """The mesh of the Delaunay triangulation."""
        return self.delaunay.mesh

    def request_to(self, request: Request) -> Request | None:
        """Map a request to the Delaunay triangulation; None if points coincide there."""
        points_to = partial(self.delaunay.nearest_points, self.original)
        there = mapped_request(request, points_to, lambda weights: weights)
        return None if coincide(self.mesh, there.points) else there

    def curve_back(
        self, surface: CurveSurface, curve: DiscreteCurve, controls: SurfacePoints
    ) -> DiscreteCurve | None:
        """Map a curve to the surface of the original; None if it is not simple there.

        The nodes move along normals. Nearest places would be displaced along the surface, each in
        another direction. Nodes whose normals meet no face nearby are left out.
        """
        nodes, control_nodes = curve.nodes, curve.control_nodes
        node, places = self.along_normals(nodes)
        kept = np.union1d(node, control_nodes)
        faces, barycentric = np.zeros(len(kept), dtype=np.int64), np.ones((len(kept), 3))
        at = np.searchsorted(kept, node)
        faces[at], barycentric[at] = places.faces, places.barycentric
        return simple_curve(
            surface,
            SurfacePoints(faces, barycentric),
            np.searchsorted(kept, control_nodes),
            controls,
            curve.closed,
            normals=nodes.normals[kept],
            corners=np.isin(control_nodes, curve.corner_nodes),
        )

    def along_normals(self, nodes: Nodes) -> tuple[IntArray, SurfacePoints]:
        """The places of the original to which nodes move along their normals.

        Returns
        -------
        (m,) int array
            Indices of the nodes with such a place, ascending.
        SurfacePoints
            The m places.
        """
        mesh = self.original
        around = mesh.faces_near(self.mesh.faces[nodes.places.faces])
        node = np.arange(len(nodes.positions)).repeat(np.diff(around.indptr))
        face = around.indices.astype(np.int64)
        barycentric, along = _meeting(
            mesh.vertices[mesh.faces[face]], nodes.positions[node], nodes.normals[node]
        )
        facing = dot(mesh.face_normals[face].T, nodes.normals[node].T)
        inside = (barycentric.min(axis=1) >= -tolerances.ROUNDED) & (facing > LEAST_FACING)
        node, face, barycentric = node[inside], face[inside], barycentric[inside].clip(0.0)
        order = np.lexsort((face, np.abs(along[inside]), node))
        met, first = np.unique(node[order], return_index=True)
        return met, SurfacePoints(face[order[first]], barycentric[order[first]])


def _meeting(
    corners: FloatArray, positions: FloatArray, directions: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Where lines meet the planes of triangles, (p, 3, 3): barycentric coordinates and distances.

    The coordinates, (p, 3), are -1 if the line is parallel to the plane.
    """
    one, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    away, across = positions - corners[:, 0], np.cross(directions, other)
    determinant = dot(one.T, across.T)
    parallel = np.abs(determinant) <= tolerances.TINY
    scale = 1.0 / np.where(parallel, 1.0, determinant)
    aside = np.cross(away, one)
    second, third = dot(away.T, across.T) * scale, dot(directions.T, aside.T) * scale
    barycentric = np.stack([1.0 - second - third, second, third], axis=1)
    barycentric[parallel] = -1.0
    return barycentric, dot(other.T, aside.T) * scale


def retriangulated(mesh: Mesh) -> Retriangulated | None:
    """The Delaunay triangulation of a canonical copy; None if it is the mesh itself."""
    faces = delaunay_faces(mesh)
    if np.array_equal(sorted_faces(mesh.faces), faces):
        return None
    every = np.arange(len(mesh.vertices))
    return Retriangulated(mesh, CoarseMesh(Mesh(mesh.vertices, faces), every, every))
