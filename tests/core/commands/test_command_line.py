"""Tests of the command line: what it reads, writes, prints and returns."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.commands import main
from nicmm_core.geometry.curve import SurfaceCurve
from nicmm_core.io.files import read_mesh, write_mesh
from nicmm_core.paper.weights_file import load_network
from tests.core.checks import assert_valid_curve

ROOT = Path(__file__).parents[3]
CHOSEN = "3,60,100"


@pytest.fixture(scope="module")
def mesh_file(small_ball, tmp_path_factory):
    path = tmp_path_factory.mktemp("meshes") / "ball.off"
    write_mesh(path, small_ball)
    return path


def as_program(*arguments, folder):
    path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    return subprocess.run(
        [sys.executable, "-m", "nicmm_core", *map(str, arguments)],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.slow
def test_program_writes_the_curve_that_the_function_gives(mesh_file, tmp_path):
    result = as_program(
        "design", mesh_file, "--points", CHOSEN, "-o", "curve.json", folder=tmp_path
    )
    assert result.returncode == 0
    assert re.fullmatch(r"3 points, length [\d.]+, converged: curve\.json\n", result.stderr)
    data = json.loads((tmp_path / "curve.json").read_text())
    arrays = {name: np.array(data[name]) for name in data if name != "closed"}
    mesh = read_mesh(mesh_file)
    chosen = [int(vertex) for vertex in CHOSEN.split(",")]
    assert_valid_curve(mesh, SurfaceCurve(data["closed"], **arrays), mesh.vertices[chosen])
    (expected,) = nicmm.design_curve(mesh, chosen).curves
    np.testing.assert_array_equal(arrays["faces"], expected.faces)
    np.testing.assert_allclose(arrays["points"], expected.points, rtol=0, atol=1e-9)


@pytest.mark.slow
def test_program_ends_with_2_and_the_message(mesh_file, tmp_path):
    result = as_program(
        "design", mesh_file, "--points", "3,60,999", "-o", "curve.obj", folder=tmp_path
    )
    assert result.returncode == 2
    assert "control_points[2] = 999 is out of range" in result.stderr
    assert "Traceback" not in result.stderr
    assert result.stdout == ""
    assert not (tmp_path / "curve.obj").exists()


@pytest.mark.parametrize(("mesh_ending", "ending"), [(".obj", ".obj"), (".ply", ".csv")])
def test_formats_go_by_their_endings(small_ball, tmp_path, mesh_ending, ending):
    write_mesh(tmp_path / f"ball{mesh_ending}", small_ball)
    output = tmp_path / f"curve{ending}"
    assert (
        main(
            ["design", str(tmp_path / f"ball{mesh_ending}"), "--points", CHOSEN, "-o", str(output)]
        )
        == 0
    )
    first = output.read_text().splitlines()[0]
    assert first.startswith("v ") if ending == ".obj" else first.startswith("face,")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("flags", "options"),
    [
        ("--order shortest", {"order": "shortest"}),
        ("--smoothness 0.2", {"smoothness": 0.2}),
        ("--method variational", {"method": "variational"}),
        ("--open", {"closed": False}),
        ("--corners 0,2", {"corners": [0, 2]}),
        ("--normal-bending 0.5", {"normal_bending": 0.5}),
    ],
)
def test_options_reach_the_design(mesh_file, tmp_path, one_attempt, flags, options):
    output, chosen = tmp_path / "curve.json", [3, 60, 100, 20]
    arguments = ["design", str(mesh_file), "--points", "3,60,100,20", "-o", str(output)]
    assert main([*arguments, *flags.split()]) == 0
    mesh = read_mesh(mesh_file)
    points = np.array(json.loads(output.read_text())["points"])
    expected, plain = (
        nicmm.design_curve(mesh, chosen, **given).curves[0].points for given in (options, {})
    )
    np.testing.assert_allclose(points, expected, rtol=0, atol=1e-9)
    assert not np.array_equal(expected, plain)


@pytest.mark.slow
def test_alternatives_are_written_beside_the_curve(tmp_path, capsys):
    mesh_path, output = tmp_path / "body.obj", tmp_path / "curve.csv"
    body = shapes.creature(5, resolution=32, faces=1500, subdivisions=1)
    write_mesh(mesh_path, body)
    arguments = ["design", str(mesh_path), "--points", "20,250,600", "-o", str(output)]
    assert main([*arguments, "--alternatives", "2"]) == 0
    expected = nicmm.design_curve(read_mesh(mesh_path), [20, 250, 600], alternatives=2)
    assert expected.alternatives
    written = sorted(path.name for path in tmp_path.glob("*.csv"))
    numbers = range(1, 1 + len(expected.alternatives))
    assert written == sorted(["curve.csv", *(f"curve-{number}.csv" for number in numbers)])
    assert len({path.read_text() for path in tmp_path.glob("*.csv")}) == len(written)
    assert len(capsys.readouterr().err.splitlines()) == len(written)


BAD_COMMANDS = {
    "missing mesh": (["nowhere.obj", "--points", CHOSEN], "nowhere.obj"),
    "unknown mesh format": (["mesh.blend", "--points", CHOSEN], "mesh.blend"),
    "points no numbers": (["MESH", "--points", "a,b,c"], "--points is 'a,b,c'"),
    "too few points": (["MESH", "--points", "3,60"], "too few"),
    "repeated points": (["MESH", "--points", "3,60,3"], "same point"),
    "smoothness negative": (["MESH", "--points", CHOSEN, "--smoothness", "-1"], "smoothness"),
    "unknown method": (["MESH", "--points", CHOSEN, "--method", "magic"], "magic"),
}


@pytest.mark.parametrize(("arguments", "message"), BAD_COMMANDS.values(), ids=BAD_COMMANDS)
def test_bad_commands_end_with_2_and_say_why(mesh_file, tmp_path, capsys, arguments, message):
    output = tmp_path / "curve.obj"
    arguments = [str(mesh_file) if a == "MESH" else a for a in arguments]
    try:
        status = main(["design", *arguments, "-o", str(output)])
    except SystemExit as ended:  # the parser exits by itself, with the same status
        status = ended.code
    assert status == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert message in printed.err
    assert not output.exists()


def test_bad_output_is_refused_before_the_work(tmp_path, capsys):
    """The mesh file is missing too, but the output path is checked first."""
    arguments = ["design", "nowhere.obj", "--points", CHOSEN, "-o", str(tmp_path / "curve.xyz")]
    assert main(arguments) == 2
    assert "curve.xyz" in capsys.readouterr().err


@pytest.mark.slow
def test_shapes_writes_meshes_that_differ(tmp_path):
    assert main(["shapes", str(tmp_path / "meshes"), "--count", "2"]) == 0
    first, second = sorted((tmp_path / "meshes").iterdir())
    meshes = read_mesh(first), read_mesh(second)
    assert all(len(np.unique(mesh.face_component)) == 1 for mesh in meshes)
    assert not np.array_equal(meshes[0].vertices[:100], meshes[1].vertices[:100])


@pytest.mark.slow
def test_pretrain_writes_weights_with_the_switches_asked_for(mesh_file, tmp_path, capsys):
    output = tmp_path / "weights.npz"
    options = ["--sets", "2", "--epochs", "1", "--no-attention"]
    assert main(["pretrain", str(mesh_file), "-o", str(output), *options]) == 0
    config = load_network(output).config
    assert (config.attention, config.gating) == (False, True)
    # The progress bar goes to standard error.
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize(
    "options", [["--sets", "0"], ["--sets", "2", "--epochs", "0"], ["--sets", "-3"]]
)
def test_pretrain_refuses_to_train_nothing(mesh_file, tmp_path, capsys, options):
    output = tmp_path / "weights.npz"
    try:
        status = main(["pretrain", str(mesh_file), "-o", str(output), *options])
    except SystemExit as ended:
        status = ended.code
    assert status == 2
    assert capsys.readouterr().err
    assert not output.exists()


@pytest.mark.parametrize("package", ["torch", "tqdm"])
def test_pretrain_says_which_package_is_missing(mesh_file, tmp_path, capsys, monkeypatch, package):
    monkeypatch.setitem(sys.modules, package, None)  # makes its import fail
    output = tmp_path / "weights.npz"
    assert main(["pretrain", str(mesh_file), "-o", str(output)]) == 2
    message = capsys.readouterr().err
    assert package in message.partition("(")[2] and "pip install" in message
    assert not output.exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "arguments"),
    [
        (["--alignment", "sharp", "--angle", "12"], {"alignment": True}),
        (["--obstacles", "sharp", "--angle", "12"], {"obstacles": True}),
    ],
)
def test_automatic_maps_are_those_of_the_functions(mesh_file, tmp_path, options, arguments):
    """Most faces of this sphere meet at angles of at least 15 degrees."""
    output = tmp_path / "curve.json"
    mesh = read_mesh(mesh_file)
    weights = nicmm.sharp_edge_map(mesh, np.radians(12.0))
    arguments = {name: weights for name in arguments}
    try:
        expected = nicmm.design_curve(mesh, [3, 60, 100], **arguments).curves[0]
    except nicmm.UnreachableError:
        expected = None
    status = main(["design", str(mesh_file), "--points", CHOSEN, "-o", str(output), *options])
    assert status == (2 if expected is None else 0)
    if expected is not None:
        np.testing.assert_array_equal(json.loads(output.read_text())["faces"], expected.faces)


@pytest.mark.slow
def test_offset_writes_the_curves_at_each_distance(mesh_file, tmp_path, capsys):
    curve, output = tmp_path / "curve.json", tmp_path / "parallel.json"
    assert main(["design", str(mesh_file), "--points", CHOSEN, "-o", str(curve)]) == 0
    given = ["offset", str(mesh_file), str(curve), "-o", str(output)]
    assert main([*given, "--distance", "0.1", "--distance=-0.1,-0.2,-0.1"]) == 0
    mesh = read_mesh(mesh_file)
    design = nicmm.design_curve(mesh, [3, 60, 100])
    for number, distance in enumerate((0.1, [-0.1, -0.2, -0.1])):
        [expected] = nicmm.offset_curve(mesh, design, distance)
        path = tmp_path / ("parallel-1.json" if number else "parallel.json")
        data = json.loads(path.read_text())
        np.testing.assert_allclose(data["points"], expected.points, rtol=0, atol=1e-6)
    capsys.readouterr()
    assert main([*given, "--distance", "0.1,far"]) == 2
    assert "--distance is '0.1,far'" in capsys.readouterr().err
    assert main([*given, "--distance", "3"]) == 0
    assert "no place on that side is so far away" in capsys.readouterr().err


@pytest.mark.slow
def test_measures_are_printed_as_json(mesh_file, tmp_path, capsys):
    output = tmp_path / "curve.json"
    given = ["design", str(mesh_file), "--points", CHOSEN, "-o", str(output), "--measures"]
    assert main(given) == 0
    [line] = capsys.readouterr().out.splitlines()
    found = json.loads(line)
    mesh = nicmm.read_mesh(mesh_file)
    expected = nicmm.read_curve(output).measures(mesh)
    assert found.pop("file") == str(output)
    assert found.keys() == expected.keys()
    for name, value in expected.items():
        assert found[name] == (None if value is None else pytest.approx(value, rel=1e-6))
