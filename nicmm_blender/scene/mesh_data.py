# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads the data for the core from a mesh object: triangles, selected vertices, vertex groups.

Blender keeps a separate copy of a mesh that is being edited: call `synchronise` first.
"""

from dataclasses import dataclass

import numpy as np

import bmesh

FLAT = 1e-6
"""Least scale along an axis relative to the largest one, limited by single precision."""


class InputError(Exception):
    """The Blender data cannot be used; the message says what to change."""


def in_words(error: Exception, obstacle_group: str = "", vertices=None) -> str:
    """The core's message for the user: points are counted from one, and the map is named.

    `vertices` are the vertices of the control points, or None if they are not at vertices.
    """
    text = str(error)
    for point in getattr(error, "points", ()):
        if point.argument == "control_points":
            at = "" if vertices is None else f" (vertex {vertices[point.index]})"
            text = text.replace(str(point), f"point {point.index + 1}{at}")
    text = text.replace("control_points has", "there are").replace("control_points", "the points")
    if type(error).__name__ == "UnreachableError" and obstacle_group:
        text += f' (obstacles: the vertex group "{obstacle_group}")'
    return text[:1].upper() + text[1:]


@dataclass(frozen=True)
class Triangles:
    """A triangulated mesh for the core.

    `local` and `solved` hold the (V, 3) positions in the object's local space and in a space with
    the lengths of the scene. `faces` holds the (F, 3) vertex indices, `loops` the (F, 3) indices of
    the mesh's corners and `polygons` the (F,) faces of the mesh that the triangles are parts of.
    `linear` is the (3, 3) map from the local space to the other.
    """

    local: np.ndarray
    solved: np.ndarray
    faces: np.ndarray
    loops: np.ndarray
    polygons: np.ndarray
    linear: np.ndarray

    def points(self, faces: np.ndarray, barycentric: np.ndarray) -> np.ndarray:
        """Positions in the object's local space of points given by face and barycentrics."""
        return np.einsum("nj,njk->nk", barycentric, self.local[self.faces[faces]])

    @property
    def diagonal(self) -> float:
        """Length of the bounding box's diagonal in the object's local space."""
        return float(np.linalg.norm(np.ptp(self.local, axis=0)))


def mesh_object(context):
    """The mesh to design on: the active object, or the mesh of the active curve.

    Blender shows the redo panel only while the operator can run again, and then the new curve is
    the active object.
    """
    active = context.active_object
    if active is not None and active.type in {"CURVE", "CURVES"}:
        active = active.parent
    return active if active is not None and active.type == "MESH" else None


def synchronise(mesh_object) -> None:
    """Update the mesh from Edit Mode."""
    if mesh_object.mode == "EDIT":
        mesh_object.update_from_editmode()


def triangles(mesh_object) -> Triangles:
    """Positions and triangles; quads and larger faces are triangulated as Blender draws them."""
    mesh = mesh_object.data
    positions = np.empty((len(mesh.vertices), 3), dtype=np.float32)
    mesh.vertices.foreach_get("co", positions.ravel())
    mesh.calc_loop_triangles()
    faces = np.empty((len(mesh.loop_triangles), 3), dtype=np.int32)
    mesh.loop_triangles.foreach_get("vertices", faces.ravel())
    loops = np.empty((len(faces), 3), dtype=np.int32)
    mesh.loop_triangles.foreach_get("loops", loops.ravel())
    polygons = np.empty(len(faces), dtype=np.int32)
    mesh.loop_triangles.foreach_get("polygon_index", polygons)

    local = positions.astype(np.float64)
    linear = np.array(mesh_object.matrix_world.to_3x3(), dtype=np.float64)
    stretches = np.linalg.svd(linear, compute_uv=False)
    if stretches[-1] <= FLAT * stretches[0]:
        raise InputError(
            f'The scale of "{mesh_object.name}" is zero along an axis, or nearly. Reset it '
            "(Object > Clear > Scale)"
        )
    if _keeps_proportions(linear):
        linear = np.eye(3)
    faces, loops, polygons = (found.astype(np.int64) for found in (faces, loops, polygons))
    return Triangles(local, local @ linear.T, faces, loops, polygons, linear)


def _keeps_proportions(linear: np.ndarray) -> bool:
    """Whether a transform is a rotation, mirror image or uniform scale, up to rounding.

    Then the core works in the object's local space, so that rotating the object does not change the
    curve by rounding.
    """
    gram = linear.T @ linear
    return bool(np.allclose(gram, np.eye(3) * np.trace(gram) / 3, rtol=0, atol=1e-5 * gram.max()))


def shown_beyond_the_mesh(mesh_object) -> str:
    """Name the modifiers and shape keys, which the curve ignores; may be empty."""
    shown = []
    if any(modifier.show_viewport for modifier in mesh_object.modifiers):
        shown.append("modifiers")
    keys = mesh_object.data.shape_keys
    others = [] if keys is None else keys.key_blocks[1:]
    if any(key.value != 0.0 and not key.mute for key in others):
        shown.append("shape keys")
    return " and ".join(shown)


def selected_vertices(mesh_object) -> np.ndarray:
    """Indices of the selected vertices, ascending."""
    mesh = mesh_object.data
    selected = np.empty(len(mesh.vertices), dtype=bool)
    mesh.vertices.foreach_get("select", selected)
    return np.flatnonzero(selected)


def selection_history(mesh_object) -> np.ndarray:
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


def _history(edited) -> np.ndarray:
    # list() first: in some Blender versions a generator expression fails on this iterator.
    elements = list(edited.select_history)
    vertices = [found.index for found in elements if isinstance(found, bmesh.types.BMVert)]
    return np.array(vertices, dtype=np.int64)


def selected_points(mesh_object, order: str) -> tuple[np.ndarray, str]:
    """Return the selected vertices and the core's order for them, "given" or "shortest".

    Box, circle and lasso selection are not recorded and old entries stay in the history, so it is
    used only if it holds exactly the selected vertices.
    """
    selected = selected_vertices(mesh_object)
    if len(selected) == 0:
        raise InputError(
            f'No vertex of "{mesh_object.name}" is selected. Select the vertices that the curve '
            "should pass through in Edit Mode"
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


def points_of_group(mesh_object, name: str, order: str) -> tuple[np.ndarray, str]:
    """Return the vertices of a vertex group, and the core's order for them."""
    vertices = np.flatnonzero(group_weights(mesh_object, name) > 0.0)
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


def given_points(surface, text: str, order: str) -> tuple[np.ndarray, str]:
    """Return the control points of a script for the core, and their order.

    The text holds vertex indices or positions in the object's local space, "12, 80, 0.5 0 1".
    """
    core_order = "shortest" if order == "SHORTEST" else "given"
    given = [_given_point(word, len(surface.local)) for word in text.split(",")]
    if all(isinstance(point, int) for point in given):
        return np.array(given, dtype=np.int64), core_order
    places = [
        surface.solved[point] if isinstance(point, int) else surface.linear @ point
        for point in given
    ]
    return np.array(places), core_order


def _given_point(word: str, count: int) -> int | np.ndarray:
    """A vertex index, or a position in the object's local space, (3,)."""
    numbers = word.split()
    try:
        point = int(word) if len(numbers) == 1 else np.array(numbers, dtype=np.float64)
    except ValueError:
        point = np.zeros(0)
    if isinstance(point, np.ndarray) and point.shape != (3,):
        raise InputError(
            f'The point "{word.strip()}" is neither a vertex index nor three coordinates. Separate '
            'points by commas and coordinates by spaces, such as "12, 80, 0.5 0 1"'
        )
    if isinstance(point, int) and not 0 <= point < count:
        raise InputError(
            f"Vertex {point} is out of range; the mesh has {count} vertices, 0 to {count - 1}"
        )
    return point


def marked_edges(mesh_object, mark: str) -> np.ndarray:
    """Vertices, (n, 2), of the edges with a mark, such as "use_seam"."""
    edges = mesh_object.data.edges
    marked = np.empty(len(edges), dtype=bool)
    edges.foreach_get(mark, marked)
    vertices = np.empty((len(edges), 2), dtype=np.int32)
    edges.foreach_get("vertices", vertices.ravel())
    return vertices[marked].astype(np.int64)


def check_local(mesh_object, consequence: str) -> None:
    """Refuse a mesh whose data belongs to another file."""
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


def vertex_group(mesh_object, name: str):
    """Return the vertex group with this name."""
    group = mesh_object.vertex_groups.get(name)
    if group is None:
        groups = ", ".join(f'"{group.name}"' for group in mesh_object.vertex_groups)
        raise InputError(
            f'"{mesh_object.name}" has no vertex group "{name}". '
            + (f"Choose one of {groups}, or leave" if groups else "Add the group, or leave")
            + " the field empty"
        )
    return group


def group_weights(mesh_object, name: str) -> np.ndarray | None:
    """Weight of every vertex in a vertex group; None for an empty name."""
    if not name:
        return None
    index = vertex_group(mesh_object, name).index
    weights = np.zeros(len(mesh_object.data.vertices))
    for vertex in mesh_object.data.vertices:
        for membership in vertex.groups:
            if membership.group == index:
                weights[vertex.index] = membership.weight
    return weights
