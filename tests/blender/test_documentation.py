"""Runs the Python code of the documentation that needs Blender, and its lines for a terminal."""

import itertools

import bpy
import numpy as np
import pytest

from tests.blender import scenes
from tests.docs.pages import PAGES, blocks, is_for_blender, numbered_sphere

pytestmark = pytest.mark.slow

CODE = [
    pytest.param(code, id=f"{page.stem}-{number}")
    for page in PAGES
    for number, code in enumerate(blocks(page, "python"))
    if is_for_blender(code)
]
COMMANDS = [
    pytest.param(line, id=f"{page.stem}-{number}")
    for page in PAGES
    for code in blocks(page, "sh")
    for number, line in enumerate(code.splitlines())
    if line.startswith("blender -c nicmm")
]


class Names(dict):
    """What the code may use: fixed names, and a new place on the mesh for each (x, y, z)."""

    def __init__(self, places, **fixed):
        super().__init__(fixed)
        self._places, self._place = itertools.cycle(places), None

    def __missing__(self, name):
        if name not in ("x", "y", "z"):
            raise KeyError(name)
        if name == "x":
            self._place = next(self._places)
        return float(self._place["xyz".index(name)])


@pytest.fixture
def suzanne(empty_scene):
    """A sphere named Suzanne with groups, and a designed curve through five of its vertices."""
    mesh = numbered_sphere()
    data = bpy.data.meshes.new("Suzanne")
    data.from_pydata(mesh.vertices.tolist(), [], mesh.faces.tolist())
    made = bpy.data.objects.new("Suzanne", data)
    bpy.context.scene.collection.objects.link(made)
    scenes.activate(made)
    scenes.select(made, [12, 80, 41])
    for name, vertices in (("Cut", [12, 80, 41]), ("Obstacle", [300]), ("Wall", [301])):
        made.vertex_groups.new(name=name).add(vertices, 1.0, "REPLACE")
    return made


@pytest.mark.parametrize("code", CODE)
@pytest.mark.usefixtures("remembered_designs")
def test_code(suzanne, code):
    if "MODIFIER" in code:
        suzanne.modifiers.new("Mirror", "MIRROR")
    if "suzanne curve" in code.lower() or "active" in code or "_point" in code or "next" in code:
        bpy.ops.nicmm.design_curve(points="12, 80, 41, 7", order="GIVEN")
    places = scenes.positions(suzanne)[[20, 33, 60, 71, 110, 150, 160]].tolist()
    angle = np.linspace(0.0, 2.0, 60)
    stroke = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1).tolist()
    names = Names(places, bpy=bpy, places=places[:4], stroke=stroke)
    exec(compile(code, "documentation", "exec"), {}, names)
