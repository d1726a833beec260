"""Nodes of a curve on a surface: where they are, and how the surface and the curve lie there."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.mesh import Mesh, unoriented_vertices
from ..geometry.surface_points import SurfacePoints
from ..level_set.features import vertex_normals
from ..progress import checkpoint


@dataclass(frozen=True)
class CurveSurface:
    """What a curve needs of the surface that it moves on.

    Attributes
    ----------
    mesh : Mesh
    vertex_normals : (V, 3) float array
        Unit vectors. Their signs are ignored: every face reads them to its own side.
    feature_map : (V,) float array or None
        φ_fea.
    feature_weight : float
        λ_fea / λ_smooth, in 1/length², where there is a feature map.
    folded : (F,) bool array or None
        Faces that are folded back over others: they look away from the normals of their corners.
        None where there are none.
    """

    mesh: Mesh
    vertex_normals: FloatArray
    feature_map: FloatArray | None = None
    feature_weight: float = 0.0
    folded: BoolArray | None = None


def curve_surface(mesh: Mesh) -> CurveSurface:
    """The surface of a mesh, without a map."""
    normals = unsigned_normals(mesh)
    return CurveSurface(mesh, normals, folded=_folded_faces(mesh, normals))


def unsigned_normals(mesh: Mesh) -> FloatArray:
    """Unit normals at the vertices, up to their signs, shape (V, 3).

    Weighted by corner angle. A vertex that has been pushed over an edge has faces that are folded
    back, whose angles count as much as others'; at their corners normals are weighted by area,
    which no move of a vertex within its neighbours' plane changes. Where faces of opposite
    orientation meet, as somewhere on any Möbius strip, normals would cancel; there it is the
    direction that the faces' normals share best, whatever their signs.
    """
    normals = vertex_normals(mesh.vertices, mesh.faces)
    mixed = unoriented_vertices(mesh.faces)
    checkpoint()
    folded = np.setdiff1d(_corners_of_folded_faces(mesh, normals), mixed)
    owner, face_normals, areas = _faces_around(mesh, folded)
    area_vector = np.zeros((len(folded), 3))
    np.add.at(area_vector, owner, areas[:, None] * face_normals)
    there = area_vector.any(axis=1)
    normals[folded[there]] = _unit(area_vector[there])
    owner, face_normals, areas = _faces_around(mesh, mixed)
    weighted = areas[:, None] * face_normals
    spread = np.zeros((len(mixed), 3, 3))
    np.add.at(spread, owner, weighted[:, :, None] * face_normals[:, None, :])
    normals[mixed] = np.linalg.eigh(spread)[1][:, :, -1]
    return normals


def _corners_of_folded_faces(mesh: Mesh, normals: FloatArray) -> IntArray:
    """Vertices of faces that look away from the normal of one of their corners, ascending.

    Or across it, as every face does where the normal is zero.
    """
    folded = np.zeros(len(mesh.vertices), dtype=bool)
    folded[mesh.faces[(_facing(mesh, normals) <= 0.0).any(axis=1)]] = True
    return np.flatnonzero(folded)


def _folded_faces(mesh: Mesh, normals: FloatArray) -> BoolArray | None:
    """Faces that look away from the normals of their corners, None where none does.

    None is said to where faces of opposite orientation meet: signs of normals mean nothing there.
    """
    folded = _facing(mesh, normals).sum(axis=1) < 0.0
    if folded.any():
        mixed = np.zeros(len(mesh.vertices), dtype=bool)
        mixed[unoriented_vertices(mesh.faces)] = True
        folded &= ~mixed[mesh.faces].any(axis=1)
    return folded if folded.any() else None


def _facing(mesh: Mesh, normals: FloatArray) -> FloatArray:
    """Cosines between the normals of faces and of their corners, (F, 3)."""
    checkpoint()
    return np.einsum("fcd,fd->fc", normals[mesh.faces], mesh.face_normals)


def _faces_around(mesh: Mesh, vertices: IntArray) -> tuple[IntArray, FloatArray, FloatArray]:
    """Of each face round some vertices: which of these it is at, its normal and its area."""
    incidence = mesh.vertex_faces[vertices]
    owner = np.repeat(np.arange(len(vertices)), np.diff(incidence.indptr))
    return owner, mesh.face_normals[incidence.indices], mesh.face_areas[incidence.indices]


@dataclass(frozen=True)
class Nodes:
    """Nodes of a curve on a surface.

    Attributes
    ----------
    places : SurfacePoints
        n points.
    closed : bool
        Whether the last node joins the first.
    positions : (n, 3) float array
    normals : (n, 3) float array
        Unit vectors.
    phi_fea : (n,) float array
        φ_fea.
    """

    places: SurfacePoints
    closed: bool
    positions: FloatArray
    normals: FloatArray
    phi_fea: FloatArray

    @cached_property
    def steps(self) -> FloatArray:
        """Vectors from each node to the next, zero at the last of an open curve, (n, 3)."""
        return _steps(self.positions, self.closed)

    @cached_property
    def lengths(self) -> FloatArray:
        """Lengths of the steps; (n,), or (n - 1,) of an open curve."""
        steps = self.steps.T
        lengths = np.sqrt(dot(steps, steps))
        return lengths if self.closed else lengths[:-1]

    @cached_property
    def conormals(self) -> FloatArray:
        """Unit vectors across the curve in the tangent planes, shape (n, 3)."""
        unit = _unit(self.steps)
        return _unit(cross(self.normals.T, unit.T + before_each(unit.T)).T)

    def conormal_derivatives(self, surface: CurveSurface) -> tuple[FloatArray, FloatArray]:
        """How normals, (n, 3), and φ_fea, (n,), change as their node moves along its conormal."""
        mesh, faces = surface.mesh, self.places.faces
        a, b, c = mesh.vertices[mesh.faces[faces]].transpose(1, 0, 2)
        one, other = b - a, c - a
        # Barycentric coordinates of the move: least squares in the plane of the face.
        p, q, r = (one * one).sum(axis=1), (one * other).sum(axis=1), (other * other).sum(axis=1)
        f, g = (one * self.conormals).sum(axis=1), (other * self.conormals).sum(axis=1)
        # No smaller than what rounding leaves of it where two long sides make hardly any angle.
        determinant = np.maximum(p * r - q * q, np.finfo(float).eps * p * r)
        determinant = np.maximum(determinant, tolerances.TINY)
        u, v = (r * f - q * g) / determinant, (p * g - q * f) / determinant
        change = np.stack([-u - v, u, v], axis=1)
        corner_normals = _corner_normals(surface, faces)
        length = np.einsum("nc,ncd,nd->n", self.places.barycentric, corner_normals, self.normals)
        turn = np.einsum("nc,ncd->nd", change, corner_normals)
        turn /= np.maximum(length, tolerances.TINY)[:, None]
        turn -= (turn * self.normals).sum(axis=1, keepdims=True) * self.normals
        drift = np.zeros(len(faces))
        if surface.feature_map is not None:
            drift = (change * surface.feature_map[mesh.faces[faces]]).sum(axis=1)
        return turn, drift


def nodes_at(surface: CurveSurface, places: SurfacePoints, closed: bool) -> Nodes:
    """Nodes with what the energy needs of the surface there."""
    weight = places.barycentric
    normals = _unit(np.einsum("nc,ncd->nd", weight, _corner_normals(surface, places.faces)))
    phi_fea = np.ones(len(places))
    if surface.feature_map is not None:
        corners = surface.mesh.faces[places.faces]
        phi_fea = (weight * surface.feature_map[corners]).sum(axis=1)
    return Nodes(places, closed, places.positions(surface.mesh), normals, phi_fea)


def _corner_normals(surface: CurveSurface, faces: IntArray) -> FloatArray:
    """Vertex normals at the corners, turned to the side of each face, shape (n, 3, 3)."""
    normals = surface.vertex_normals[surface.mesh.faces[faces]]
    against = (normals * surface.mesh.face_normals[faces][:, None]).sum(axis=2) < 0.0
    return normals * np.where(against, -1.0, 1.0)[..., None]


def _steps(positions: FloatArray, closed: bool) -> FloatArray:
    steps = after_each(positions.T).T - positions
    if not closed:
        steps[-1] = 0.0
    return steps


def _unit(vectors: FloatArray) -> FloatArray:
    lengths = np.sqrt(np.einsum("nd,nd->n", vectors, vectors))
    return vectors / np.maximum(lengths, tolerances.TINY)[:, None]


def after_each(values: FloatArray) -> FloatArray:
    """What the next node of the ring has; nodes are the last axis."""
    return np.concatenate([values[..., 1:], values[..., :1]], axis=-1)


def before_each(values: FloatArray) -> FloatArray:
    """What the node before has; nodes are the last axis."""
    return np.concatenate([values[..., -1:], values[..., :-1]], axis=-1)


def dot(one: FloatArray, other: FloatArray) -> FloatArray:
    """Products of vectors whose components are the first axis, which is several times as fast."""
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]


def cross(one: FloatArray, other: FloatArray) -> FloatArray:
    """Vectors across two others, components first."""
    return np.stack(
        [
            one[1] * other[2] - one[2] * other[1],
            one[2] * other[0] - one[0] * other[2],
            one[0] * other[1] - one[1] * other[0],
        ]
    )
