"""The surface that the faces of a mesh describe, whichever vertices they share.

Vertices of open edges that coincide are joined, doubled faces are left out, faces without area are
removed, and open edges are divided where vertices of other open edges lie on them. So meshes that
differ only in these have the same clean surface, or, where faces are divided, almost the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, IntArray
from ..geometry.mesh import Mesh
from ..progress import checkpoint
from .coincident_vertices import distinct_faces, joined_vertices, vertices_stay
from .face_parts import FaceParts
from .flat_faces import without_flat_faces
from .t_junctions import without_t_junctions


class Cleaning(IntEnum):
    """How much is cleaned; later values clean less.

    Removing a face without area may separate what it connected, for example two fans that meet at
    an edge without length.
    """

    FULL = 0
    VERTICES = 1
    """Vertices are joined, and faces without area stay."""
    FACES = 2
    """Only doubled faces are left out."""


@dataclass(frozen=True)
class CleanSurface:
    """The clean surface of a mesh.

    Attributes
    ----------
    original : Mesh
        The given mesh, with V vertices and F faces.
    mesh : Mesh
        The clean mesh, which has the same vertices; the given one if it is clean.
    parts : FaceParts
        Its faces, with the given face of each.
    joined : (V,) int array
        The first of the given vertices that were joined with each.
    place : (V,) int array
        The vertex of the mesh at which each given vertex lies. It differs from `joined` where an
        edge without length was removed.
    removed : (F,) bool array
        Given faces of which no part remains, since they are doubled or have no area.
    divisions : (d, 3) int array
        Vertices at which edges were divided, and the two ends of the edge of each.
    repairs : dict of str to int
        How often each repair was made, without those that were not.
    """

    original: Mesh
    mesh: Mesh
    parts: FaceParts
    joined: IntArray
    place: IntArray
    removed: BoolArray
    divisions: IntArray
    repairs: dict[str, int]


def joined_surface(mesh: Mesh) -> CleanSurface:
    """The surface of a mesh with coincident vertices joined, without doubled faces."""
    surface = clean_surface(mesh, Cleaning.VERTICES) or clean_surface(mesh, Cleaning.FACES)
    assert surface is not None  # a mesh has faces
    return surface


def clean_surface(mesh: Mesh, cleaning: Cleaning) -> CleanSurface | None:
    """Clean the surface of a mesh; None if no face would remain."""
    parts = distinct_faces(mesh)
    doubled = len(mesh.faces) - len(parts.faces)
    joined, vertices = np.arange(len(mesh.vertices)), mesh.vertices
    if cleaning <= Cleaning.VERTICES:
        joined, vertices = joined_vertices(mesh)
        # Both ends of a side may have been joined; a face without area is left out then.
        distinct = parts if vertices_stay(joined) else parts.renumbered(joined).distinct()
        doubled += len(parts.faces) - len(distinct.faces)
        parts = distinct
    place, flat = joined, 0
    joints = divisions = np.zeros((0, 3), dtype=np.int64)
    if cleaning is Cleaning.FULL:
        parts, joints = without_t_junctions(mesh, vertices, parts)
        before = len(np.unique(parts.parent))
        short = tolerances.SAME_POSITION * mesh.diagonal
        parts, merged, divisions = without_flat_faces(vertices, parts, short)
        flat = before - len(np.unique(parts.parent))
        place, divisions = merged[joined], np.concatenate([merged[joints], divisions])
    if not len(parts.faces):
        return None
    checkpoint()
    repairs = {
        "vertices joined": int((joined != np.arange(len(joined))).sum()),
        "doubled faces left out": doubled,
        "faces without area removed": flat,
        "T-junctions closed": len(joints),
    }
    removed = np.ones(len(mesh.faces), dtype=bool)
    removed[parts.parent] = False
    same = parts.faces is mesh.faces and vertices is mesh.vertices
    return CleanSurface(
        mesh,
        mesh if same else Mesh(vertices, parts.faces),
        parts,
        joined,
        place,
        removed,
        divisions,
        {name: count for name, count in repairs.items() if count},
    )
