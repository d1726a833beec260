# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads the surface that curves lie on as arrays, with or without modifiers.

The mesh without its modifiers is called the cage. In Edit Mode the cage is Blender's separate copy
that is being edited.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property

import bpy
import numpy as np

import bmesh
from mathutils import Matrix

from . import mesh_arrays
from .cage_trace import CageTrace, trace
from .lookup import is_in
from .messages import InputError
from .vertex_weights import weights_on

FLAT = 1e-6
"""Scales along an axis up to this fraction of the largest one are refused.

The limit is due to single precision.
"""

MODES_THAT_HIDE = {"EDIT", "SCULPT", "WEIGHT_PAINT"}
"""Modes of the object in which Blender does not show hidden faces."""


@dataclass(frozen=True)
class Surface:
    """A triangulated surface for the core.

    Attributes
    ----------
    local_positions, core_positions : (V, 3) float array
        Positions of the vertices in the object's local space, and in the space of the core, where
        lengths are proportional to those in the scene.
    faces : (F, 3) int array
        Vertices of each triangle.
    loops : (F, 3) int array
        Corners of the Blender mesh at the corners of each triangle.
    polygons : (F,) int array
        Face of the Blender mesh that each triangle belongs to.
    hidden : (F,) bool array
        Whether the user has hidden the triangle; always False in modes that show hidden faces.
    local_to_core : (3, 3) float array
        Linear map from local space to the space of the core.
    local_to_world : (4, 4) float array
        Transform from local space to world space.
    with_modifiers : bool
        Whether the surface includes the effect of modifiers and shape keys.
    cage : CageTrace or None
        How the surface is related to its cage; None if both have the same vertices and faces, or if
        the cage was not traced.
    """

    local_positions: np.ndarray
    core_positions: np.ndarray
    faces: np.ndarray
    loops: np.ndarray
    polygons: np.ndarray
    hidden: np.ndarray
    local_to_core: np.ndarray
    local_to_world: np.ndarray
    with_modifiers: bool
    cage: CageTrace | None

    def points(self, faces: np.ndarray, barycentric: np.ndarray) -> np.ndarray:
        """Positions in local space of points given by triangle and barycentric coordinates."""
        return np.einsum("nj,njk->nk", barycentric, self.local_positions[self.faces[faces]])

    def in_world(self, core_positions: np.ndarray) -> np.ndarray:
        """World positions of points (n, 3) that are given in the space of the core."""
        local = core_positions @ np.linalg.inv(self.local_to_core).T
        return local @ self.local_to_world[:3, :3].T + self.local_to_world[:3, 3]

    @cached_property
    def fingerprint(self) -> bytes:
        """A hash of the arrays that the core works on."""
        digest = hashlib.blake2b(self.core_positions.tobytes())
        digest.update(self.faces.tobytes())
        return digest.digest()

    @cached_property
    def faces_digest(self) -> str:
        """A hash of the faces."""
        return hashlib.blake2b(self.faces.tobytes(), digest_size=16).hexdigest()

    @cached_property
    def triangles_digest(self) -> str:
        """A hash of the faces that depends neither on their order nor on their orientation."""
        generator = np.random.default_rng(0)
        numbers = generator.integers(2**64, size=len(self.local_positions), dtype=np.uint64)
        return f"{numbers[self.faces].prod(axis=1).sum():x}"

    @cached_property
    def diagonal(self) -> float:
        """Length of the diagonal of the bounding box in local space."""
        return float(np.linalg.norm(np.ptp(self.local_positions, axis=0)))

    @property
    def scale(self) -> float:
        """Length in the scene of one unit of local space, as a geometric mean over the axes."""
        return float(np.cbrt(abs(np.linalg.det(self.local_to_world[:3, :3]))))

    @property
    def unit(self) -> float:
        """Length in the scene of one unit of the core's space."""
        return self.scale if self.keeps_proportions else 1.0

    @property
    def keeps_proportions(self) -> bool:
        """Whether the object is scaled uniformly, so that the core works in local space."""
        return bool((self.local_to_core == np.eye(3)).all())


def read(mesh_object: bpy.types.Object, use_modifiers: bool, traced: bool = True) -> Surface:
    """Read the surface of a mesh object; its cage is traced only if `traced` is set.

    Quads and larger faces are triangulated as Blender draws them.
    """
    with shown_mesh(mesh_object, use_modifiers) as (mesh, matrix):
        local_positions = mesh_arrays.positions(mesh)
        loops = mesh_arrays.triangle_corners(mesh).astype(np.int64)
        faces = mesh_arrays.corner_vertices(mesh).astype(np.int64)[loops]
        polygons = mesh_arrays.triangle_faces(mesh).astype(np.int64)
        hidden = np.zeros(len(faces), dtype=bool)
        if mesh_object.mode in MODES_THAT_HIDE:
            hidden = mesh_arrays.read(mesh.polygons, "hide", 1, bool)[polygons]
        cage = trace(mesh_object, mesh, loops, cage_mesh) if use_modifiers and traced else None
    local_to_core = np.array(matrix.to_3x3(), dtype=np.float64)
    stretches = np.linalg.svd(local_to_core, compute_uv=False)
    if stretches[-1] <= FLAT * stretches[0]:
        raise InputError(
            f'The scale of "{mesh_object.name}" is zero or nearly zero along an axis. Reset it '
            "(Object > Clear > Scale)"
        )
    if _keeps_proportions(local_to_core):
        local_to_core = np.eye(3)
    local_to_world = np.array(matrix, dtype=np.float64)
    return Surface(
        local_positions,
        local_positions @ local_to_core.T,
        faces,
        loops,
        polygons,
        hidden,
        local_to_core,
        local_to_world,
        use_modifiers,
        cage,
    )


@contextmanager
def shown_mesh(
    mesh_object: bpy.types.Object, use_modifiers: bool
) -> Iterator[tuple[bpy.types.Mesh, Matrix]]:
    """Yield the mesh with its modifiers and shape keys, or the cage, and the world matrix.

    The mesh is valid inside the block only.
    """
    if not use_modifiers or _is_sculpted_without_modifiers(mesh_object):
        with cage_mesh(mesh_object) as mesh:
            yield mesh, mesh_object.matrix_world.copy()
        return
    depsgraph = _depsgraph_of(mesh_object)
    evaluated = mesh_object.evaluated_get(depsgraph)
    try:
        yield evaluated.to_mesh(), evaluated.matrix_world.copy()
    finally:
        evaluated.to_mesh_clear()


@contextmanager
def cage_mesh(mesh_object: bpy.types.Object) -> Iterator[bpy.types.Mesh]:
    """Yield the mesh without modifiers; it is valid inside the block only.

    In Edit Mode it is a copy, since Blender would report it as a change if the edited mesh were
    written back.
    """
    if mesh_object.mode != "EDIT":
        yield mesh_object.data
        return
    copy = bpy.data.meshes.new("NICMM cage")
    try:
        bmesh.from_edit_mesh(mesh_object.data).to_mesh(copy)
        yield copy
    finally:
        bpy.data.meshes.remove(copy)


def active_modifiers_text(mesh_object: bpy.types.Object) -> str:
    """Words for what the viewport shows besides the cage: modifiers, shape keys, both or empty."""
    shown = []
    if any(modifier.show_viewport for modifier in mesh_object.modifiers):
        shown.append("modifiers")
    keys = mesh_object.data.shape_keys
    others = [] if keys is None else keys.key_blocks[1:]
    if any(key.value != 0.0 and not key.mute for key in others):
        shown.append("shape keys")
    return " and ".join(shown)


def group_weights(mesh_object: bpy.types.Object, name: str, use_modifiers: bool) -> np.ndarray:
    """Weights (V,) of the surface's vertices in a vertex group."""
    vertex_group(mesh_object, name)
    with shown_mesh(mesh_object, use_modifiers) as (mesh, _):
        return weights_on(mesh, mesh_object.vertex_groups.keys(), name)


def vertex_group(mesh_object: bpy.types.Object, name: str) -> bpy.types.VertexGroup:
    """Return the vertex group with a name, or raise an error if there is none."""
    group = mesh_object.vertex_groups.get(name)
    if group is None:
        groups = ", ".join(f'"{group.name}"' for group in mesh_object.vertex_groups)
        raise InputError(
            f'"{mesh_object.name}" has no vertex group "{name}". '
            + (f"Choose one of {groups}, or leave" if groups else "Add the group, or leave")
            + " the field empty"
        )
    return group


def _is_sculpted_without_modifiers(mesh_object: bpy.types.Object) -> bool:
    """Whether the mesh is sculpted without modifiers, so that the evaluated mesh is outdated.

    Strokes then change only the mesh itself, and Blender does not evaluate it again before the mode
    is left.
    """
    if mesh_object.mode != "SCULPT":
        return False
    if mesh_object.use_dynamic_topology_sculpting:
        raise InputError(
            f'"{mesh_object.name}" is sculpted with dynamic topology (Dyntopo), whose faces '
            "extensions cannot read. Disable Dyntopo, or leave Sculpt Mode"
        )
    return not active_modifiers_text(mesh_object)


def _depsgraph_of(mesh_object: bpy.types.Object) -> bpy.types.Depsgraph:
    """A dependency graph that evaluates the object: preferably that of the current view layer."""
    context = bpy.context
    if is_in(context.view_layer, mesh_object):
        if _is_disabled(context.view_layer, mesh_object) and active_modifiers_text(mesh_object):
            raise InputError(
                f'"{mesh_object.name}" is disabled in viewports, so its '
                f"{active_modifiers_text(mesh_object)} are not computed. Enable it in the "
                "Outliner, or turn Use Modifiers off"
            )
        return context.evaluated_depsgraph_get()
    for scene in mesh_object.users_scene:
        for layer in scene.view_layers:
            layer.update()
            if is_in(layer, mesh_object):
                return layer.depsgraph
    raise InputError(
        f'"{mesh_object.name}" is in no view layer, so its modifiers are not computed. Bring it '
        "back to the scene, or turn Use Modifiers off"
    )


def _is_disabled(view_layer: bpy.types.ViewLayer, mesh_object: bpy.types.Object) -> bool:
    """Whether an object, or all of its collections, are disabled in viewports.

    Blender does not evaluate such an object. It does evaluate one that is hidden with the eye icon.
    """
    hidden = mesh_object.hide_get(view_layer=view_layer)
    visible = mesh_object.visible_get(view_layer=view_layer)
    return mesh_object.hide_viewport or not (hidden or visible)


def _keeps_proportions(linear: np.ndarray) -> bool:
    """Whether a linear map is a uniform scale with a rotation or reflection, up to rounding.

    In that case the core works in the object's local space, so that rotating the object does not
    change the curve through rounding errors.
    """
    gram = linear.T @ linear
    return bool(np.allclose(gram, np.eye(3) * np.trace(gram) / 3, rtol=0, atol=1e-5 * gram.max()))
