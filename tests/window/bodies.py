# SPDX-License-Identifier: GPL-3.0-or-later
"""Bodies such as designers draw on, made in Blender: a dress form, a car and a posed figure.

Each function empties the scene, makes one body of about two units around the origin, and leaves it
active in Object Mode with its modifiers in place.
"""

import math

import bpy
import numpy as np

import bmesh
from mathutils import Vector

DRESS_FORM = (
    (-0.95, 0.42, 0.33, 0.00),
    (-0.75, 0.47, 0.37, 0.01),
    (-0.50, 0.43, 0.34, 0.01),
    (-0.25, 0.33, 0.25, 0.00),
    (-0.08, 0.31, 0.23, 0.00),
    (0.12, 0.36, 0.27, 0.00),
    (0.32, 0.42, 0.30, 0.00),
    (0.50, 0.45, 0.27, 0.02),
    (0.62, 0.43, 0.22, 0.03),
    (0.72, 0.34, 0.17, 0.04),
    (0.79, 0.20, 0.13, 0.04),
    (0.86, 0.14, 0.125, 0.03),
    (1.00, 0.13, 0.125, 0.02),
)
"""Height, half width, half depth and place to the back of the sections, from below."""

BUST = ((0.19, 0.30), 0.15, 0.10)
"""Sideways and upwards, radius, and how far it comes forward."""

STATIONS = (
    (-1.20, 0.02, 0.44),
    (-0.42, 0.12, 0.50),
    (0.62, 0.14, 0.50),
    (1.20, 0.10, 0.45),
)
"""Sections of the car from the front: place, height of the top, half width."""

FLOOR, ROOF, ROOF_WIDTH, ROOF_ENDS = -0.46, 0.46, 0.36, (-0.08, 0.42)
WHEELS, WHEEL = (-0.72, 0.72), (0.20, 0.16)

JOINTS = {
    "Hip": (0.0, 0.0, 0.0, 0.17),
    "Waist": (0.0, 0.0, 0.20, 0.145),
    "Chest": (0.0, 0.0, 0.42, 0.18),
    "Neck": (0.0, 0.01, 0.60, 0.065),
    "Head": (0.0, -0.01, 0.72, 0.11),
    "Crown": (0.0, -0.01, 0.86, 0.10),
    "Shoulder": (0.22, 0.01, 0.49, 0.08),
    "Elbow": (0.46, 0.02, 0.36, 0.06),
    "Wrist": (0.68, -0.01, 0.24, 0.045),
    "Hand": (0.78, -0.02, 0.18, 0.04),
    "Thigh": (0.12, 0.0, -0.12, 0.125),
    "Knee": (0.14, 0.0, -0.50, 0.085),
    "Ankle": (0.15, 0.02, -0.90, 0.055),
    "Toes": (0.16, -0.14, -0.94, 0.045),
}
"""Position and radius of the joints of the figure, on its left side."""

LIMBS = (
    ("Hip", "Waist"),
    ("Waist", "Chest"),
    ("Chest", "Neck"),
    ("Neck", "Head"),
    ("Head", "Crown"),
    ("Chest", "Shoulder"),
    ("Shoulder", "Elbow"),
    ("Elbow", "Wrist"),
    ("Wrist", "Hand"),
    ("Hip", "Thigh"),
    ("Thigh", "Knee"),
    ("Knee", "Ankle"),
    ("Ankle", "Toes"),
)

POSE = {
    "Chest": (0.05, 0.25, 0.0),
    "Elbow.L": (0.0, 0.0, 0.75),
    "Wrist.L": (-0.9, 0.0, 0.3),
    "Elbow.R": (0.0, 0.0, 0.45),
    "Wrist.R": (-0.5, 0.0, 0.0),
    "Knee.L": (-0.55, 0.0, 0.12),
    "Ankle.L": (0.8, 0.0, 0.0),
    "Knee.R": (0.08, 0.0, -0.06),
}
"""Angles of bones, each named for the joint at its end."""


TOOTH_PIECES = 224
"""Number of quads along a side of the tooth."""


def dress_form():
    """Half of a dress form with the modifiers Mirror and Subdivision Surface."""
    count = 14
    angles = np.linspace(-0.5, 0.5, count + 1) * math.pi
    places, faces = [], []
    (aside, height), radius, forward = BUST
    for z, width, depth, back in DRESS_FORM:
        for angle in angles:
            x, y = width * math.cos(angle), back + depth * math.sin(angle)
            away = ((x - aside) ** 2 + (z - height) ** 2) / radius**2
            places.append((x, y - forward * math.exp(-away) * (angle < 0.0), z))
    rings = len(DRESS_FORM)
    for ring in range(rings - 1):
        for part in range(count):
            first = ring * (count + 1) + part
            faces.append((first, first + 1, first + count + 2, first + count + 1))
    for ring, turned in ((0, True), (rings - 1, False)):
        start = ring * (count + 1)
        middle = len(places)
        z, _width, _depth, back = DRESS_FORM[ring]
        places.append((0.0, back, z))
        fan = [(start + part, start + part + 1, middle) for part in range(count)]
        faces += [each[::-1] for each in fan] if turned else fan
    form = _body("Dress Form", places, faces)
    form.modifiers.new("Mirror", "MIRROR").use_clip = True
    form.modifiers.new("Subdivision", "SUBSURF").levels = 2


def car():
    """A box with a cabin, with the modifiers Bevel and Subdivision Surface, on four wheels."""
    places, faces = [], []
    for y, top, width in STATIONS:
        places += [(-width, y, FLOOR), (width, y, FLOOR), (width, y, top), (-width, y, top)]
    for start in (0, 4, 8):
        for side in range(4):
            if (start, side) != (4, 2):  # the cabin is there
                near, next_side = start + side, start + (side + 1) % 4
                faces.append((near, next_side, next_side + 4, near + 4))
    faces += [(3, 2, 1, 0), (12, 13, 14, 15)]
    front, rear = ROOF_ENDS
    places += [(side * ROOF_WIDTH, y, ROOF) for y in (front, rear) for side in (1.0, -1.0)]
    faces += [(6, 10, 18, 16), (11, 7, 17, 19), (7, 6, 16, 17), (10, 11, 19, 18), (16, 18, 19, 17)]
    body = _body("Car", places, faces)
    edited = bmesh.new()
    edited.from_mesh(body.data)
    bmesh.ops.subdivide_edges(edited, edges=edited.edges[:], cuts=3, use_grid_fill=True)
    bmesh.ops.recalc_face_normals(edited, faces=edited.faces[:])
    edited.to_mesh(body.data)
    edited.free()
    bevel = body.modifiers.new("Bevel", "BEVEL")
    bevel.width, bevel.segments, bevel.limit_method = 0.05, 3, "ANGLE"
    bevel.angle_limit = math.radians(20.0)
    body.modifiers.new("Subdivision", "SUBSURF").levels = 2
    radius, depth = WHEEL
    for y in WHEELS:
        for side in (1.0, -1.0):
            bpy.ops.mesh.primitive_cylinder_add(
                radius=radius,
                depth=depth,
                location=(side * 0.42, y, FLOOR),
                rotation=(0.0, math.pi / 2, 0.0),
            )
            bpy.context.active_object.name = "Wheel"
    _activate(body)


def figure():
    """A figure with an armature in a pose, and the modifier Subdivision Surface."""
    joints, limbs = _both_sides()
    body = _skinned(joints, limbs)
    rig = _armature(joints, limbs)
    body.select_set(True)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.parent_set(type="ARMATURE_AUTO")
    body.modifiers.new("Subdivision", "SUBSURF").levels = 2
    pose(POSE)
    rig.hide_set(True)
    _activate(body)


def pose(angles):
    """Turn bones of the figure by angles about their axes."""
    bones = bpy.data.objects["Rig"].pose.bones
    for name, turned in angles.items():
        bones[name].rotation_mode = "XYZ"
        bones[name].rotation_euler = turned


def tooth():
    """A prepared tooth with a wavy ridge, the margin; returns the number of its triangles."""
    line = np.linspace(-1.0, 1.0, TOOTH_PIECES + 1)
    x, y = np.meshgrid(line, line)
    angle, size = np.arctan2(y, x), np.hypot(x, y)
    radius, height = _margin(angle)
    outside = size - radius
    roof = -0.9 * (np.hypot(outside, 0.03) - 0.03)
    stump = 0.5 / (1.0 + np.exp((outside + 0.33) / 0.05))
    z = height + roof + stump
    index = np.arange(x.size).reshape(x.shape)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    quads = np.stack([a, b, c, d], axis=-1).reshape(-1, 4)
    _body("Tooth", np.stack([x, y, z], axis=-1).reshape(-1, 3).tolist(), quads.tolist())
    return 2 * len(quads)


def _margin(angle):
    """Radius and height of the margin of the tooth at angles."""
    radius = 0.6 + 0.05 * np.cos(2.0 * angle) + 0.03 * np.sin(3.0 * angle)
    return radius, 0.05 * np.sin(2.0 * angle) + 0.03 * np.cos(4.0 * angle)


def off_margin(points):
    """Greatest distance of points from the margin of the tooth."""
    angle = np.linspace(-np.pi, np.pi, 4000)
    radius, height = _margin(angle)
    rim = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)
    away = [np.linalg.norm(rim - point, axis=1).min() for point in np.array(points)]
    return float(max(away))


def edge_length():
    """Length of the edges of the tooth, seen from above."""
    return 2.0 / TOOTH_PIECES


def box():
    """A cube of six quads."""
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    _body("Box", corners, faces).data.shade_flat()


def _body(name, places, faces):
    """A new object in an empty scene, shaded smooth and active."""
    for found in list(bpy.data.objects):
        bpy.data.objects.remove(found)
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(places, [], faces)
    mesh.shade_smooth()
    made = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(made)
    _activate(made)
    return made


def _activate(chosen):
    bpy.ops.object.select_all(action="DESELECT")
    chosen.select_set(True)
    bpy.context.view_layer.objects.active = chosen


def _both_sides():
    """Joints and limbs of both sides; those aside are named with .L and .R."""
    joints, limbs = {}, []
    for end, sign in (("", 0.0), (".L", 1.0), (".R", -1.0)):
        for name, (x, y, z, radius) in JOINTS.items():
            if (x == 0.0) == (end == ""):
                joints[name + end] = (Vector((sign * x, y, z)), radius)
        for start, stop in LIMBS:
            if stop + end in joints:
                limbs.append((start + end if start + end in joints else start, stop + end))
    return joints, limbs


def _skinned(joints, limbs):
    """The surface of the figure, as the modifier Skin makes it."""
    names = list(joints)
    edges = [(names.index(start), names.index(stop)) for start, stop in limbs]
    body = _body("Figure", [], [])
    body.data.from_pydata([place for place, _radius in joints.values()], edges, [])
    body.modifiers.new("Skin", "SKIN").use_smooth_shade = True
    body.modifiers["Skin"].branch_smoothing = 0.5
    for vertex, (_place, radius) in zip(
        body.data.skin_vertices[0].data, joints.values(), strict=True
    ):
        vertex.radius = (radius, radius)
        vertex.use_root = False
    body.data.skin_vertices[0].data[0].use_root = True
    body.modifiers.new("Subdivision", "SUBSURF").levels = 1
    for name in ("Skin", "Subdivision"):
        bpy.ops.object.modifier_apply(modifier=name)
    return body


def _armature(joints, limbs):
    """An armature with a bone for each limb, named for the joint at its end."""
    bpy.ops.object.select_all(action="DESELECT")
    bpy.ops.object.armature_add()
    rig = bpy.context.active_object
    rig.name = "Rig"
    bpy.ops.object.mode_set(mode="EDIT")
    bones = rig.data.edit_bones
    bones.remove(bones[0])
    for start, stop in limbs:
        bone = bones.new(stop)
        bone.head, bone.tail = joints[start][0], joints[stop][0]
        bone.parent = bones.get(start)
    bpy.ops.object.mode_set(mode="OBJECT")
    return rig
