"""Renders still images of curves on meshes with Blender's Cycles, through the module bpy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import bpy
import numpy as np
from matplotlib import pyplot

import bmesh
from mathutils import Matrix, Vector
from mathutils.bvhtree import BVHTree

from nicmm_core.geometry.array_types import FloatArray
from nicmm_core.geometry.curve import SurfaceCurve, resample
from nicmm_core.geometry.mesh import Mesh
from nicmm_core.geometry.normals import vertex_normals

from . import plots
from .polylines import NearestPoints
from .scale import Scale

Colour = tuple[float, float, float]

SURFACE: Colour = (0.50, 0.50, 0.50)
OBSTACLE: Colour = (0.85, 0.10, 0.06)
ALIGNMENT: Colour = (0.06, 0.25, 0.90)
BLACK: Colour = (0.01, 0.01, 0.01)
WHITE: Colour = (0.95, 0.95, 0.95)
BLUE: Colour = (0.02, 0.18, 0.80)
ORANGE: Colour = (0.90, 0.25, 0.01)
GREEN: Colour = (0.02, 0.45, 0.12)
YELLOW: Colour = (1.0, 0.60, 0.02)

METHOD_COLOURS = {"nicmm": ORANGE, "elastic": BLUE, "variational": GREEN}

TUBE = 0.006
BALL = 0.015
"""Radii of curve tubes and control point balls, relative to the width of the picture."""

MARGIN = 1.25
"""Width of the picture relative to the width of the curves."""

LEAST_WIDTH = 0.35
"""Least width of a picture relative to the mesh diagonal, so that the shape is recognisable."""

DIRECTIONS = 200
"""Number of candidate views; the one that shows the largest part of the curves is used."""

SAMPLES_PER_PIXEL = {Scale.FULL: 16, Scale.QUICK: 8, Scale.SMOKE: 1}
PIXELS = {Scale.FULL: 480, Scale.QUICK: 320, Scale.SMOKE: 32}


@dataclass(frozen=True)
class Picture:
    """Content of a still image.

    Attributes
    ----------
    title : str
        Title above the image in a sheet.
    mesh : Mesh
        Surface.
    curves : list of (SurfaceCurve, colour)
        Curves to draw; the control points of the first one are shown.
    obstacles, alignment : (V,) float array or None
        Maps to paint on the mesh.
    smooth : bool
        Whether to shade the mesh smoothly; flat shading shows its faces.
    edges : bool
        Whether to draw the edges of the mesh as thin dark lines.
    marks : (m, 3) float array or None
        Positions to show as small balls, such as via points.
    frame : (n, 3) float array or None
        Positions that the image is to contain; by default the curves and the marks.
    """

    title: str
    mesh: Mesh
    curves: list[tuple[SurfaceCurve, Colour]] = field(default_factory=list)
    obstacles: FloatArray | None = None
    alignment: FloatArray | None = None
    smooth: bool = True
    edges: bool = False
    marks: FloatArray | None = None
    frame: FloatArray | None = None


def render(picture: Picture, path: Path, scale: Scale, view: FloatArray | None = None) -> None:
    """Render a still image to a PNG file.

    Parameters
    ----------
    picture : Picture
        Content of the image.
    path : Path
        File to write.
    scale : Scale
        Scale of the measurement, which determines the resolution.
    view : (3, 3) float array, optional
        Axes of the camera (right, up, towards the camera) as rows; `best_view` by default.
    """
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    axes = best_view(picture) if view is None else view
    # Cycles has built-in absolute lengths, so the scene is scaled to a mesh diagonal of 1.
    unit = picture.mesh.diagonal
    placed = picture.mesh.vertices @ axes.T / unit
    marks = np.zeros((0, 3)) if picture.marks is None else picture.marks
    centre, width = framing(picture, axes)
    _add_mesh(picture, placed - centre, width)
    for number, (curve, colour) in enumerate(picture.curves):
        material = _material(f"Curve {number}", colour)
        _add_tube(curve, curve.points @ axes.T / unit - centre, TUBE * width, material)
    balls = _material("Control points", BLACK)
    for place in _control_positions(picture) @ axes.T / unit - centre:
        _add_ball(place, BALL * width, balls)
    blue = _material("Marks", BLUE)
    for place in marks @ axes.T / unit - centre:
        _add_ball(place, 0.8 * BALL * width, blue)
    _add_lights()
    _add_camera(width)
    _render(path, scale)


def framing(picture: Picture, axes: FloatArray) -> tuple[FloatArray, float]:
    """Centre of an image in the axes of the camera, and its width, both in mesh diagonals."""
    marks = [] if picture.marks is None else [picture.marks]
    places = [*(curve.points for curve, _ in picture.curves), *marks]
    frame = np.concatenate(places) if picture.frame is None else picture.frame
    shown = frame @ axes.T / picture.mesh.diagonal
    centre = 0.5 * (shown.min(axis=0) + shown.max(axis=0))
    return centre, max(MARGIN * float(np.ptp(shown, axis=0)[:2].max()), LEAST_WIDTH)


def best_view(picture: Picture) -> FloatArray:
    """Camera axes (right, up, towards the camera) that show most of the curves and painted regions.

    A point is visible if its normal faces the camera and the mesh does not occlude it.
    """
    mesh = picture.mesh
    tree = BVHTree.FromPolygons(mesh.vertices.tolist(), mesh.faces.tolist())
    points = np.concatenate(
        [*(resample(curve.points, 48)[0] for curve, _ in picture.curves), _painted(picture)]
    )
    surface = NearestPoints(mesh)
    _, faces, barycentric = surface.project(points)
    normals = surface.normals(faces, barycentric)
    starts = points + 1e-3 * mesh.diagonal * normals
    best, best_score = np.array([0.0, 0.0, 1.0]), -1.0
    for towards in _directions():
        facing = normals @ towards
        score = 0.0
        for start, share in zip(starts[facing > 0.0], facing[facing > 0.0], strict=True):
            if tree.ray_cast(Vector(start), Vector(towards))[0] is None:
                score += 0.5 + share
        if score > best_score:
            best, best_score = towards, score
    # Models stand upright along y or z; the longer of the two extents is taken as up.
    extent = np.ptp(mesh.vertices[mesh.referenced], axis=0)
    upright = np.array([0.0, 1.0, 0.0]) if extent[1] >= extent[2] else np.array([0.0, 0.0, 1.0])
    if abs(best @ upright) > 0.95:
        upright = np.roll(upright, 1)
    right = np.cross(upright, best)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(best, right), best])


def render_sheet(
    pictures: Sequence[Picture],
    path: Path,
    scale: Scale,
    columns: int = 4,
    views: Sequence[FloatArray] | None = None,
) -> None:
    """Render still images and arrange them, with their titles, in one picture.

    Parameters
    ----------
    pictures : sequence of Picture
        Contents of the images.
    path : Path
        PNG file to write.
    scale : Scale
        Scale of the measurement, which determines the resolution.
    columns : int
        Greatest number of columns.
    views : sequence of (3, 3) float array, optional
        Camera axes of each image; `best_view` by default.
    """
    columns = min(columns, len(pictures))
    rows = -(-len(pictures) // columns)
    figure, axes = pyplot.subplots(
        rows, columns, figsize=(3.0 * columns, 3.25 * rows), squeeze=False
    )
    for place in axes.flat:
        place.axis("off")
    with TemporaryDirectory() as folder:
        for number, (place, picture) in enumerate(zip(axes.flat, pictures, strict=False)):
            still = Path(folder) / f"{number}.png"
            render(picture, still, scale, None if views is None else views[number])
            place.imshow(pyplot.imread(still))
            place.set_title(picture.title, fontsize=9)
    plots.save(figure, path)


def _directions() -> FloatArray:
    """Evenly distributed unit vectors (a Fibonacci lattice)."""
    number = np.arange(DIRECTIONS) + 0.5
    z = 1.0 - 2.0 * number / DIRECTIONS
    angle = np.pi * (1.0 + 5.0**0.5) * number
    radius = np.sqrt(1.0 - z**2)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)


def _painted(picture: Picture) -> FloatArray:
    """Sample of the vertices in painted regions, at most as many as a curve has samples."""
    places = [np.zeros((0, 3))]
    for weights in (picture.obstacles, picture.alignment):
        if weights is not None:
            strong = picture.mesh.vertices[weights > 0.5]
            places.append(strong[:: 1 + len(strong) // 48])
    return np.concatenate(places)


def _control_positions(picture: Picture) -> FloatArray:
    if not picture.curves:
        return np.zeros((0, 3))
    curve = picture.curves[0][0]
    return curve.points[curve.control_index[curve.control_index >= 0]]


def _add_mesh(picture: Picture, vertices: FloatArray, width: float) -> None:
    data = bpy.data.meshes.new("Surface")
    data.from_pydata(vertices.tolist(), [], picture.mesh.faces.tolist())
    data.polygons.foreach_set("use_smooth", np.full(len(data.polygons), picture.smooth))
    if picture.smooth:
        # Angle-weighted normals, as the method uses; Blender's normals shade slivers less well.
        normals = vertex_normals(vertices, picture.mesh.faces)
        data.normals_split_custom_set_from_vertices(normals.tolist())
    colours = np.ones((len(vertices), 4), dtype=np.float32)
    colours[:, :3] = SURFACE
    for weights, hue in ((picture.obstacles, OBSTACLE), (picture.alignment, ALIGNMENT)):
        if weights is not None:
            colours[:, :3] += weights[:, None] * (np.array(hue) - colours[:, :3])
    attribute = data.color_attributes.new("Maps", "FLOAT_COLOR", "POINT")
    attribute.data.foreach_set("color", colours.ravel())
    material = _material("Surface", SURFACE)
    nodes, links = material.node_tree.nodes, material.node_tree.links
    source = nodes.new("ShaderNodeVertexColor")
    source.layer_name = attribute.name
    links.new(source.outputs["Color"], nodes["Principled BSDF"].inputs["Base Color"])
    data.materials.append(material)
    surface = _linked("Surface", data)
    if picture.edges:
        data.materials.append(_material("Edges", (0.12, 0.12, 0.12)))
        wire = surface.modifiers.new("Edges", "WIREFRAME")
        wire.use_replace, wire.material_offset = False, 1
        wire.thickness = 0.0025 * width
        wire.use_even_offset = False


def _add_tube(curve: SurfaceCurve, points: FloatArray, radius: float, material: Any) -> None:
    data = bpy.data.curves.new("Curve", "CURVE")
    data.dimensions = "3D"
    data.bevel_depth = radius
    data.use_fill_caps = True
    spline = data.splines.new("POLY")
    spline.points.add(len(points) - 1)
    spline.points.foreach_set("co", np.pad(points, ((0, 0), (0, 1))).astype(np.float32).ravel())
    spline.use_cyclic_u = curve.closed
    data.materials.append(material)
    _linked("Curve", data)


def _add_ball(place: FloatArray, radius: float, material: Any) -> None:
    data = bpy.data.meshes.new("Control point")
    shape = bmesh.new()
    bmesh.ops.create_icosphere(
        shape, subdivisions=3, radius=radius, matrix=Matrix.Translation(place.tolist())
    )
    shape.to_mesh(data)
    shape.free()
    data.materials.append(material)
    _linked("Control point", data)


def _add_lights() -> None:
    for name, towards, strength in (("Key", (-0.6, 0.8, 1.2), 1.8), ("Fill", (1.0, 0.1, 0.8), 0.7)):
        light = bpy.data.lights.new(name, "SUN")
        light.energy, light.angle = strength, 0.3
        _linked(name, light, towards)
    world = bpy.data.worlds.new("World")
    world.use_nodes = True
    background = world.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (1, 1, 1, 1)
    background.inputs["Strength"].default_value = 0.55
    bpy.context.scene.world = world


def _add_camera(width: float) -> None:
    camera = bpy.data.cameras.new("Camera")
    camera.type, camera.ortho_scale, camera.clip_end = "ORTHO", width, 10.0
    bpy.context.scene.camera = _linked("Camera", camera, (0.0, 0.0, 1.0), distance=4.0)


def _linked(name: str, data: Any, towards: Colour | None = None, distance: float = 1.0) -> Any:
    """Add an object to the scene, with ``towards`` in that direction and facing the origin."""
    added = bpy.data.objects.new(name, data)
    if towards is not None:
        direction = Vector(towards).normalized()
        added.location = distance * direction
        # Looking straight down, Blender has Y up, which is what the axes of the view assume. Minus
        # a zero would turn it upside down.
        ahead = Vector([0.0 - part for part in direction])
        added.rotation_euler = ahead.to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.collection.objects.link(added)
    return added


def _material(name: str, colour: Colour) -> Any:
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    shader = material.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (*colour, 1)
    shader.inputs["Roughness"].default_value = 0.6
    return material


def _render(path: Path, scale: Scale) -> None:
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = SAMPLES_PER_PIXEL[scale]
    scene.cycles.use_denoising = scale is not Scale.SMOKE
    scene.cycles.max_bounces = 3
    scene.render.film_transparent = True
    scene.render.resolution_x = scene.render.resolution_y = PIXELS[scale]
    scene.view_settings.view_transform = "Standard"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    if not path.is_file():
        raise OSError(f"Blender wrote no picture to {path}")
