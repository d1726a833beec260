"""Helpers that the tests of the extension share: modules, objects, selections and positions."""

from importlib import import_module

import bpy
import numpy as np

import bmesh

NORMAL_BENDING = float(np.float32(0.3))
"""Blender's default, in single precision as Blender stores it."""


def installed_core():
    """The core of the installed extension."""
    return import_module("bl_ext.user_default.nicmm_curves.nicmm_core")


def design(core, mesh, points, **arguments):
    """A curve of the core with the extension's defaults, where they differ from the core's."""
    if arguments.get("method", "elastic") == "elastic":
        arguments = {"normal_bending": NORMAL_BENDING, **arguments}
    return core.design_curve(mesh, points, **arguments)


def module(extension, name):
    """A module of the installed extension, by its name inside `nicmm_blender`."""
    return import_module(f"{extension.name}.nicmm_blender.{name}")


def sphere(subdivisions=3):
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=subdivisions)
    return bpy.context.active_object


def monkey():
    """Suzanne, of quads and triangles, with four vertices around the crown selected."""
    bpy.ops.mesh.primitive_monkey_add()
    made = bpy.context.active_object
    select(made, [73, 365, 74, 366])
    return made


def activate(chosen):
    """Make an object the active and the only selected object, like a click on it."""
    bpy.ops.object.select_all(action="DESELECT")
    chosen.select_set(True)
    bpy.context.view_layer.objects.active = chosen


def nearest_vertices(mesh_object, points):
    """Indices of the vertices nearest to points in the object's local space."""
    vertices = positions(mesh_object)
    return [int(np.argmin(np.linalg.norm(vertices - point, axis=1))) for point in points]


def ring(mesh_object, count, height=0.0):
    """Indices of vertices of a unit sphere at equal angles around the z axis, in order."""
    radius = np.sqrt(1 - height**2)
    angles = 2 * np.pi * np.arange(count) / count
    return nearest_vertices(
        mesh_object, [(radius * np.cos(a), radius * np.sin(a), height) for a in angles]
    )


def five_places(heights=(0.1, -0.2, 0.1, 0.2, -0.1)):
    """Positions around the z axis near a unit sphere, (5, 3)."""
    angles = np.array([0.2, 1.4, 2.6, 3.7, 5.1])[: len(heights)]
    return np.stack([np.cos(angles), np.sin(angles), np.asarray(heights)], axis=1)


def select(mesh_object, vertices, history=None):
    """Select exactly the given vertices in Object Mode, as if they were clicked one after another.

    With `history`, the selection history contains only the vertices in `history`: a box selection,
    for example, leaves no history.
    """
    edited = bmesh.new()
    edited.from_mesh(mesh_object.data)
    edited.verts.ensure_lookup_table()
    edited.select_history.clear()
    for element in (*edited.verts, *edited.edges, *edited.faces):
        element.select_set(False)
    for vertex in vertices:
        edited.verts[vertex].select_set(True)
    for vertex in vertices if history is None else history:
        edited.select_history.add(edited.verts[vertex])
    edited.to_mesh(mesh_object.data)
    edited.free()
    bpy.ops.ed.undo_push(message="Select")


def positions(mesh_object):
    return np.array([vertex.co for vertex in mesh_object.data.vertices], dtype=np.float64)


def triangles(mesh_object):
    mesh_object.data.calc_loop_triangles()
    return np.array([list(triangle.vertices) for triangle in mesh_object.data.loop_triangles])


def curves():
    return [found for found in bpy.data.objects if found.type == "CURVE"]


def points(curve_object, spline=0):
    """Positions of the points of a spline in the local space of the curve's parent."""
    points = curve_object.data.splines[spline].points
    own = get(points, "co", 4).astype(float)[:, :3]
    inverse = np.array(curve_object.matrix_parent_inverse)
    return own @ inverse[:3, :3].T + inverse[:3, 3]


def distances_to(targets, polyline):
    """Distance from each target to the nearest point of a polyline."""
    return np.linalg.norm(targets[:, None] - polyline[None], axis=2).min(axis=1)


def get(sequence, name, width=1, dtype=np.float32):
    values = np.empty(len(sequence) * width, dtype=dtype)
    sequence.foreach_get(name, values)
    return values.reshape(-1, width) if width > 1 else values


def evaluated_points(curves_object):
    """Positions of the points of a hair curves object after its modifiers are applied."""
    bpy.context.view_layer.update()
    data = curves_object.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    return get(data.points, "position", 3).astype(float)
