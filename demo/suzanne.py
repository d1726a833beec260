# SPDX-License-Identifier: GPL-3.0-or-later
"""Draw two curves on Suzanne with the extension's operator and render them.

Run by `python3 build.py demo`, which lets Blender find the extension. Both curves pass through the
same vertices; one of them keeps off the obstacle (red) and follows the alignment (blue), which are
painted as vertex groups.
"""

import time
from pathlib import Path

import bpy
import numpy as np

import addon_utils
from mathutils import Vector

EXTENSION = "bl_ext.user_default.nicmm_curves"
FOLDER = Path(__file__).resolve().parent

SUBDIVISIONS = 2

# Places on the head, in the order in which the curve visits them: a loop around the crown.
CONTROL_PLACES = (
    (0.0, -0.45, 0.68),
    (0.65, -0.05, 0.73),
    (0.42, 0.36, 0.85),
    (-0.42, 0.36, 0.85),
    (-0.65, -0.05, 0.73),
)
OBSTACLE_PLACES = ((0.4, -0.25, 0.78),)
OBSTACLE_RADIUS = 0.22
ALIGNMENT_PLACES = (
    (-0.2, 0.25, 0.91),
    (-0.1, 0.21, 0.92),
    (0.0, 0.2, 0.93),
    (0.1, 0.21, 0.92),
    (0.2, 0.25, 0.91),
)
ALIGNMENT_RADIUS = 0.13

SKIN = (0.46, 0.45, 0.43)
RED = (0.85, 0.13, 0.08)
BLUE = (0.10, 0.32, 0.90)
DARK = (0.02, 0.02, 0.02)
YELLOW = (1.0, 0.62, 0.02)
GREEN = (0.02, 0.45, 0.16)


def make_suzanne():
    bpy.ops.mesh.primitive_monkey_add()
    suzanne = bpy.context.active_object
    suzanne.modifiers.new("Subdivision", "SUBSURF").levels = SUBDIVISIONS
    bpy.ops.object.modifier_apply(modifier="Subdivision")
    bpy.ops.object.shade_smooth()
    return suzanne


def positions(mesh_object):
    flat = np.empty(3 * len(mesh_object.data.vertices), dtype=np.float32)
    mesh_object.data.vertices.foreach_get("co", flat)
    return flat.reshape(-1, 3)


def distance_to(mesh_object, places):
    """Distance of every vertex to the nearest of some places."""
    offsets = positions(mesh_object)[:, None] - np.array(places, dtype=np.float32)
    return np.linalg.norm(offsets, axis=2).min(axis=1)


def paint(mesh_object, name, places, radius):
    """Make a vertex group that is full near the places and fades to nothing at the radius."""
    weights = np.clip(2 - 2 * distance_to(mesh_object, places) / radius, 0, 1)
    group = mesh_object.vertex_groups.new(name=name)
    for vertex in np.flatnonzero(weights):
        group.add([int(vertex)], float(weights[vertex]), "REPLACE")
    return weights


def show_maps(mesh_object, obstacle, alignment):
    """Colour the mesh by its maps, through a colour attribute."""
    colour = np.ones((len(obstacle), 4), dtype=np.float32)
    colour[:, :3] = SKIN
    for weights, hue in ((obstacle, RED), (alignment, BLUE)):
        colour[:, :3] += weights[:, None] * (np.array(hue, dtype=np.float32) - colour[:, :3])
    attribute = mesh_object.data.color_attributes.new("Maps", "FLOAT_COLOR", "POINT")
    attribute.data.foreach_set("color", colour.ravel())

    material = bpy.data.materials.new("Maps")
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    shader = nodes["Principled BSDF"]
    shader.inputs["Roughness"].default_value = 0.7
    source = nodes.new("ShaderNodeVertexColor")
    source.layer_name = attribute.name
    links.new(source.outputs["Color"], shader.inputs["Base Color"])
    mesh_object.data.materials.append(material)


def plain_material(name, colour):
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    shader = material.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (*colour, 1)
    shader.inputs["Roughness"].default_value = 0.4
    return material


def select_one_by_one(mesh_object, places):
    """Select the vertices nearest to the places, in their order, as clicks would; Edit Mode."""
    import bmesh

    vertices = [int(np.argmin(distance_to(mesh_object, [place]))) for place in places]
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_mode(type="VERT")
    bpy.ops.mesh.select_all(action="DESELECT")
    edited = bmesh.from_edit_mesh(mesh_object.data)
    edited.verts.ensure_lookup_table()
    for vertex in vertices:
        edited.verts[vertex].select_set(True)
        edited.select_history.add(edited.verts[vertex])
    edited.select_flush_mode()
    bmesh.update_edit_mesh(mesh_object.data)
    bpy.ops.object.mode_set(mode="OBJECT")
    return vertices


def draw_curve(mesh_object, name, colour, **settings):
    print(f"-- Drawing: {name}", flush=True)
    started = time.perf_counter()
    bpy.context.view_layer.objects.active = mesh_object
    bpy.ops.nicmm.design_curve(**settings)
    curve = bpy.context.active_object
    curve.name = name
    curve.data.materials.append(plain_material(name, colour))
    print(f"   {time.perf_counter() - started:.1f} s", flush=True)


def show_control_points(mesh_object, vertices):
    material = plain_material("Control Points", DARK)
    for vertex in vertices:
        bpy.ops.mesh.primitive_uv_sphere_add(
            radius=0.032, location=mesh_object.data.vertices[vertex].co
        )
        ball = bpy.context.active_object
        ball.name = "Control Point"
        bpy.ops.object.shade_smooth()
        ball.data.materials.append(material)


def light_and_camera():
    target = Vector((0, -0.1, 0.15))
    for name, place, energy, size in (
        ("Key", (-3, -4, 5), 220, 3),
        ("Fill", (4, -3, 2), 80, 4),
        ("Rim", (1, 4, 4), 120, 2),
    ):
        light = bpy.data.lights.new(name, "AREA")
        light.energy, light.size = energy, size
        add_looking_at(name, light, place, target)
    camera = bpy.data.cameras.new("Camera")
    camera.lens = 58
    scene = bpy.context.scene
    scene.camera = add_looking_at("Camera", camera, (0.7, -3.1, 4.5), target)
    scene.world = bpy.data.worlds.new("World")
    scene.world.use_nodes = True
    background = scene.world.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (0.9, 0.93, 1.0, 1)
    background.inputs["Strength"].default_value = 0.45


def add_looking_at(name, data, place, target):
    added = bpy.data.objects.new(name, data)
    added.location = place
    added.rotation_euler = (target - Vector(place)).to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.collection.objects.link(added)
    return added


def render(path):
    print("-- Rendering", flush=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples = 24
    scene.cycles.use_denoising = True
    scene.render.resolution_x, scene.render.resolution_y = 1280, 960
    scene.view_settings.view_transform = "Standard"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)


def main():
    addon_utils.extensions_refresh()
    if addon_utils.enable(EXTENSION, default_set=True) is None:
        raise SystemExit("Blender does not find the extension. Run this with: build.py demo")
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    suzanne = make_suzanne()
    print(f"-- Suzanne, {len(suzanne.data.vertices)} vertices", flush=True)
    obstacle = paint(suzanne, "Obstacle", OBSTACLE_PLACES, OBSTACLE_RADIUS)
    alignment = paint(suzanne, "Alignment", ALIGNMENT_PLACES, ALIGNMENT_RADIUS)
    show_maps(suzanne, obstacle, alignment)
    vertices = select_one_by_one(suzanne, CONTROL_PLACES)
    draw_curve(suzanne, "Without Guidance", YELLOW)
    draw_curve(
        suzanne, "With Guidance", GREEN, obstacle_group="Obstacle", alignment_group="Alignment"
    )
    show_control_points(suzanne, vertices)
    light_and_camera()

    picture, scene = FOLDER / "suzanne.png", FOLDER / "suzanne.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(scene))
    render(picture)
    addon_utils.disable(EXTENSION, default_set=True)
    print(f"Scene:   {scene}\nPicture: {picture}")


if __name__ == "__main__":
    main()
