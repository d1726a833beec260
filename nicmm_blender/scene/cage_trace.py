# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps between a cage and the surface that modifiers generate from it.

A temporary copy of the object gets attributes that identify its vertices and faces, and the
modifiers carry these attributes over to the surface. The user's mesh is never written to: Blender
would report it as changed, and a mesh linked from another file cannot be written to at all.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import TYPE_CHECKING

import bpy
import numpy as np

from .isolation import evaluated_in_isolation
from .mesh_arrays import corner_vertices, read, triangle_faces
from .mesh_arrays import positions as positions_of
from .vertex_weights import add_missing_groups

if TYPE_CHECKING:
    from .surface import Surface

VERTEX, FACE, FACE_COORDINATES = "nicmm_vertex", "nicmm_face", "nicmm_place"
"""Names of the attributes of the copy."""

INSIDE = -1e-4
"""Smallest barycentric coordinate that counts as inside: attributes have single precision."""

COLLAPSING = {"DECIMATE", "WELD"}
"""Modifiers that move corners of the faces that they keep, so that a face is elsewhere."""

SAME_POSITION = 1e-5
"""Distance up to which two positions count as the same, relative to the surface's diagonal."""


@dataclass(frozen=True)
class CageTrace:
    """How a generated surface is related to its cage.

    A point in a face of the cage is given by two face coordinates, in which the corners of the face
    are those of a regular polygon on the unit circle.

    Attributes
    ----------
    positions : (n, 3) float array
        Positions of the cage's vertices in the object's local space.
    vertices : (n,) int array
        Vertex of the surface that each vertex of the cage became; -1 if it no longer exists.
    sizes : tuple of int
        Numbers of vertices, faces and corners of the cage.
    corners : (P, 3) int array
        First three vertices of each face of the cage.
    faces : (F,) int array
        Face of the cage that each triangle of the surface comes from; -1 if unknown.
    face_coordinates : (F, 3, 2) float array
        Face coordinates of the corners of each triangle in that face.
    """

    positions: np.ndarray
    vertices: np.ndarray
    sizes: tuple[int, int, int]
    corners: np.ndarray
    faces: np.ndarray
    face_coordinates: np.ndarray


@dataclass(frozen=True)
class CagePoints:
    """Points in faces of the cage.

    Attributes
    ----------
    faces : (k,) int array
        Face of the cage for each point; -1 if unknown.
    face_coordinates : (k, 2) float array
        Face coordinates of each point.
    copies : (k,) int array
        Index of the copy of the face, among all copies that modifiers make of it, in the order of
        the surface's triangles.
    """

    faces: np.ndarray
    face_coordinates: np.ndarray
    copies: np.ndarray


def trace(
    mesh_object: bpy.types.Object,
    shown: bpy.types.Mesh,
    loops: np.ndarray,
    cage_mesh: Callable[[bpy.types.Object], AbstractContextManager[bpy.types.Mesh]],
) -> CageTrace | None:
    """Trace the cage of an object through its modifiers.

    Returns None if the modifiers leave the faces as they are, since then vertices and faces of the
    surface are those of the cage.

    Parameters
    ----------
    mesh_object : bpy.types.Object
        The mesh object.
    shown : bpy.types.Mesh
        Its mesh with modifiers.
    loops : (F, 3) int array
        Corners of the triangles of that mesh.
    cage_mesh : callable
        Function of the mesh object that returns a context manager, which yields the mesh without
        modifiers.
    """
    if not any(modifier.show_viewport for modifier in mesh_object.modifiers):
        return None
    with cage_mesh(mesh_object) as cage:
        if _have_equal_faces(cage, shown):
            return None
        return _Copy(mesh_object, cage).trace(shown, loops)


def identity_trace(surface: Surface) -> CageTrace:
    """Describe the surface of a cage as generated from itself, each face being its own source."""
    polygons, loops = surface.polygons, surface.loops
    totals = np.bincount(polygons) + 2
    starts = np.full(len(totals), np.iinfo(np.int64).max)
    np.minimum.at(starts, polygons, loops.min(axis=1))
    number = loops - starts[polygons][:, None]
    return CageTrace(
        positions=surface.local_positions,
        vertices=np.arange(len(surface.local_positions)),
        sizes=(len(surface.local_positions), len(totals), int(loops.max()) + 1),
        corners=surface.faces[np.unique(polygons, return_index=True)[1]],
        faces=polygons,
        face_coordinates=_on_circle(number, totals[polygons][:, None]),
    )


def _on_circle(number: np.ndarray, total: np.ndarray) -> np.ndarray:
    """Coordinates of corners of a face, by their index in the face and its number of corners."""
    angle = 2.0 * np.pi * number / total
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def to_cage_points(
    surface: Surface, cage: CageTrace, faces: np.ndarray, barycentric: np.ndarray
) -> CagePoints:
    """Find points of a generated surface in faces of the cage.

    Parameters
    ----------
    surface : Surface
        The generated surface.
    cage : CageTrace
        Its relation to the cage.
    faces : (k,) int array
        Triangle of each point.
    barycentric : (k, 3) float array
        Barycentric coordinates of each point in its triangle.
    """
    coordinates = np.einsum("nj,njk->nk", barycentric, cage.face_coordinates[faces])
    found = CagePoints(cage.faces[faces], coordinates, np.zeros(len(faces), dtype=np.int64))
    triangles = _TrianglesOf(surface, cage, found.faces)
    for number, position in enumerate(surface.points(faces, barycentric)):
        copies = triangles.at(int(found.faces[number]), coordinates[number])
        away = [np.linalg.norm(surface.points(*copy)[0] - position) for copy in copies]
        if not copies or min(away) > SAME_POSITION * surface.diagonal:
            found.faces[number] = -1
        else:
            found.copies[number] = int(np.argmin(away))
    return found


def to_surface_points(
    surface: Surface, cage: CageTrace, cage_points: CagePoints
) -> tuple[np.ndarray, np.ndarray]:
    """Find points in faces of the cage on a generated surface.

    Returns
    -------
    faces : (k,) int array
        Triangle of each point; -1 if unknown.
    barycentric : (k, 3) float array
        Barycentric coordinates of each point in its triangle.
    """
    faces, barycentric = np.full(len(cage_points.faces), -1), np.zeros((len(cage_points.faces), 3))
    triangles = _TrianglesOf(surface, cage, cage_points.faces)
    for number, (face, copy) in enumerate(zip(cage_points.faces, cage_points.copies, strict=True)):
        copies = triangles.at(int(face), cage_points.face_coordinates[number])
        if copy < len(copies):
            (faces[number],), (barycentric[number],) = copies[copy]
    return faces, barycentric


class _TrianglesOf:
    """Looks up the triangles of a surface that come from given faces of the cage."""

    def __init__(self, surface: Surface, cage: CageTrace, faces: np.ndarray) -> None:
        self.surface, self.cage = surface, cage
        from_these = np.flatnonzero(np.isin(cage.faces, faces))
        self.order = from_these[np.argsort(cage.faces[from_these], kind="stable")]
        self.sorted = cage.faces[self.order]

    def at(self, face: int, coordinates: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """All copies of a point, each as triangle (1,) and barycentric coordinates (1, 3)."""
        if face < 0:
            return []
        first, last = np.searchsorted(self.sorted, [face, face + 1])
        triangles = self.order[first:last]
        barycentric = _barycentric(self.cage.face_coordinates[triangles], coordinates)
        inside = np.flatnonzero(barycentric.min(axis=1, initial=1.0) >= INSIDE)
        weights = np.clip(barycentric[inside], 0.0, None)
        weights /= weights.sum(axis=1, keepdims=True)
        positions = self.surface.points(triangles[inside], weights)
        copies: list[tuple[np.ndarray, np.ndarray]] = []
        where: list[np.ndarray] = []
        for triangle, weight, position in zip(triangles[inside], weights, positions, strict=True):
            near = SAME_POSITION * self.surface.diagonal
            if all(np.linalg.norm(position - other) > near for other in where):
                where.append(position)
                copies.append((np.array([triangle]), weight[None]))
        return copies


def _barycentric(triangles: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Barycentric coordinates (n, 3) of a point in triangles (n, 3, 2); -1 in degenerate ones."""
    first, second = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    to = point - triangles[:, 0]
    area = _cross(first, second)
    flat = np.abs(area) <= np.finfo(np.float32).eps
    area = np.where(flat, 1.0, area)
    u, v = _cross(to, second) / area, _cross(first, to) / area
    return np.where(flat[:, None], -1.0, np.stack([1.0 - u - v, u, v], axis=1))


def _cross(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    return one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]


class _Copy:
    """A copy of an object, to be evaluated in a separate scene, whose mesh has the attributes."""

    def __init__(self, mesh_object: bpy.types.Object, cage: bpy.types.Mesh) -> None:
        self.mesh_object, self.cage = mesh_object, cage
        self.identities = np.random.default_rng(0).random((len(cage.vertices), 3), np.float32)

    def trace(self, shown: bpy.types.Mesh, loops: np.ndarray) -> CageTrace:
        """Evaluate the copy and read its attributes."""
        copy = self.mesh_object.copy()
        copy.data = self.cage.copy()
        add_missing_groups(copy, self.mesh_object.vertex_groups.keys())
        if self.mesh_object.mode == "EDIT":
            for modifier in copy.modifiers:
                modifier.show_viewport = modifier.show_viewport and modifier.show_in_editmode
        self._write(copy.data)
        collapses = any(each.show_viewport and each.type in COLLAPSING for each in copy.modifiers)
        with evaluated_in_isolation(copy) as evaluated:
            return self._read(evaluated, shown, loops, collapses)

    def _write(self, data: bpy.types.Mesh) -> None:
        starts, totals = (
            read(data.polygons, name, 1, np.int32) for name in ("loop_start", "loop_total")
        )
        coordinates = np.zeros((len(data.loops), 3), dtype=np.float32)
        number = np.arange(len(coordinates)) - np.repeat(starts, totals)
        coordinates[:, :2] = _on_circle(number, np.repeat(totals, totals))
        # Counted from 1, since Blender gives 0 to faces that come from no other face.
        faces = np.arange(1, 1 + len(data.polygons), dtype=np.int32)
        for name, kind, domain, field, values in (
            (VERTEX, "FLOAT_VECTOR", "POINT", "vector", self.identities),
            (FACE, "INT", "FACE", "value", faces),
            (FACE_COORDINATES, "FLOAT_VECTOR", "CORNER", "vector", coordinates),
        ):
            data.attributes.new(name, kind, domain).data.foreach_set(field, values.ravel())

    def _read(
        self, mesh: bpy.types.Mesh, shown: bpy.types.Mesh, loops: np.ndarray, collapses: bool
    ) -> CageTrace:
        positions = positions_of(self.cage)
        vertices = np.full(len(positions), -1)
        faces, coordinates = np.full(len(loops), -1), np.zeros((*loops.shape, 2), np.float32)
        domains = {VERTEX: "POINT", FACE: "FACE", FACE_COORDINATES: "CORNER"}
        # A simulation may run differently in the copy, and nodes may remove attributes or move them
        # to another domain.
        if _have_equal_faces(mesh, shown):
            kept = {
                name: attribute
                for name, domain in domains.items()
                if (attribute := mesh.attributes.get(name)) is not None
                and attribute.domain == domain
            }
            if VERTEX in kept:
                vertices = _first_equal(
                    self.identities, read(kept[VERTEX].data, "vector", 3, np.float32)
                )
            if FACE in kept and FACE_COORDINATES in kept and not collapses:
                number = read(kept[FACE].data, "value", 1, np.int32) - 1
                faces = number[triangle_faces(shown)].astype(np.int64)
                coordinates = read(kept[FACE_COORDINATES].data, "vector", 3, np.float32)[loops, :2]
        starts = read(self.cage.polygons, "loop_start", 1, np.int32)
        corners = corner_vertices(self.cage)[starts[:, None] + np.arange(3)]
        sizes = _sizes(self.cage)
        return CageTrace(positions, vertices, sizes, corners, faces, coordinates)


def _have_equal_faces(one: bpy.types.Mesh, other: bpy.types.Mesh) -> bool:
    return _sizes(one) == _sizes(other) and np.array_equal(
        corner_vertices(one), corner_vertices(other)
    )


def _first_equal(wanted: np.ndarray, among: np.ndarray) -> np.ndarray:
    """For each row of `wanted`, the first row of `among` with the same bytes, or -1."""
    if not len(wanted):
        return np.zeros(0, dtype=np.int64)
    known, order = np.unique(_keys(wanted), return_index=True)
    keys = _keys(among)
    at = np.minimum(np.searchsorted(known, keys), len(known) - 1)
    equal = np.flatnonzero(known[at] == keys)[::-1]
    equal = equal[(among[equal] == wanted[order[at[equal]]]).all(axis=1)]
    found = np.full(len(wanted), -1)
    found[order[at[equal]]] = equal  # the last assignment, which is the first row, wins
    return found


def _keys(rows: np.ndarray) -> np.ndarray:
    """The first two single-precision numbers of each row, combined into one integer key."""
    return np.ascontiguousarray(rows[:, :2]).view(np.uint64)[:, 0]


def _sizes(mesh: bpy.types.Mesh) -> tuple[int, int, int]:
    return len(mesh.vertices), len(mesh.polygons), len(mesh.loops)
