"""Runs the Python code of the documentation that needs Blender, and its lines for a terminal."""

import itertools

import bpy
import numpy as np
import pytest

import bmesh

from nicmm_core import shapes
from tests.blender import scenes
from tests.docs.pages import PAGES, blocks, is_for_blender, numbered

pytestmark = pytest.mark.slow

CODE = [
    pytest.param(code, id=f"{page.stem}-{number}")
    for page in PAGES
    for number, block in enumerate(filter(is_for_blender, blocks(page, "python")))
    for code in block.split("\n\n")  # blank lines separate examples
]

ANGLE = np.linspace(0.0, 2.0 * np.pi, 120, endpoint=False)
STROKE = np.stack([0.6 * np.cos(ANGLE), 0.6 * np.sin(ANGLE), 0.0 * ANGLE + 1.0], axis=1)
"""A circle on the top of the cube."""


class Names(dict):
    """What the code may use: fixed names, and a new place on the mesh for each (x, y, z)."""

    def __init__(self, positions, **fixed):
        super().__init__(fixed)
        self._positions, self._position = itertools.cycle(positions), None

    def __missing__(self, name):
        if name not in ("x", "y", "z"):
            raise KeyError(name)
        if name == "x":
            self._position = next(self._positions)
        return float(self._position["xyz".index(name)])


@pytest.fixture
def suzanne(empty_scene):
    """A cube named Suzanne with vertex groups, whose first vertices have x > 0.2."""
    mesh = numbered(shapes.cube(16))
    data = bpy.data.meshes.new("Suzanne")
    data.from_pydata(mesh.vertices.tolist(), [], mesh.faces.tolist())
    made = bpy.data.objects.new("Suzanne", data)
    bpy.context.scene.collection.objects.link(made)
    scenes.activate(made)
    scenes.select(made, [12, 80, 41])
    for name, vertices in (("Cut", [12, 80, 41]), ("Obstacle", [300]), ("Lane", [301, 302])):
        made.vertex_groups.new(name=name).add(vertices, 1.0, "REPLACE")
    return made


def keep_right_half(mesh_object):
    """Add a Mirror modifier in place of the half with x < 0."""
    edited = bmesh.new()
    edited.from_mesh(mesh_object.data)
    left = [vertex for vertex in edited.verts if vertex.co.x < -1e-6]
    bmesh.ops.delete(edited, geom=left, context="VERTS")
    edited.to_mesh(mesh_object.data)
    edited.free()
    mesh_object.modifiers.new("Mirror", "MIRROR")


def add_stroke(mesh_object):
    """Add a curve object along the stroke, selected beside the active mesh."""
    data = bpy.data.curves.new("Stroke", "CURVE")
    data.dimensions = "3D"
    spline = data.splines.new("POLY")
    spline.points.add(len(STROKE) - 1)
    spline.points.foreach_set("co", np.pad(STROKE, ((0, 0), (0, 1))).ravel())
    stroke = bpy.data.objects.new("Stroke", data)
    bpy.context.scene.collection.objects.link(stroke)
    scenes.activate(mesh_object)
    stroke.select_set(True)


@pytest.mark.parametrize("code", CODE)
@pytest.mark.usefixtures("remembered_designs")
def test_code(suzanne, code):
    positions = scenes.positions(suzanne)
    if "MODIFIER" in code:
        keep_right_half(suzanne)
    if "use_map" in code:
        bpy.context.scene.nicmm_curves.alignment_group = "Lane"
    if "strokes_to_curves" in code:
        add_stroke(suzanne)
    first = code.splitlines()[0]
    if not ("design_curve" in first or "strokes" in first) or "mirror" in code:
        bpy.ops.nicmm.design_curve(points="12, 80, 41, 7", order="GIVEN")
    names = Names(
        positions[[20, 33, 60, 71, 110, 150, 160]].tolist(),
        bpy=bpy,
        places=positions[[12, 80, 41, 7]].tolist(),
        stroke=STROKE.tolist(),
    )
    exec(compile(code, "documentation", "exec"), {}, names)
