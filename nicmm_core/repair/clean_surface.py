"""The surface that the faces of a mesh describe, whichever vertices they share.

It is cleaned in three steps. Doubled faces are left out. Vertices of open edges that coincide are
joined. Open edges are divided where vertices of other open edges lie on them, and faces without
area are removed. So meshes that differ only in these have the same clean surface, or, where faces
are divided, almost the same.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.mesh import Mesh
from ..progress import checkpoint
from .degenerate_faces import without_flat_faces
from .face_parts import FaceParts
from .open_edges import distinct_faces, joined_vertices, vertices_stay, without_t_junctions
from .removed_faces import RemovedFaces


@dataclass(frozen=True, eq=False)
class CleanSurface:
    """The clean surface of a mesh.

    Attributes
    ----------
    original : Mesh
        The given mesh, with V vertices and F faces.
    vertices : (V, 3) float array
        Positions of its vertices; where gaps are closed, they differ from the given ones.
    parts : FaceParts
        The faces of the surface, with the given face of each.
    joined : (V,) int array
        The first of the given vertices that were joined with each.
    place : (V,) int array
        The vertex of the surface at which each given vertex lies. It differs from `joined` where an
        edge without length was removed.
    divisions : (d, 3) int array
        Vertices at which edges were divided, and the two ends of the edge of each.
    repairs : dict of str to int
        How often each repair was made.
    """

    original: Mesh
    vertices: FloatArray
    parts: FaceParts
    joined: IntArray
    place: IntArray
    divisions: IntArray
    repairs: dict[str, int]

    @cached_property
    def mesh(self) -> Mesh:
        """The surface as a mesh; the given one if it is clean."""
        if self.parts.faces is self.original.faces and self.vertices is self.original.vertices:
            return self.original
        return Mesh(self.vertices, self.parts.faces)

    @cached_property
    def removed(self) -> BoolArray:
        """Given faces of which no part remains, since they are doubled or have no area, (F,)."""
        removed = np.ones(len(self.original.faces), dtype=bool)
        removed[self.parts.parent] = False
        return removed

    @cached_property
    def removed_faces(self) -> RemovedFaces:
        """These faces, which curves on the given mesh have to cross."""
        return RemovedFaces(self.original, self.joined[self.original.faces], self.removed)


def clean_surfaces(mesh: Mesh) -> list[CleanSurface]:
    """The clean surface of a mesh, followed by its surface after fewer steps.

    Removing a face without area may separate what it connected, for example two fans that meet at
    an edge without length. Steps that change nothing, or leave no face, are left out.
    """
    distinct = without_doubled_faces(mesh)
    joined = with_joined_vertices(distinct)
    return list(dict.fromkeys([without_faces_of_no_area(joined), joined, distinct]))


def joined_surface(mesh: Mesh) -> CleanSurface:
    """The surface of a mesh with coincident vertices joined, without doubled faces."""
    return with_joined_vertices(without_doubled_faces(mesh))


def without_doubled_faces(mesh: Mesh) -> CleanSurface:
    """The surface of a mesh on which faces with the same corners count once."""
    parts, vertex = distinct_faces(mesh), np.arange(len(mesh.vertices))
    repairs = {
        "vertices joined": 0,
        "doubled faces left out": len(mesh.faces) - len(parts.faces),
        "faces without area removed": 0,
        "T-junctions closed": 0,
    }
    divisions = np.zeros((0, 3), dtype=np.int64)
    return CleanSurface(mesh, mesh.vertices, parts, vertex, vertex, divisions, repairs)


def with_joined_vertices(surface: CleanSurface) -> CleanSurface:
    """A surface on which vertices of open edges that coincide are one vertex."""
    joined, vertices = joined_vertices(surface.original, surface.parts)
    if vertices_stay(joined):
        return surface
    # Both ends of a side may have been joined; a face without area is left out then.
    parts = surface.parts.with_faces(joined[surface.parts.faces]).distinct()
    if not len(parts.faces):
        return surface
    repairs = surface.repairs | {
        "vertices joined": int((joined != surface.joined).sum()),
        "doubled faces left out": len(surface.original.faces) - len(parts.faces),
    }
    return replace(
        surface, vertices=vertices, parts=parts, joined=joined, place=joined, repairs=repairs
    )


def without_faces_of_no_area(surface: CleanSurface) -> CleanSurface:
    """A surface without T-junctions and faces of no area."""
    mesh, vertices = surface.original, surface.vertices
    parts, joints = without_t_junctions(mesh, vertices, surface.parts)
    short = tolerances.SAME_POSITION * mesh.diagonal
    parts, merged, divisions = without_flat_faces(vertices, parts, short)
    if parts is surface.parts or not len(parts.faces):
        return surface
    checkpoint()
    repairs = surface.repairs | {
        "faces without area removed": len(surface.parts.faces) - len(np.unique(parts.parent)),
        "T-junctions closed": len(joints),
    }
    return replace(
        surface,
        parts=parts,
        place=merged[surface.joined],
        divisions=np.concatenate([merged[joints], divisions]),
        repairs=repairs,
    )
