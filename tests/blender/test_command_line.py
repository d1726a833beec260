"""`blender -c nicmm`, as Blender calls it."""

import os
import subprocess
import sys
from importlib import import_module

import bpy
import numpy as np
import pytest

from tests.blender import scenes


@pytest.fixture
def command(empty_scene):
    return import_module(f"{empty_scene.name}.nicmm_blender.command_line").main


@pytest.fixture
def file(empty_scene, tmp_path):
    """A file with a sphere and vertex groups: its path, the vertices of "Cut" and the mesh."""
    scenes.sphere().name = "Körper"
    body = bpy.data.objects["Körper"]
    vertices = scenes.ring(body, 4, height=0.3)
    body.vertex_groups.new(name="Cut").add(vertices, 1.0, "REPLACE")
    far = [v for v in range(162) if scenes.positions(body)[v, 2] < -0.8]
    body.vertex_groups.new(name="Wall").add(far, 1.0, "REPLACE")
    bpy.ops.mesh.primitive_cube_add()
    path = tmp_path / "in.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    core = empty_scene.core
    mesh = core.Mesh(scenes.positions(body), scenes.triangles(body))
    return path, vertices, mesh


def drawn(path):
    bpy.ops.wm.open_mainfile(filepath=str(path))
    return bpy.data.objects["Körper Curve"]


@pytest.mark.slow
def test_group_points_and_places_give_the_same(command, file, tmp_path, extension):
    path, vertices, mesh = file
    before = path.read_bytes()
    in_order = scenes.design(extension.core, mesh, vertices).curves[0].points
    shortest = scenes.design(extension.core, mesh, sorted(vertices), order="shortest")
    places = [" ".join(map(str, mesh.vertices[v])) for v in vertices]
    for number, points in enumerate(
        (
            ["--group", "Cut"],
            ["--points", ",".join(map(str, vertices))],
            ["--points", ", ".join(places)],
            ["--points", ", ".join([*places[:2], *map(str, vertices[2:])])],
        )
    ):
        out = tmp_path / f"out{number}.blend"
        arguments = ["--file", str(path), "--object", "Körper", "--output-file", str(out)]
        assert command([*arguments, *points, "--spline", "exact"]) == 0
        found = scenes.points(drawn(out))
        # Both orders are the same here, but the curve is searched for from another point.
        expected = shortest.curves[0].points if points[0] == "--group" else in_order
        assert scenes.distances_to(expected, found).max() < 1e-3
        assert scenes.distances_to(found, expected).max() < 1e-3
    assert path.read_bytes() == before


@pytest.mark.slow
def test_settings_are_those_of_the_operator(command, file, tmp_path):
    path, _vertices, _mesh = file
    out = tmp_path / "out.blend"
    arguments = ["--file", str(path), "--object", "Körper", "--group", "Cut"]
    arguments += ["--output-file", str(out), "--output", "sticky", "--no-closed"]
    arguments += ["--obstacle-group", "Wall", "--clearance", "0.1", "--smoothness", "2"]
    assert command(arguments) == 0
    curve = drawn(out)
    assert curve.type == "CURVES"
    assert not curve.data.attributes["cyclic"].data[0].value
    settings = curve["nicmm_curve"]["asked"]
    assert settings["obstacle_group"] == "Wall"
    assert settings["clearance"] == pytest.approx(0.1)
    assert settings["smoothness"] == 2.0


def test_every_setting_is_an_option(command, extension, capsys):
    settings = import_module(f"{extension.name}.nicmm_blender.settings")
    assert command(["--help"]) == 0
    shown = capsys.readouterr().out
    for name in settings.PROPERTY_NAMES:
        assert f"--{name.replace('_', '-')}" in shown


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"--object": "Nobody"}, 'no object "Nobody" in the file. Its meshes are "Cube", "Körper"'),
        ({"--file": "gone.blend"}, "there is no file"),
        ({"--output-file": "gone/out.blend"}, "there is no folder"),
        ({"--group": "Nothing"}, 'no vertex group "Nothing"'),
        ({"--points": "1,2,x"}, 'The point "x" is neither'),
        ({"--points": "1,2,0.5 1"}, 'The point "0.5 1" is neither'),
        ({"--points": "1,2,9 9 9"}, "off the surface"),
        ({"--points": "1,2,999"}, "999 is out of range"),
        ({"--points": "1,2,nan 0 0"}, 'The point "nan 0 0" is neither'),
        ({"--points": ""}, "--points is empty"),
        ({"--group": ""}, "--group is empty"),
        ({"--smoothness": "nan"}, "Smoothness is nan. Give a finite number"),
        ({"--radius": "nan"}, "Radius is nan. Give a finite number"),
        ({"--output": "shoes"}, "invalid choice"),
        ({"--object": "Cube"}, 'no vertex group "Cut"'),
        ({"--file": None}, "--file"),
    ],
)
def test_refusals_are_2_with_a_message(command, file, tmp_path, capfd, changes, message):
    path, _vertices, _mesh = file
    arguments = {
        "--file": str(path),
        "--object": "Körper",
        "--output-file": str(tmp_path / "out.blend"),
        **({} if "--points" in changes else {"--group": "Cut"}),
        **changes,
    }
    words = [word for pair in arguments.items() if pair[1] is not None for word in pair]
    assert command(words) == 2
    assert message in capfd.readouterr().err
    assert not (tmp_path / "out.blend").exists()


def test_file_is_not_overwritten(command, file, capfd):
    path, _vertices, _mesh = file
    before = path.read_bytes()
    assert command(["--file", str(path), "--output-file", str(path), "--group", "Cut"]) == 2
    assert "is the same file as --file" in capfd.readouterr().err
    assert path.read_bytes() == before


# Does what `blender -c nicmm ...` does, since the bpy module has no command line.
RUNNER = """
import os
import sys
from importlib import import_module
import bpy, addon_utils
addon_utils.extensions_refresh()
addon_utils.enable("bl_ext.user_default.nicmm_curves", default_set=True)
command = import_module("bl_ext.user_default.nicmm_curves.nicmm_blender.command_line")
code = command.main(sys.argv[1:])
sys.stderr.flush()
os._exit(code)  # disabling would take the wheels away from the other process
"""


@pytest.mark.slow
@pytest.mark.usefixtures("bpy_module")
def test_in_a_process_of_its_own(extension, file, tmp_path):
    path, vertices, _mesh = file
    out = tmp_path / "out.blend"
    arguments = ["--file", path, "--object", "Körper", "--group", "Cut", "--output-file", out]
    ran = subprocess.run(
        [sys.executable, "-c", RUNNER, *map(str, arguments)],
        env=os.environ,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert ran.returncode == 0, ran.stderr
    assert np.isfinite(scenes.points(drawn(out))).all()
