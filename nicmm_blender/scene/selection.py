# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads control points from the selection, from a vertex group or from a script."""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy
import numpy as np

import bmesh

from . import mesh_arrays, surface_cache
from .cage_trace import CageTrace
from .messages import InputError
from .surface import Surface, group_weights
from .via_points import ViaPoints, sorted_by_leg

if TYPE_CHECKING:
    from ...nicmm_core import SurfacePoints


def selected_vertices(mesh_object: bpy.types.Object) -> np.ndarray:
    """Indices of the selected vertices, ascending."""
    return np.flatnonzero(mesh_arrays.read(mesh_object.data.vertices, "select", 1, bool))


def selection_history(mesh_object: bpy.types.Object) -> np.ndarray:
    """Indices of the vertices in Blender's selection history, oldest first."""
    mesh = mesh_object.data
    if mesh_object.mode == "EDIT":
        return _history(bmesh.from_edit_mesh(mesh))
    edited = bmesh.new()
    try:
        edited.from_mesh(mesh)
        return _history(edited)
    finally:
        edited.free()


def _history(edited: bmesh.types.BMesh) -> np.ndarray:
    # list() first: in some Blender versions a generator expression fails on this iterator.
    elements = list(edited.select_history)
    vertices = [found.index for found in elements if isinstance(found, bmesh.types.BMVert)]
    return np.array(vertices, dtype=np.int64)


def selected_points(mesh_object: bpy.types.Object, order: str) -> tuple[np.ndarray, str]:
    """Return the selected vertices and the core's order for them, "given" or "shortest".

    Blender does not record box, circle and lasso selection, and old entries stay in the selection
    history. The history is therefore used only if it holds exactly the selected vertices.
    """
    selected = selected_vertices(mesh_object)
    if len(selected) == 0:
        raise InputError(
            f'No vertex of "{mesh_object.name}" is selected. In Edit Mode, select the vertices '
            "that the curve should pass through"
        )
    if order == "SHORTEST":
        return selected, "shortest"
    history = selection_history(mesh_object)
    if np.array_equal(np.sort(history), selected):
        return history, "given"
    if order == "GIVEN":
        raise InputError(
            f"Blender has recorded the order of {np.isin(selected, history).sum()} of the "
            f"{len(selected)} selected vertices. Select them one by one with Shift-click, "
            "or set Order to Automatic or Shortest"
        )
    return selected, "shortest"


def points_of_group(mesh_object: bpy.types.Object, name: str, order: str) -> tuple[np.ndarray, str]:
    """Return the vertices of a vertex group, and the core's order for them."""
    vertices = np.flatnonzero(group_weights(mesh_object, name, use_modifiers=False) > 0.0)
    if order == "GIVEN":
        raise InputError(
            f'The vertices of the group "{name}" have no order. Set Order to Automatic or Shortest'
        )
    if len(vertices) == 0:
        raise InputError(
            f'No vertex of "{mesh_object.name}" has a weight in the group "{name}". Assign the '
            "vertices that the curve should pass through"
        )
    return vertices, "shortest"


def given_points(surface: Surface, text: str, order: str) -> tuple[np.ndarray | SurfacePoints, str]:
    """Return the control points that a script gives as text, and the core's order for them.

    The text lists vertex indices of the mesh or positions in the object's local space, such as
    "12, 80, 0.5 0 1".
    """
    return _points_in(surface, text), "shortest" if order == "SHORTEST" else "given"


def given_via_points(surface: Surface, text: str) -> ViaPoints:
    """The via points that a script gives as text, such as "1: 57, 63; 2: 0.5 0 1".

    For each leg these are the index of the control point at which it begins, and points as in
    `given_points`.
    """
    from ...nicmm_core.geometry.surface_points import joined, locate_points

    legs, parts = [], []
    for words in text.split(";"):
        leg, colon, points = words.partition(":")
        if not colon or not leg.strip().isdigit():
            raise InputError(
                f'The via points "{words.strip()}" name no leg. Give the index of the control '
                'point at which it begins, a colon and points, such as "1: 57, 63; 2: 0.5 0 1"'
            )
        mesh = surface_cache.core_mesh(surface)
        parts.append(locate_points(mesh, _points_in(surface, points), "via_points"))
        legs += [int(leg)] * len(parts[-1])
    return sorted_by_leg(np.array(legs, dtype=np.int64), joined(parts))


def _points_in(surface: Surface, text: str) -> np.ndarray | SurfacePoints:
    """Points for the core from a text such as "12, 80, 0.5 0 1"."""
    count = len(surface.local_positions) if surface.cage is None else len(surface.cage.vertices)
    given = [_given_point(word, count) for word in text.split(",")]
    if all(isinstance(point, int) for point in given):
        return points_at(surface, np.array(given, dtype=np.int64))
    places = [
        positions_at(surface, np.array([point]))[0]
        if isinstance(point, int)
        else surface.local_to_core @ point
        for point in given
    ]
    return np.array(places)


def given_corners(text: str, count: int) -> np.ndarray:
    """Whether each of `count` control points is a corner, (count,), from indices as text."""
    corners = np.zeros(count, dtype=bool)
    for word in text.split(",") if text.strip() else ():
        if not (word.strip().isdecimal() and int(word) < count):
            raise InputError(
                f'The corner "{word.strip()}" is not the index of a control point, 0 to '
                f'{count - 1}. Separate indices by commas, such as "0, 2"'
            )
        corners[int(word)] = True
    return corners


def points_at(surface: Surface, vertices: np.ndarray) -> np.ndarray | SurfacePoints:
    """Points for the core at vertices (k,) of the mesh.

    Returns vertex indices of the surface. If modifiers have removed any of the vertices, returns
    SurfacePoints of the core instead, in which the nearest point of the surface replaces it.
    """
    if surface.cage is None:
        return vertices
    found = surface.cage.vertices[vertices]
    return found if (found >= 0).all() else _nearest(surface, surface.cage, vertices)


def positions_at(surface: Surface, vertices: np.ndarray) -> np.ndarray:
    """Positions (k, 3) on the surface, in the core's space, of vertices (k,) of the mesh."""
    points = points_at(surface, vertices)
    if isinstance(points, np.ndarray):
        return surface.core_positions[points]
    corners = surface.core_positions[surface.faces[points.faces]]
    return np.einsum("nj,njk->nk", points.barycentric, corners)


def _nearest(surface: Surface, cage: CageTrace, vertices: np.ndarray) -> SurfacePoints:
    """The points of the surface nearest to vertices of the mesh, as SurfacePoints of the core."""
    from ...nicmm_core.geometry.surface_points import nearest_points

    found = cage.vertices[vertices]
    before = cage.positions[vertices] @ surface.local_to_core.T
    wanted = np.where(found[:, None] >= 0, surface.core_positions[found], before)
    mesh = surface_cache.core_mesh(surface)
    return nearest_points(mesh, wanted)[0]


def _given_point(word: str, count: int) -> int | np.ndarray:
    """A vertex index, or a position in the object's local space, (3,)."""
    numbers = word.split()
    try:
        point = int(word) if len(numbers) == 1 else np.array(numbers, dtype=np.float64)
    except ValueError:
        point = np.zeros(0)
    if isinstance(point, np.ndarray) and (point.shape != (3,) or not np.isfinite(point).all()):
        raise InputError(
            f'The point "{word.strip()}" is neither a vertex index nor three coordinates. Separate '
            'points by commas and coordinates by spaces, such as "12, 80, 0.5 0 1"'
        )
    if isinstance(point, int) and not 0 <= point < count:
        raise InputError(
            f"Vertex {point} is out of range; the mesh has {count} vertices, 0 to {count - 1}"
        )
    return point
