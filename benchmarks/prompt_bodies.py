"""Bodies for `prompts`, made with Blender as people make them: primitives and modifiers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np

import bmesh

from nicmm_core import shapes
from nicmm_core.geometry.mesh import Mesh

Joints = dict[str, tuple[float, float, float, float]]

JOINTS: Joints = {
    "hip": (0.0, 0.0, 0.95, 0.16),
    "waist": (0.0, 0.0, 1.12, 0.13),
    "chest": (0.0, 0.0, 1.38, 0.19),
    "neck": (0.0, 0.02, 1.56, 0.065),
    "head": (0.0, -0.02, 1.72, 0.115),
    "crown": (0.0, 0.0, 1.82, 0.08),
    "left shoulder": (0.22, 0.02, 1.44, 0.085),
    "left elbow": (0.46, 0.03, 1.26, 0.058),
    "left hand": (0.66, -0.12, 1.42, 0.04),
    "right shoulder": (-0.22, 0.02, 1.44, 0.085),
    "right elbow": (-0.42, 0.06, 1.20, 0.058),
    "right hand": (-0.52, -0.06, 0.95, 0.04),
    "left thigh": (0.13, 0.0, 0.82, 0.11),
    "left knee": (0.20, -0.08, 0.48, 0.075),
    "left foot": (0.22, 0.02, 0.08, 0.05),
    "right thigh": (-0.13, 0.0, 0.82, 0.11),
    "right knee": (-0.17, -0.02, 0.48, 0.075),
    "right foot": (-0.19, 0.04, 0.08, 0.05),
}
"""Joints of a posed figure that looks along -y: position and radius."""

BONES = (
    ("hip", "waist"), ("waist", "chest"), ("chest", "neck"), ("neck", "head"), ("head", "crown"),
    *((a.format(side), b.format(side)) for side in ("left", "right") for a, b in (
        ("chest", "{} shoulder"), ("{} shoulder", "{} elbow"), ("{} elbow", "{} hand"),
        ("hip", "{} thigh"), ("{} thigh", "{} knee"), ("{} knee", "{} foot"),
    )),
)  # fmt: skip

PROFILE = (
    (0.30, 0.0), (0.36, 0.05), (0.52, 0.35), (0.60, 0.65), (0.52, 0.95), (0.30, 1.2),
    (0.22, 1.35), (0.24, 1.5), (0.36, 1.65),
)  # fmt: skip
"""Radii and heights of a vase."""

BOX = (1.0, 0.7, 0.5)
"""Half extents of a box."""


def suzanne(levels: int) -> Mesh:
    """Blender's monkey; its head and its eyes are separate components."""
    return _made(bpy.ops.mesh.primitive_monkey_add, SUBSURF={"levels": levels})


def figure(levels: int) -> Mesh:
    """Posed figure of limbs around bones."""
    return _made(_add_bones, SKIN={"use_smooth_shade": True}, SUBSURF={"levels": levels})


def vase(levels: int) -> Mesh:
    """Vase that is open at the top, turned from a profile."""
    turned = {"axis": "Z", "steps": 24, "use_merge_vertices": True, "use_normal_flip": True}
    return _made(_add_profile, SCREW=turned, SUBSURF={"levels": levels})


def box(levels: int) -> Mesh:
    """Box with bevelled edges."""
    bevel = {"width": 0.15, "segments": 4, "limit_method": "ANGLE"}
    return _made(_add_box, BEVEL=bevel, SUBSURF={"levels": levels, "subdivision_type": "SIMPLE"})


def torus(levels: int) -> Mesh:
    """Torus around the z axis."""
    return shapes.torus(around=24 * 2**levels, across=12 * 2**levels)


def creature(levels: int) -> Mesh:
    """Random body with limbs."""
    return shapes.creature(seed=7, subdivisions=levels)


def _made(add: Callable[[], Any], **modifiers: dict[str, Any]) -> Mesh:
    """Triangles of the object that a function adds, after modifiers by type with their settings."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    add()
    made = bpy.context.object
    for kind, settings in modifiers.items():
        modifier = made.modifiers.new(kind, kind)
        for name, value in settings.items():
            setattr(modifier, name, value)
    shown = made.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    vertices = np.array([vertex.co[:] for vertex in shown.vertices])
    faces = np.array([triangle.vertices[:] for triangle in shown.loop_triangles], dtype=np.int64)
    return Mesh(vertices, faces)


def _add_bones() -> None:
    names = list(JOINTS)
    data = bpy.data.meshes.new("Bones")
    bones = [(names.index(a), names.index(b)) for a, b in BONES]
    data.from_pydata([JOINTS[name][:3] for name in names], bones, [])
    shape = bmesh.new()
    shape.from_mesh(data)
    layer = shape.verts.layers.skin.verify()
    for vertex, name in zip(shape.verts, names, strict=True):
        radius = JOINTS[name][3]
        vertex[layer].radius = (radius, radius)
        vertex[layer].use_root = name == "hip"
    shape.to_mesh(data)
    shape.free()
    _show(data)


def _add_profile() -> None:
    data = bpy.data.meshes.new("Profile")
    places = [(0.0, 0.0, PROFILE[0][1]), *((radius, 0.0, z) for radius, z in PROFILE)]
    data.from_pydata(places, [(i, i + 1) for i in range(len(places) - 1)], [])
    _show(data)


def _add_box() -> None:
    bpy.ops.mesh.primitive_cube_add(size=2.0, scale=BOX)
    bpy.ops.object.transform_apply(location=False, rotation=False)


def _show(data: Any) -> None:
    added = bpy.data.objects.new(data.name, data)
    bpy.context.scene.collection.objects.link(added)
    bpy.context.view_layer.objects.active = added
