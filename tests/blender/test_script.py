"""The script in the documentation, run with the documented arguments through the bpy module."""

import os
import re
import subprocess
import sys

import bpy
import numpy as np
import pytest

from building import environment, extension
from tests.blender import scenes

pytestmark = pytest.mark.slow

SCRIPT = environment.ROOT / "docs" / "examples" / "design_curve.py"

# Does what `blender -b FILE --python SCRIPT -- ARGUMENTS` does, for the bpy module.
RUNNER = """
import runpy, sys
import bpy, addon_utils
addon_utils.extensions_refresh()
addon_utils.enable("bl_ext.user_default.nicmm_curves", default_set=True)
bpy.ops.wm.open_mainfile(filepath=sys.argv[1])
try:
    runpy.run_path(sys.argv[2])
finally:
    addon_utils.disable("bl_ext.user_default.nicmm_curves", default_set=True)
"""


@pytest.mark.usefixtures("bpy_module")
def test_documented_script(empty_scene, all_attempts, tmp_path):
    documentation = (environment.ROOT / "docs" / "blender.md").read_text(encoding="utf-8")
    mesh_name, indices = re.search(r"-- \\\n +(\w+) ([\d,]+) out\.blend", documentation).groups()
    bpy.ops.mesh.primitive_monkey_add()
    monkey = bpy.data.objects[mesh_name]
    vertices = [int(index) for index in indices.split(",")]
    expected = scenes.design(
        empty_scene.core,
        empty_scene.core.Mesh(scenes.positions(monkey), scenes.triangles(monkey)),
        vertices,
    )
    source, output = tmp_path / "head.blend", tmp_path / "out.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(source))

    # The user folder is separate: disabling the extension removes its wheels from the folder.
    user_folder = tmp_path / "user"
    extension.stage(user_folder / "extensions" / "user_default" / "nicmm_curves")
    arguments = [source, SCRIPT, "--", mesh_name, indices, output]
    ran = subprocess.run(
        [sys.executable, "-c", RUNNER, *map(str, arguments)],
        env={**os.environ, "BLENDER_USER_RESOURCES": str(user_folder)},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )

    assert ran.returncode == 0, ran.stderr
    assert f"{mesh_name} Curve: " in ran.stdout
    bpy.ops.wm.open_mainfile(filepath=str(output))
    monkey_in_file = bpy.data.objects[mesh_name]
    # Evenly spaced points lie between those of the exact curve.
    found, exact = scenes.points(bpy.data.objects[f"{mesh_name} Curve"]), expected.curves[0].points
    spacing = np.linalg.norm(np.diff(exact, axis=0), axis=1).max()
    assert scenes.distances_to(found, exact).max() < spacing
    assert scenes.distances_to(scenes.positions(monkey_in_file)[vertices], found).max() < 1e-6
