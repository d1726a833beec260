# SPDX-License-Identifier: GPL-3.0-or-later
"""Render close-ups of tubes along curves: every crossing above, evenly spaced points below.

Run by `python3 build.py demo --close-ups`. From left to right: in the valley beside the nose, over
the ridge of a brow, and on an object that is scaled and sheared by its parent.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import bpy
import numpy as np
from suzanne import (
    EXTENSION,
    FOLDER,
    GREEN,
    SKIN,
    YELLOW,
    add_looking_at,
    distance_to,
    draw_curve,
    light_and_camera,
    plain_material,
)

import addon_utils
from mathutils import Euler, Vector

PLACES = (
    (0.0, -0.62, 0.42),
    (0.38, -0.74, 0.56),
    (0.75, -0.25, 0.45),
    (0.0, 0.1, 0.98),
    (-0.75, -0.25, 0.45),
    (-0.38, -0.74, 0.56),
)
"""On Suzanne: the valley between the brows, over one brow, around the crown, over the other."""

RADIUS = 0.03
TILE = 640, 540

VIEWS = (  # the place that is looked at, from where, and whether the object is sheared
    ((0.05, -0.62, 0.42), (0.25, -1.7, 0.75), False),
    ((0.33, -0.75, 0.52), (0.9, -1.55, 1.0), False),
    ((0.2, -0.7, 0.5), (0.9, -2.6, 1.6), True),
)


def scene(spline, sheared):
    """Suzanne with a subdivision that is not applied, and a tube on what it shows."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.mesh.primitive_monkey_add()
    suzanne = bpy.context.active_object
    suzanne.modifiers.new("Subdivision", "SUBSURF").levels = 2
    bpy.ops.object.shade_smooth()
    suzanne.data.materials.append(plain_material("Skin", SKIN))
    if sheared:
        parent = bpy.data.objects.new("Parent", None)
        bpy.context.scene.collection.objects.link(parent)
        parent.rotation_euler = Euler((0.2, 0.3, 0.5))
        parent.scale = (1.5, 0.7, 1.0)
        suzanne.parent = parent
        suzanne.rotation_euler = Euler((-0.1, -0.3, -0.6))
        bpy.context.view_layer.update()
    colour = YELLOW if spline == "EXACT" else GREEN
    vertices = [int(np.argmin(distance_to(suzanne, [place]))) for place in PLACES]
    points = ", ".join(map(str, vertices))
    draw_curve(suzanne, spline, colour, points=points, spline=spline, radius=RADIUS)
    light_and_camera()
    return suzanne


def look(suzanne, place, eye):
    """Point the camera at a place of the object, seen from another one."""
    world = suzanne.matrix_world
    bpy.data.objects.remove(bpy.context.scene.camera)
    camera = bpy.data.cameras.new("Camera")
    bpy.context.scene.camera = add_looking_at(
        "Camera", camera, world @ Vector(eye), world @ Vector(place)
    )


def tile(path):
    """Render the scene and return the picture's pixels, (height, width, 4), from the bottom."""
    render = bpy.context.scene
    render.render.engine = "CYCLES"
    render.cycles.samples = 24
    render.cycles.use_denoising = True
    render.render.resolution_x, render.render.resolution_y = TILE
    render.view_settings.view_transform = "Standard"
    render.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(str(path))
    pixels = np.empty(TILE[0] * TILE[1] * 4, dtype=np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(TILE[1], TILE[0], 4)


def main():
    addon_utils.extensions_refresh()
    if addon_utils.enable(EXTENSION, default_set=True) is None:
        raise SystemExit("Blender does not find the extension. Run this with: build.py demo")
    rows = []
    with TemporaryDirectory() as folder:
        for spline in ("EVEN", "EXACT"):  # pixels are stored from the bottom
            tiles = []
            for number, (place, eye, sheared) in enumerate(VIEWS):
                suzanne = scene(spline, sheared)
                look(suzanne, place, eye)
                tiles.append(tile(Path(folder) / f"{spline}-{number}.png"))
            rows.append(np.concatenate(tiles, axis=1))
    pixels = np.concatenate(rows)
    image = bpy.data.images.new("Close-ups", pixels.shape[1], pixels.shape[0])
    image.pixels.foreach_set(pixels.ravel())
    image.filepath_raw, image.file_format = str(FOLDER / "close-ups.png"), "PNG"
    image.save()
    addon_utils.disable(EXTENSION, default_set=True)
    print(f"Picture: {image.filepath_raw}")


if __name__ == "__main__":
    main()
