"""Tests hand-written mesh files: which ones readers accept and which ones they refuse."""

import struct
import warnings

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core.io.files import read_mesh, write_curve, write_mesh
from tests.core.checks import grid

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)


@pytest.fixture
def read(tmp_path):
    """Function that reads a file with the given content."""

    def from_content(name, content):
        path = tmp_path / name
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return read_mesh(path)

    return from_content


def ply(body, *, faces, vertices=4, layout="ascii", coordinate="float", extra=()):
    lines = ["ply", f"format {layout} 1.0", "comment of no use", f"element vertex {vertices}"]
    lines += [f"property {coordinate} {axis}" for axis in "xyz"]
    return "\n".join([*lines, *extra, *faces, "end_header", ""]).encode() + body


FACES = ("element face 1", "property list uchar int vertex_indices")
FLOAT_FACES = ("element face 1", "property list int float vertex_index")


@pytest.mark.parametrize("order", ["<", ">"])
def test_ply_with_properties_of_different_types(read, order):
    """Such files crash some readers: colours after the coordinates, and lists of varying length."""
    layout = "binary_little_endian" if order == "<" else "binary_big_endian"
    body = b"".join(struct.pack(f"{order}3f3Bd", *p, 255, 0, 7, 0.5) for p in SQUARE)
    body += struct.pack(f"{order}B3iBh", 3, 0, 1, 2, 1, -7)
    body += struct.pack(f"{order}B4iB2h", 4, 0, 1, 2, 3, 2, -7, 5)
    content = ply(
        body,
        layout=layout,
        extra=[f"property uchar {name}" for name in ("red", "green", "blue")]
        + ["property double quality"],
        faces=("element face 2", FACES[1], "property list uchar short flags"),
    )
    mesh = read("colours.ply", content)
    np.testing.assert_array_equal(mesh.vertices, SQUARE)
    np.testing.assert_array_equal(mesh.faces, [[0, 1, 2], [0, 1, 2], [0, 2, 3]])


def test_ply_as_text_with_other_elements(read):
    body = b"7\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n"
    content = ply(body, faces=FACES).replace(
        b"element vertex", b"element thing 1\nproperty int one\nelement vertex"
    )
    assert read("square.ply", content).faces.tolist() == [[0, 1, 2]]


@pytest.mark.parametrize("layout", ["ascii", "binary_little_endian"])
def test_ply_of_quads_with_a_comment_in_another_language(read, layout):
    text = layout == "ascii"
    body = b"4 0 1 2 3\n" if text else struct.pack("<B4i", 4, 0, 1, 2, 3)
    content = ply((POINTS if text else PACKED) + body, layout=layout, faces=FACES)
    for comment in ("of no use", "aus der Küche"):
        changed = content.replace(b"comment of no use", f"comment {comment}".encode())
        mesh = read("quad.ply", changed)
        np.testing.assert_array_equal(mesh.vertices, SQUARE)
        assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3]]


def test_triangle_strips(read):
    """Two strips on a grid of four squares; all triangles have the same orientation."""
    positions = [(x, y, 0) for y in range(3) for x in range(3)]
    body = b"".join(struct.pack("<3f", *p) for p in positions)
    strip = [0, 3, 1, 4, 2, 5, -1, 3, 6, 4, 7, 5, 8, -1]
    body += struct.pack(f"<{len(strip) + 1}i", len(strip), *strip)
    faces = ("element tristrips 1", "property list int int vertex_indices")
    mesh = read("strip.ply", ply(body, vertices=9, layout="binary_little_endian", faces=faces))
    assert mesh.faces.shape == (8, 3)
    np.testing.assert_array_equal(mesh.face_normals, np.tile([0, 0, -1.0], (8, 1)))
    assert mesh.face_areas.sum() == pytest.approx(4.0)


def test_obj_in_all_its_forms(read):
    mesh = read(
        "forms.OBJ",
        "# v 9 9 9\nmtllib x.mtl\r\no \xfcnder\n"
        "v 0 0 0 1.0\nv 1 0 0 0.2 0.3 0.4\nvt 0 0\nvn 0 0 1\nv 1 \\\n 1 0\n\tv 0 1 0 # end\n"
        "f 1/1/1 2//1 3/1\nf -4 -2 -1\nl 1 2\nf 4 1 1\n",
    )
    np.testing.assert_array_equal(mesh.vertices, SQUARE)
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3]]


def test_off_with_colours_and_counts_beside_the_name(read):
    mesh = read("c.off", "COFF 4 2 0 # counts\n0 0 0 1 1 1 1\n\n1 0 0 0 0 0 1\n1 1 0 0 0 0 1\n"
                "0 1 0 0 0 0 1\n3 0 1 2 255 0 0\n3 0 2 3\n")  # fmt: skip
    np.testing.assert_array_equal(mesh.vertices, SQUARE)
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3]]


def test_binary_stl_that_begins_like_text(read):
    triangles = b"".join(
        struct.pack("<12fH", 0, 0, 1, *SQUARE[[0, a, b]].ravel(), 0) for a, b in ((1, 2), (2, 3))
    )
    mesh = read("solid.stl", b"solid of a square".ljust(80) + struct.pack("<I", 2) + triangles)
    assert (len(mesh.vertices), len(mesh.faces)) == (4, 2)
    assert mesh.face_areas.sum() == pytest.approx(1.0)


def test_quad_with_a_notch_is_cut_inside(read):
    """In a dart, only the diagonal from the reflex corner lies inside."""
    for turn in range(4):
        corners = " ".join(str((i + turn) % 4 + 1) for i in range(4))
        mesh = read("dart.obj", f"v 0 0 0\nv 2 -1 0\nv 0.5 0 0\nv 2 1 0\nf {corners}\n")
        normals = mesh.face_normals[:, 2]
        assert mesh.face_areas.sum() == pytest.approx(0.5)
        assert (normals == normals[0]).all()


def test_large_polygon(read):
    angles = np.arange(500) * 2 * np.pi / 500
    lines = [f"v {np.cos(a)} {np.sin(a)} 0" for a in angles]
    mesh = read("round.obj", "\n".join([*lines, "f " + " ".join(map(str, range(1, 501)))]))
    assert mesh.faces.shape == (498, 3)
    assert mesh.face_areas.sum() == pytest.approx(np.pi, rel=1e-3)


@pytest.mark.parametrize("ending", [".obj", ".off", ".ply"])
def test_every_digit_survives(tmp_path, ending):
    mesh = nicmm.Mesh(grid(3).vertices * (1 / 3) + 1e-9, grid(3).faces)
    write_mesh(tmp_path / f"Würfel 立方体{ending}", mesh)
    again = read_mesh(tmp_path / f"Würfel 立方体{ending}")
    np.testing.assert_array_equal(again.vertices, mesh.vertices)
    np.testing.assert_array_equal(again.faces, mesh.faces)


HUGE = 4_000_000_000
POINTS = b"0 0 0\n1 0 0\n1 1 0\n0 1 0\n"
BINARY = {"layout": "binary_little_endian"}
PACKED = SQUARE.astype("<f4").tobytes()

REFUSED = {
    "garbage.ply": bytes(range(256)),
    "cut header.ply": b"ply\nformat ascii 1.0\nelement vertex 4\n",
    "no format.ply": ply(POINTS, faces=FACES).replace(b"format ascii 1.0\n", b""),
    "type.ply": ply(POINTS, faces=FACES, coordinate="quadruple"),
    "format.ply": ply(POINTS, faces=FACES, layout="binary_middle_endian"),
    "property first.ply": b"ply\nformat ascii 1.0\nproperty int x\nend_header\n",
    "cut.ply": ply(POINTS, faces=FACES),
    "cut binary.ply": ply(PACKED + b"\x03\0\0\0\0", faces=FACES, **BINARY),
    "huge list.ply": ply(
        PACKED + struct.pack("<I", HUGE),
        faces=("element face 1", "property list uint int vertex_indices"),
        **BINARY,
    ),
    "negative list.ply": ply(
        PACKED + struct.pack("<i", -1),
        faces=("element face 1", "property list int int vertex_indices"),
        **BINARY,
    ),
    "huge.ply": ply(PACKED, vertices=HUGE, faces=FACES, **BINARY),
    "huge text.ply": ply(POINTS, vertices=HUGE, faces=FACES),
    "negative.ply": ply(POINTS, vertices=-4, faces=FACES),
    "huge faces.ply": ply(PACKED, faces=(f"element face {HUGE}", FACES[1]), **BINARY),
    "no properties.ply": ply(POINTS, faces=(f"element face {HUGE}",)),
    "no faces.ply": ply(POINTS, faces=()),
    "list of x.ply": ply(POINTS, faces=FACES).replace(b"float x", b"list int int x"),
    "half.ply": ply(POINTS + b"3 0 1 1.5\n", faces=FLOAT_FACES),
    "nan.ply": ply(POINTS + b"3 0 1 nan\n", faces=FLOAT_FACES),
    "beyond.ply": ply(POINTS + b"3 0 1 4\n", faces=FACES),
    "below.ply": ply(POINTS + b"3 0 1 -1\n", faces=FACES),
    "infinite.obj": "v 0 0 0\nv inf 0 0\nv 0 1 0\nf 1 2 3\n",
    "flat.obj": "v 0 0\nf 1 1 1\n",
    "words.obj": "v 0 0 zero\n",
    "zero.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n",
    "back.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -4 1 2\n",
    "huge index.obj": "v 0 0 0\nf 1 2 " + "9" * 400 + "\n",
    "longer index.obj": "v 0 0 0\nf 1 2 " + "9" * 100_000 + "\n",
    "text index.obj": "v 0 0 0\nf 1 2 x\n",
    "no area.obj": "v 0 0 0\nv 1 0 0\nf 1 2 2\n",
    "utf-16.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n".encode("utf-16"),
    "binary.off": b"OFF BINARY\n\0\0\0\3\0\0\0\1\0\0\0\0",
    "four.off": "4OFF\n1 1 0\n",
    "counts.off": "OFF\n3\n",
    "name only.off": "OFF",
    "huge.off": f"OFF\n{HUGE // 4} {HUGE // 4} 0\n0 0 0\n",
    "negative.off": "OFF\n-1 2 0\n0 0 0\n",
    "corners.off": "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n-3 0 1 2\n",
    "fewer corners.off": "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n4 0 1 2\n",
    "plane.off": "OFF\n3 1 0\n0 0\n1 0\n0 1\n3 0 1 2\n",
    "short.stl": b"\0" * 83,
    "none.stl": b"\0" * 84,
    "huge.stl": b"\0" * 80 + struct.pack("<I", HUGE) + b"\0" * 50,
    "nan.stl": b"\0" * 80 + struct.pack("<I12fH", 1, *[np.nan] * 12, 0),
    "signalling nan.stl": b"\0" * 80 + struct.pack("<I", 1) + b"\x00\x00\xa0\x7f" * 12 + b"\0\0",
    "cut.stl": "solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n",
    "quad.stl": "solid x\n" + "vertex 0 0 0\n" * 4 + "endfacet\n",
    "words.stl": "solid x\n" + "vertex 0 0 zero\n" * 3 + "endfacet\n",
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_refused_with_the_name_of_the_file(read, name, capfd):
    with warnings.catch_warnings(), pytest.raises(nicmm.MeshError) as refusal:
        warnings.simplefilter("error")
        read(name, REFUSED[name])
    assert name in str(refusal.value)
    assert len(str(refusal.value)) < 600
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("path", [None, 3, b"ball.obj", "", "ball\0.obj", "x" * 5000 + ".obj"])
def test_what_is_no_path_is_refused(path, small_ball):
    with pytest.raises(nicmm.MeshError):
        read_mesh(path)
    with pytest.raises(nicmm.ArgumentError):
        write_mesh(path, small_ball)


def test_folders_with_endings_are_refused(tmp_path, small_ball):
    (tmp_path / "folder.obj").mkdir()
    with pytest.raises(nicmm.MeshError, match=r"folder\.obj"):
        read_mesh(tmp_path / "folder.obj")
    with pytest.raises(nicmm.ArgumentError, match=r"folder\.obj"):
        write_mesh(tmp_path / "folder.obj", small_ball)
    curve = nicmm.design_curve(small_ball, [3, 60, 100]).curves[0]
    with pytest.raises(nicmm.ArgumentError, match=r"folder\.obj"):
        write_curve(tmp_path / "folder.obj", curve)
