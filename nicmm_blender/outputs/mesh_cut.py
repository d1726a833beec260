# SPDX-License-Identifier: GPL-3.0-or-later
"""Applies a cut of the core to a Blender mesh and interpolates the attributes of the mesh.

Faces that the curve does not touch stay unchanged. Blender itself interpolates every layer of the
mesh at new vertices, corners and edges: weights, shape keys, colours and each UV map. Integers are
those of the nearest vertex or corner. Corners are interpolated within one face, so values do not
mix across seams.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import bpy
import numpy as np

import bmesh

from ..scene import mesh_arrays
from ..scene.messages import InputError
from ..scene.surface import Surface

if TYPE_CHECKING:
    from ...nicmm_core import CutMesh
    from ...nicmm_core.outputs.polygons import CutPolygons


@contextmanager
def editable(mesh_object: bpy.types.Object) -> Iterator[bmesh.types.BMesh]:
    """Yield the mesh as a BMesh and write it back at the end, in Object Mode or Edit Mode."""
    mesh = mesh_object.data
    if mesh_object.mode == "EDIT":
        edited = bmesh.from_edit_mesh(mesh)
        yield edited
        bmesh.update_edit_mesh(mesh)
        return
    edited = bmesh.new()
    try:
        edited.from_mesh(mesh)
        yield edited
        edited.to_mesh(mesh)
    finally:
        edited.free()
    mesh.update()


def check_editable(mesh_object: bpy.types.Object, cuts: bool) -> None:
    """Raise an error if the mesh cannot be changed, or if a change would affect other objects."""
    mesh = mesh_object.data
    name = mesh_object.name
    library = mesh.library or mesh_object.library
    if library is not None:
        raise InputError(
            f'The mesh of "{name}" is linked from {library.filepath}. '
            "Make it local (Object > Relations > Make Local) or choose an output that does not "
            "change the mesh"
        )
    if mesh.override_library is not None:
        raise InputError(
            f'The mesh of "{name}" is a library override, whose faces cannot be changed. Make it '
            "local or choose an output that does not change the mesh"
        )
    users = mesh.users - mesh.use_fake_user
    if users > 1:
        raise InputError(
            f'The mesh of "{name}" is shared by {users} users, and all of them would change. '
            "Make it single-user (Object > Relations > Make Single User > "
            "Object & Data) or choose an output that does not change the mesh"
        )
    if cuts and any(modifier.type == "MULTIRES" for modifier in mesh_object.modifiers):
        raise InputError(
            f'"{name}" has a Multiresolution modifier, whose details belong to the current faces. '
            "Apply it first, or choose an output that does not cut"
        )


class CornerNormals:
    """Custom normals of a mesh in Object Mode, to be restored after a cut.

    Blender stores them relative to the faces around each vertex, so the stored values should not be
    interpolated. In Edit Mode Blender interpolates them nevertheless, which is a good approximation
    if these faces are nearly flat.
    """

    def __init__(self, mesh_object: bpy.types.Object) -> None:
        mesh = mesh_object.data
        self.has_values = mesh.has_custom_normals and mesh_object.mode == "OBJECT"
        if self.has_values:
            self.values = mesh_arrays.read(mesh.corner_normals, "vector", 3, np.float32)
            self.loop_starts = mesh_arrays.read(mesh.polygons, "loop_start", 1, np.int32)

    def after_cut(
        self, surface: Surface, cut: CutMesh, polygons: CutPolygons, weights: np.ndarray
    ) -> np.ndarray:
        """Normals of all corners (n, 3): first the unchanged faces in order, then the new faces."""
        counts = np.diff(self.loop_starts, append=len(self.values))
        stays = np.ones(len(counts), dtype=bool)
        stays[polygons.source] = False
        old = self.values[np.repeat(stays, counts)]
        triangles, corners = (
            np.concatenate([np.zeros(0, dtype=np.int64), *map(_integers, found)])
            for found in (polygons.triangles, polygons.corners)
        )
        place = (cut.faces[triangles] == corners[:, None]).argmax(axis=1)
        loops = surface.loops[cut.source_face[triangles]]
        new = np.einsum("nj,njk->nk", weights[triangles, place], self.values[loops])
        return np.concatenate([old, new])


def _integers(values: list[int]) -> np.ndarray:
    return np.asarray(values, dtype=np.int64)


def apply(
    edited: bmesh.types.BMesh,
    mesh: bpy.types.Mesh,
    surface: Surface,
    cut: CutMesh,
    polygons: CutPolygons,
    weights: np.ndarray,
) -> tuple[list[bmesh.types.BMVert], list[bmesh.types.BMFace]]:
    """Cut a BMesh.

    Parameters
    ----------
    edited : bmesh.types.BMesh
        Mesh to cut.
    mesh : bpy.types.Mesh
        The mesh that `edited` was read from.
    surface : Surface
        The surface that the core has cut.
    cut : CutMesh
        The cut of the core.
    polygons : CutPolygons
        Polygons made from the cut.
    weights : (F', 3, 3) float array
        Barycentric coordinates of the corners of the cut in their source triangles.

    Returns
    -------
    vertices : list of bmesh.types.BMVert
        Vertices in the order of the cut.
    faces : list of bmesh.types.BMFace
        First the unchanged faces in order, then the new faces.
    """
    for sequence in (edited.verts, edited.edges, edited.faces):
        sequence.ensure_lookup_table()
        sequence.index_update()
    vertices = list(edited.verts)
    faces = list(edited.faces)
    old_faces = {index: faces[index] for index in set(polygons.source.tolist())}
    faces = [face for index, face in enumerate(faces) if index not in old_faces]
    vertices += _new_vertices(edited, surface, cut, vertices)
    split_edges = _split_edges(edited, surface, cut, vertices)
    triangles = _SourceTriangles(edited, mesh, surface, old_faces)

    for corners, parts, source in zip(
        polygons.corners, polygons.triangles, polygons.source.tolist(), strict=True
    ):
        face = edited.faces.new([vertices[v] for v in corners], old_faces[source])
        for place, (vertex, part) in enumerate(zip(corners, parts, strict=True)):
            weight = weights[part, cut.faces[part].tolist().index(vertex)]
            triangles.interpolate(face, place, int(cut.source_face[part]), weight)
        face.normal_update()
        faces.append(face)

    bmesh.ops.delete(edited, geom=list(old_faces.values()), context="FACES_ONLY")
    bmesh.ops.delete(edited, geom=triangles.helper_vertices, context="VERTS")
    for edge in split_edges:
        edited.edges.remove(edge)
    for sequence in (edited.verts, edited.edges, edited.faces):
        sequence.index_update()
        sequence.ensure_lookup_table()
    return vertices, faces


def _new_vertices(
    edited: bmesh.types.BMesh, surface: Surface, cut: CutMesh, vertices: list[bmesh.types.BMVert]
) -> list[bmesh.types.BMVert]:
    new_vertices = []
    for face, weight in zip(cut.new_face.tolist(), cut.new_barycentric, strict=True):
        around = [
            (float(w), vertices[v])
            for w, v in sorted(zip(weight, surface.faces[face].tolist(), strict=True), reverse=True)
            if w > 0.0
        ]
        place = sum((vertex.co * w for w, vertex in around[1:]), around[0][1].co * around[0][0])
        # Layers that cannot be interpolated, such as integers, come from the nearest vertex.
        new = edited.verts.new(place, around[0][1])
        (first, one), (second, other) = around[:2]
        new.copy_from_vert_interp((one, other), second / (first + second))
        if len(around) == 3:
            between = edited.verts.new(place, new)
            between.copy_from_vert_interp((one, other), second / (first + second))
            new.copy_from_vert_interp((between, around[2][1]), around[2][0])
            edited.verts.remove(between)
        new_vertices.append(new)
    return new_vertices


def _split_edges(
    edited: bmesh.types.BMesh, surface: Surface, cut: CutMesh, vertices: list[bmesh.types.BMVert]
) -> list[bmesh.types.BMEdge]:
    """Add the parts of the cut edges, with their attributes; return the old edges."""
    along: dict[tuple[int, int], list[tuple[float, int]]] = {}
    n_input = len(surface.local_positions)
    for new, (face, weight) in enumerate(
        zip(cut.new_face.tolist(), cut.new_barycentric.tolist(), strict=True)
    ):
        corners = zip(surface.faces[face].tolist(), weight, strict=True)
        ends = sorted((v, w) for v, w in corners if w > 0.0)
        if len(ends) == 2:
            (low, near), (high, far) = ends
            along.setdefault((low, high), []).append((far / (near + far), n_input + new))
    old = []
    for (low, high), points in along.items():
        edge = edited.edges.get((vertices[low], vertices[high]))
        if edge is None:  # a diagonal inside a polygon is no edge of the mesh
            continue
        old.append(edge)
        order = [low, *(vertex for _, vertex in sorted(points)), high]
        for one, other in zip(order[:-1], order[1:], strict=True):
            edited.edges.new((vertices[one], vertices[other]), edge)
    return old


class _SourceTriangles:
    """Temporary faces for the triangles of polygons, as sources for interpolated corners."""

    def __init__(
        self,
        edited: bmesh.types.BMesh,
        mesh: bpy.types.Mesh,
        surface: Surface,
        old_faces: dict[int, bmesh.types.BMFace],
    ) -> None:
        self.edited, self.surface, self.old_faces = edited, surface, old_faces
        self.loop_starts = mesh_arrays.read(mesh.polygons, "loop_start", 1, np.int32)
        self.faces: dict[int, bmesh.types.BMFace] = {}
        self.helper_vertices: list[bmesh.types.BMVert] = []

    def interpolate(
        self, face: bmesh.types.BMFace, place: int, triangle: int, weight: np.ndarray
    ) -> None:
        """Interpolate the layers at a corner of a face from the corners of a triangle."""
        polygon = int(self.surface.polygons[triangle])
        source = self.old_faces[polygon]
        places = (self.surface.loops[triangle] - self.loop_starts[polygon]).tolist()
        face.loops[place].copy_from(source.loops[places[int(np.argmax(weight))]])
        if np.max(weight) < 1.0:
            # Looked up again: copying invalidates the corner's Python object.
            loop = face.loops[place]
            loop.copy_from_face_interp(self._face(triangle, source, places), False, False)

    def _face(
        self, triangle: int, source: bmesh.types.BMFace, places: list[int]
    ) -> bmesh.types.BMFace:
        if len(source.loops) == 3:
            return source
        if triangle not in self.faces:
            # On new vertices, since two faces of a BMesh cannot share all their vertices.
            corners = [self.edited.verts.new(source.loops[place].vert.co) for place in places]
            helper = self.edited.faces.new(corners)
            for corner, place in enumerate(places):
                helper.loops[corner].copy_from(source.loops[place])
            self.helper_vertices += corners
            self.faces[triangle] = helper
        return self.faces[triangle]
