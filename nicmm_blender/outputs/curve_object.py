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

from ..scene import curve_record, mesh_arrays
from ..scene.messages import InputError
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
    to_curve = _to_object_space(curve_object)
    if to_curve == Matrix():
        return points
    matrix = np.array(to_curve)
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def is_reflected(curve_object: bpy.types.Object) -> bool:
    """Whether the transform from the mesh's local space to that of a curve object reflects."""
    return _to_object_space(curve_object).is_negative


def _to_object_space(curve_object: bpy.types.Object) -> Matrix:
    """The matrix from the mesh's local space to the space of a curve object."""
    if is_child(curve_object):
        return _to_mesh_space(curve_object).inverted_safe()
    mesh_object = curve_record.mesh_in_any_scene(_designed(curve_object))
    return curve_object.matrix_world.inverted_safe() @ mesh_object.matrix_world


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


def check_replaceable(curve_object: bpy.types.Object, count: int) -> None:
    """Raise an error if the points of a curve object cannot be replaced.

    `count` is the number of its curves; it must not contain further ones.
    """
    library = curve_object.library or curve_object.data.library
    if library is not None:
        raise InputError(
            f'"{curve_object.name}" is linked from {library.filepath}. '
            "Make it local (Object > Relations > Make Local)"
        )
    if curve_object.override_library or curve_object.data.override_library:
        raise InputError(
            f'"{curve_object.name}" is a library override, and Blender would not save its new '
            "points. Make it local (Object > Relations > Make Local)"
        )
    if curve_object.mode != "OBJECT":
        raise InputError(f'"{curve_object.name}" is being edited. Switch to Object Mode first')
    hair = curve_object.type == "CURVES"
    if not hair and curve_object.data.shape_keys is not None:
        raise InputError(
            f'"{curve_object.name}" has shape keys, which would hide its new points. Remove them '
            "first"
        )
    strands = curve_object.data.curves if hair else curve_object.data.splines
    if len(strands) > count:
        raise InputError(
            f'"{curve_object.name}" also contains splines that were not designed. Separate them '
            "first (Curve > Separate in Edit Mode)"
        )


def make_single_user(curve_object: bpy.types.Object) -> None:
    """Give a linked duplicate data of its own."""
    if curve_object.data.users - curve_object.data.use_fake_user > 1:
        curve_object.data = curve_object.data.copy()


def copy_materials(source: bpy.types.Object, target: bpy.types.Object) -> None:
    """Add the materials of a curve object to another one, linked to object or data as there."""
    for slot in source.material_slots:
        target.data.materials.append(slot.material)
        if slot.link == "OBJECT":
            own = target.material_slots[-1]
            own.link, own.material = "OBJECT", slot.material


def write_splines(curve_object: bpy.types.Object, splines: list[Spline]) -> None:
    """Replace the splines of a curve object; their settings, radii and tilts are kept."""
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
    radii = [_values(spline, "radius").max(initial=0.0) for spline in splines]
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
    """The settings of a spline, with its radii and tilts as functions of arc length."""

    SETTINGS = (
        *("material_index", "use_smooth", "resolution_u"),
        *("radius_interpolation", "tilt_interpolation"),
    )
    NEUTRAL = (("radius", 1.0), ("tilt", 0.0))

    def __init__(self, spline: bpy.types.Spline) -> None:
        self.settings = {name: getattr(spline, name) for name in self.SETTINGS}
        self.along = _along(spline)
        self.values = {name: _values(spline, name) for name, _ in self.NEUTRAL}
        self.cyclic = spline.use_cyclic_u

    def give_to(self, spline: bpy.types.Spline) -> None:
        """Apply the settings to a spline, and interpolate radii and tilts by arc length."""
        for name, value in self.settings.items():
            setattr(spline, name, value)
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


def _values(spline: bpy.types.Spline, name: str) -> np.ndarray:
    """Values of a property at the points of a spline, (n,)."""
    return mesh_arrays.read(_points_of(spline), name, 1, np.float32)


def _along(spline: bpy.types.Spline) -> np.ndarray:
    """Arc length at each point as a fraction of the total.

    For a cyclic spline the first point is repeated at the end, with the fraction 1.
    """
    points = _points_of(spline)
    width = 3 if spline.type == "BEZIER" else 4
    places = mesh_arrays.read(points, "co", width, np.float32)
    if spline.use_cyclic_u:
        places = np.concatenate([places, places[:1]])
    lengths = np.linalg.norm(np.diff(places[:, :3].astype(np.float64), axis=0), axis=1)
    along = np.append(0.0, np.cumsum(lengths))
    return along / max(along[-1], 1e-30)


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
