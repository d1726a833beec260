"""The documented script, run as the documentation shows it, through the bpy module."""

import os
import subprocess
import sys

import bpy
import numpy as np

import build
from tests.blender import scenes

SCRIPT = build.ROOT / "docs" / "examples" / "design_curve.py"

# What `blender -b FILE --python SCRIPT -- ARGUMENTS` does, for the bpy module.
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


def test_documented_script(empty_scene, tmp_path):
    sphere = scenes.sphere()
    sphere.name = "Head"
    vertices = scenes.ring(sphere, 3)
    expected = empty_scene.core.design_curve(
        empty_scene.core.Mesh(scenes.positions(sphere), scenes.triangles(sphere)), vertices
    )
    source, output = tmp_path / "head.blend", tmp_path / "out.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(source))

    arguments = [source, SCRIPT, "--", "Head", ",".join(map(str, vertices)), output]
    ran = subprocess.run(
        [sys.executable, "-c", RUNNER, *map(str, arguments)],
        env=os.environ,  # the user folder with the installed extension
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )

    assert ran.returncode == 0, ran.stderr
    assert "Head Curve: " in ran.stdout
    bpy.ops.wm.open_mainfile(filepath=str(output))
    np.testing.assert_allclose(
        scenes.points(bpy.data.objects["Head Curve"]), expected.curves[0].points, atol=1e-6
    )
