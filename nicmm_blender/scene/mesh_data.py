# SPDX-License-Identifier: GPL-3.0-or-later
"""Finds the mesh object to work on and reads its edge marks.

Blender keeps a separate copy of a mesh in Edit Mode, so operators call `synchronise` first.
"""

from __future__ import annotations

import bpy
import numpy as np

from . import mesh_arrays
from .messages import InputError


def mesh_object(context: bpy.types.Context) -> bpy.types.Object | None:
    """The mesh to design on: the active object, or the parent of the active curve object.

    The parent is needed for the redo panel: Blender shows it only while the operator can run again,
    and by then the new curve is the active object.
    """
    active = context.active_object
    if active is not None and active.type in {"CURVE", "CURVES"}:
        active = active.parent
    return active if active is not None and active.type == "MESH" else None


def synchronise(mesh_object: bpy.types.Object) -> None:
    """Copy the changes of Edit Mode to the mesh."""
    if mesh_object.mode == "EDIT":
        mesh_object.update_from_editmode()


def marked_edges(mesh_object: bpy.types.Object, mark: str) -> np.ndarray:
    """Vertices (n, 2) of the edges that have a mark, such as "use_seam"."""
    edges = mesh_object.data.edges
    vertices = mesh_arrays.read(edges, "vertices", 2, np.int32)
    return vertices[mesh_arrays.read(edges, mark, 1, bool)].astype(np.int64)


def check_local(mesh_object: bpy.types.Object, consequence: str) -> None:
    """Raise an error if the data of the mesh belongs to another file."""
    library = mesh_object.data.library or mesh_object.library
    if library is not None:
        raise InputError(
            f'The mesh of "{mesh_object.name}" is linked from {library.filepath}, and '
            f"{consequence}. Make it local (Object > Relations > Make Local)"
        )
    if mesh_object.data.override_library is not None:
        raise InputError(
            f'The mesh of "{mesh_object.name}" is a library override, and {consequence}. '
            "Make it local (Object > Relations > Make Local)"
        )
