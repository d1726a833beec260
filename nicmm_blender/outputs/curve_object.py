# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes splines to a Blender curve object, and links new objects to the scene.

A curve object is a child of its mesh object. If the mesh object is scaled non-uniformly, the child
gets an unscaled space of its own, since a tube would be flattened in the space of the mesh. If the
user gives a curve another parent, or none, its place in the scene counts instead.
"""

from __future__ import annotations

import bpy
import numpy as np

from mathutils import Matrix

from ..scene import curve_record
from ..scene.surface import Surface
from .clean_curves import Knots, Polyline, Spline


def new_object(
    mesh_object: bpy.types.Object, surface: Surface, splines: list[Spline], radius: float
) -> bpy.types.Object:
    """Create a curve object from splines of `clean_curves`; the radius is in scene units."""
    name = f"{mesh_object.name} Curve"
    curve = bpy.data.curves.new(name, "CURVE")
    curve.dimensions = "3D"
    curve.use_fill_caps = True
    curve_object = bpy.data.objects.new(name, curve)
    parent_to_mesh(curve_object, mesh_object, surface)
    curve.bevel_depth = radius / scale_of(curve_object, surface)
    write_splines(curve_object, splines)
    return curve_object


def parent_to_mesh(
    curve_object: bpy.types.Object, mesh_object: bpy.types.Object, surface: Surface
) -> None:
    """Make an object a child of the mesh, in the mesh's local space or in an unscaled one.

    The object loses transforms of its own. It gets some when transforms of the mesh are applied,
    since Blender then keeps the place of its children.
    """
    curve_object.parent = mesh_object
    curve_object.matrix_basis = Matrix()
    if surface.keeps_proportions:
        curve_object.matrix_parent_inverse = Matrix()
        return
    to_world = surface.local_to_world
    left, _, right = np.linalg.svd(to_world[:3, :3])
    rigid = np.eye(4)
    rigid[:3, :3] = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
    rigid[:3, 3] = to_world[:3, 3]
    curve_object.matrix_parent_inverse = Matrix((np.linalg.inv(to_world) @ rigid).tolist())


def is_child(curve_object: bpy.types.Object) -> bool:
    """Whether the parent of an object is its mesh as a whole, and not a vertex of it."""
    parent = curve_object.parent
    whole = curve_object.parent_type == "OBJECT"
    return parent is not None and whole and parent == _mesh_of(curve_object)


def scale_of(curve_object: bpy.types.Object, surface: Surface) -> float:
    """Length in the scene of one unit of the space of a curve object."""
    if not is_child(curve_object):
        return _mean_scale(curve_object.matrix_world)
    return surface.scale * _mean_scale(_to_mesh_space(curve_object))


def scale_in_scene(curve_object: bpy.types.Object, mesh_object: bpy.types.Object) -> float:
    """The same as `scale_of`, from the mesh object instead of its surface."""
    if not is_child(curve_object):
        return _mean_scale(curve_object.matrix_world)
    return _mean_scale(mesh_object.matrix_world @ _to_mesh_space(curve_object))


def _to_mesh_space(child: bpy.types.Object) -> Matrix:
    """The matrix from the space of a child of the mesh to the mesh's local space."""
    return child.matrix_parent_inverse @ child.matrix_basis


def _mean_scale(matrix: Matrix) -> float:
    return float(np.cbrt(abs(np.linalg.det(np.array(matrix)[:3, :3])))) or 1.0


def to_object_space(curve_object: bpy.types.Object, points: np.ndarray) -> np.ndarray:
    """Transform points (n, 3) from the mesh's local space to the space of a curve object."""
    if is_child(curve_object):
        to_mesh = _to_mesh_space(curve_object)
        if to_mesh == Matrix():
            return points
        to_curve = np.array(to_mesh.inverted_safe())
    else:
        in_world = np.array(curve_record.mesh_in_any_scene(_designed(curve_object)).matrix_world)
        to_curve = np.array(curve_object.matrix_world.inverted_safe()) @ in_world
    return points @ to_curve[:3, :3].T + to_curve[:3, 3]


def _mesh_of(curve_object: bpy.types.Object) -> bpy.types.Object | None:
    """The mesh on which a curve was designed; the parent of an object without a record yet."""
    designed = _designed(curve_object)
    if curve_record.has_record(designed):
        return curve_record.mesh_of(designed)
    return curve_object.parent


def _designed(curve_object: bpy.types.Object) -> bpy.types.Object:
    """The designed curve itself, or that to which the curves of an object are parallel."""
    if curve_record.has_record(curve_object):
        return curve_object
    return curve_object.nicmm_parallel.source or curve_object


def write_splines(curve_object: bpy.types.Object, splines: list[Spline]) -> None:
    """Replace the splines of a curve object; their materials, radii and tilts are kept."""
    curve = curve_object.data
    before = [_Profile(spline) for spline in curve.splines]
    if not splines:  # the points are lost, so their radii cannot be kept
        curve.bevel_depth *= largest_point_radius(curve_object)
    curve.splines.clear()
    for number, given in enumerate(splines):
        if isinstance(given, Knots):
            spline = _bezier_spline(curve_object, given)
        else:
            spline = _poly_spline(curve_object, given)
        spline.use_cyclic_u = given.closed
        if number < len(before):
            before[number].give_to(spline)


def largest_point_radius(curve_object: bpy.types.Object) -> float:
    """The largest radius of the points, a factor of the bevel depth; 1 if there is none."""
    splines = curve_object.data.splines
    radii = [_get(_points_of(spline), "radius").max(initial=0.0) for spline in splines]
    return float(max(radii, default=0.0)) or 1.0


def _poly_spline(curve_object: bpy.types.Object, polyline: Polyline) -> bpy.types.Spline:
    spline = curve_object.data.splines.new("POLY")
    spline.points.add(len(polyline.points) - 1)
    homogeneous = np.ones((len(polyline.points), 4), dtype=np.float32)
    homogeneous[:, :3] = to_object_space(curve_object, polyline.points)
    spline.points.foreach_set("co", homogeneous.ravel())
    return spline


def _bezier_spline(curve_object: bpy.types.Object, knots: Knots) -> bpy.types.Spline:
    spline = curve_object.data.splines.new("BEZIER")
    spline.bezier_points.add(len(knots.points) - 1)
    for point, smooth in zip(spline.bezier_points, knots.smooth.tolist(), strict=True):
        kind = "ALIGNED" if smooth else "FREE"
        point.handle_left_type = point.handle_right_type = kind
    for name, values in (
        ("co", knots.points),
        ("handle_left", knots.left),
        ("handle_right", knots.right),
    ):
        values = to_object_space(curve_object, values).astype(np.float32)
        spline.bezier_points.foreach_set(name, values.ravel())
    return spline


class _Profile:
    """The material of a spline, with its radii and tilts as functions of arc length."""

    NEUTRAL = (("radius", 1.0), ("tilt", 0.0))

    def __init__(self, spline: bpy.types.Spline) -> None:
        self.material = spline.material_index
        self.along = _along(spline)
        self.values = {name: _get(_points_of(spline), name) for name, _ in self.NEUTRAL}
        self.cyclic = spline.use_cyclic_u

    def give_to(self, spline: bpy.types.Spline) -> None:
        """Apply the material to a spline, and interpolate radii and tilts by arc length."""
        spline.material_index = self.material
        for name, neutral in self.NEUTRAL:
            values = self.values[name]
            if len(values) and (values != neutral).any():
                along, values = self.along[: len(values)], values
                if self.cyclic:
                    along, values = np.append(along, 1.0), np.append(values, values[0])
                found = np.interp(_along(spline)[: len(_points_of(spline))], along, values)
                _points_of(spline).foreach_set(name, found.astype(np.float32))


def _points_of(spline: bpy.types.Spline) -> bpy.types.bpy_prop_collection:
    return spline.bezier_points if spline.type == "BEZIER" else spline.points


def _along(spline: bpy.types.Spline) -> np.ndarray:
    """Arc length at each point as a fraction of the total.

    For a cyclic spline the first point is repeated at the end, with the fraction 1.
    """
    points = _points_of(spline)
    width = 3 if spline.type == "BEZIER" else 4
    places = np.empty((len(points), width), dtype=np.float32)
    points.foreach_get("co", places.ravel())
    if spline.use_cyclic_u:
        places = np.concatenate([places, places[:1]])
    lengths = np.linalg.norm(np.diff(places[:, :3].astype(np.float64), axis=0), axis=1)
    along = np.append(0.0, np.cumsum(lengths))
    return along / max(along[-1], 1e-30)


def _get(points: bpy.types.bpy_prop_collection, name: str) -> np.ndarray:
    values = np.empty(len(points), dtype=np.float32)
    points.foreach_get(name, values)
    return values


def place(
    context: bpy.types.Context, mesh_object: bpy.types.Object, curve_object: bpy.types.Object
) -> None:
    """Link a new curve object to the scene and select it."""
    link(context, mesh_object, curve_object)
    _select(context, curve_object)


def link(
    context: bpy.types.Context, mesh_object: bpy.types.Object, new_object: bpy.types.Object
) -> None:
    """Link a new object to the collections of the mesh, and add it to an active local view."""
    for collection in _collections(context, mesh_object):
        if collection not in new_object.users_collection:
            collection.objects.link(new_object)
    if getattr(context.space_data, "local_view", None):
        new_object.local_view_set(context.space_data, True)


def _collections(
    context: bpy.types.Context, mesh_object: bpy.types.Object
) -> list[bpy.types.Collection]:
    """The collections of the mesh, or the scene collection if all belong to other files."""
    physics = getattr(context.scene.rigidbody_world, "collection", None)
    editable = [
        found
        for found in mesh_object.users_collection
        if found.library is None and found.override_library is None and found != physics
    ]
    return editable or [context.scene.collection]


def remove(curve_object: bpy.types.Object) -> None:
    """Delete a curve object, and its data unless it has other users."""
    data = curve_object.data
    bpy.data.objects.remove(curve_object, do_unlink=True)
    if not data.users:
        bpy.data.batch_remove([data])


def select_only(context: bpy.types.Context, chosen: bpy.types.Object) -> None:
    """Make an object active and select nothing else; works in Object Mode only."""
    for selected in context.selected_objects:
        selected.select_set(False)
    context.view_layer.objects.active = chosen
    chosen.select_set(True)


def _select(context: bpy.types.Context, curve_object: bpy.types.Object) -> None:
    """Select the curve; in Object Mode make it active too. In other modes the mesh stays active."""
    if context.mode == "OBJECT":
        select_only(context, curve_object)
    curve_object.select_set(True)
