"""Tests that all formats of meshes and curves preserve data, and that bad paths are refused."""

import csv
import json

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core.io.files import check_curve_path, read_mesh, write_curve, write_mesh
from nicmm_core.paper.contour import extract_curves
from nicmm_core.path.virtual_splits import SplitMesh


def surface_area(mesh):
    return mesh.face_areas.sum()


@pytest.mark.parametrize("ending", [".obj", ".off", ".ply", ".stl", ".OBJ"])
def test_mesh_survives_the_file(small_ball, tmp_path, ending):
    path = tmp_path / f"ball{ending}"
    write_mesh(path.with_suffix(ending.lower()), small_ball)
    path.with_suffix(ending.lower()).rename(path)
    mesh = read_mesh(path)
    assert len(mesh.vertices) == len(small_ball.vertices)
    assert len(mesh.faces) == len(small_ball.faces)
    # STL stores single precision.
    assert surface_area(mesh) == pytest.approx(surface_area(small_ball), rel=1e-6)
    if ending != ".stl":
        np.testing.assert_allclose(mesh.vertices, small_ball.vertices, rtol=0, atol=1e-6)
        np.testing.assert_array_equal(mesh.faces, small_ball.faces)


def test_corners_of_stl_are_joined(tmp_path):
    """Two triangles with six separate corners, and one that is degenerate after joining."""
    facets = [
        [(0, 0, 0), (1, 0, 0), (0, 1, 0)],
        [(1, 0, 0), (1, 1, 0), (0, 1, 0)],
        [(1, 0, 0), (1, 0, 0), (0, 1, 0)],
    ]
    lines = ["solid square"]
    for facet in facets:
        lines += ["facet normal 0 0 1", "outer loop"]
        lines += [f"vertex {x} {y} {z}" for x, y, z in facet]
        lines += ["endloop", "endfacet"]
    path = tmp_path / "square.stl"
    path.write_text("\n".join([*lines, "endsolid square", ""]))
    mesh = read_mesh(path)
    assert mesh.vertices.shape == (4, 3)
    assert mesh.faces.shape == (2, 3)
    assert len(np.unique(mesh.face_component)) == 1
    assert surface_area(mesh) == pytest.approx(1.0)


def bad_mesh_files(folder):
    contents = {
        "quads.obj": "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n",
        "points.obj": "v 0 0 0\nv 1 0 0\n",
        "beyond.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 7\n",
        "empty.off": "",
        "text.ply": "hello\n",
        "cut.off": "OFF\n3 1 0\n0 0 0\n1 0 0\n",
        "other.txt": "v 0 0 0\n",
    }
    for name, text in contents.items():
        (folder / name).write_text(text)
    return [*contents, "missing.obj", "."]


@pytest.mark.parametrize(
    "name",
    [
        "points.obj",
        "beyond.obj",
        "empty.off",
        "text.ply",
        "cut.off",
        "other.txt",
        "missing.obj",
        ".",
    ],
)
def test_files_without_a_triangle_mesh_are_refused(tmp_path, name, capfd):
    bad_mesh_files(tmp_path)
    with pytest.raises(nicmm.MeshError):
        read_mesh(tmp_path / name)
    # The underlying reader prints messages; these belong in the error instead.
    assert capfd.readouterr() == ("", "")


def test_larger_faces_are_triangulated_or_refused(tmp_path):
    bad_mesh_files(tmp_path)
    try:
        mesh = read_mesh(tmp_path / "quads.obj")
    except nicmm.MeshError as error:
        assert "triang" in str(error)
    else:
        assert surface_area(mesh) == pytest.approx(1.0)


@pytest.fixture(params=[True, False], ids=["closed", "open"])
def curve(request, ball, flat_disc):
    """A circle of latitude on the ball, or a chord of the disc."""
    mesh = ball if request.param else flat_disc
    working, _ = SplitMesh(mesh).assemble(0)
    field = mesh.vertices[:, 2 if request.param else 0] - 0.2
    return extract_curves(mesh, working, field, np.zeros(0, dtype=np.int64))[0]


def test_obj_is_a_polyline(curve, tmp_path):
    write_curve(tmp_path / "curve.obj", curve)
    lines = (tmp_path / "curve.obj").read_text().splitlines()
    points = [list(map(float, line.split()[1:])) for line in lines if line.startswith("v ")]
    np.testing.assert_array_equal(points, curve.points)
    (order,) = [list(map(int, line.split()[1:])) for line in lines if line.startswith("l ")]
    expected = list(range(1, len(points) + 1))
    assert order == (expected + [1] if curve.closed else expected)


def test_json_holds_the_whole_curve(curve, tmp_path):
    write_curve(tmp_path / "curve.json", curve)
    data = json.loads((tmp_path / "curve.json").read_text())
    assert data["closed"] is curve.closed
    for name in ("faces", "barycentric", "points", "control_index"):
        np.testing.assert_array_equal(np.array(data[name]), getattr(curve, name))


def test_csv_has_one_row_a_point(curve, tmp_path):
    write_curve(tmp_path / "curve.csv", curve)
    with (tmp_path / "curve.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["face"]) for row in rows] == curve.faces.tolist()
    for names, values in (
        (("b0", "b1", "b2"), curve.barycentric),
        (("x", "y", "z"), curve.points),
    ):
        np.testing.assert_array_equal([[float(row[n]) for n in names] for row in rows], values)


@pytest.mark.parametrize("name", ["curve.txt", "curve", "nowhere/curve.obj"])
def test_bad_output_paths_are_refused_before_and_while_writing(ball, tmp_path, name):
    working, _ = SplitMesh(ball).assemble(0)
    none = np.zeros(0, dtype=np.int64)
    (curve,) = extract_curves(ball, working, ball.vertices[:, 2] - 0.2, none)
    for refuse in (check_curve_path, lambda path: write_curve(path, curve)):
        with pytest.raises(nicmm.ArgumentError, match="curve|nowhere"):
            refuse(tmp_path / name)
    assert not (tmp_path / name).exists()
