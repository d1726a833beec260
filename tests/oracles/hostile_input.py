"""Generates cases of hostile input and judges how the package answers them.

A case is identified by a number. A valid answer is a curve without faults according to `checker`,
or an error of the package.
"""

from __future__ import annotations

import functools
import io
import tempfile
import warnings
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.array_types import FloatArray, IntArray
from nicmm_core.geometry.surface_points import locate_control_points
from nicmm_core.io.files import MESH_FORMATS, read_mesh, write_curve, write_mesh
from nicmm_core.paper.network import parameter_shapes
from nicmm_core.paper.weights_file import SHIPPED, load_network

from .checker import judge
from .untyped import place_of

SEED = 0

MANY = 16
"""Number of control points in a request with many points in a random order."""

NUMBERS = (
    0.0, -0.0, 1.0, -1.0, 0.5, 1e-300, -1e-300, 1e-12, 1e300, -1e300, np.nan, np.inf, -np.inf,
    5e-324, 2.0**53, 1.0 + 1e-9,
)  # fmt: skip

INDICES = (0, 1, 2, 7, -1, -5, 10**6, 2**31 - 1, 2**31, 2**63 - 1, -(2**63))

OBJECTS: tuple[Any, ...] = (
    None, True, False, 0, -1, 3, 1.5, np.nan, "", "3", "elastic", b"\0", (), [], {}, [None], [[]],
    [1, [2, 3]], ["a", "b", "c"], [1, 2, "3"], {1: 2}, {0, 1, 2}, object(), print, 1j, [1j, 2, 3],
    10**400, [10**400, 1, 2], np.array(5), np.array([], dtype=object), np.zeros((0, 3)),
    np.zeros((3, 0)), np.zeros((2, 3, 4)), np.array([1, 2, 3], dtype=object),
    np.array(["1", "2", "3"]), np.array([True, False, True]), np.array([1, 2, 3], dtype=np.uint64),
    np.array([0.0, 1.0, 2.0]), np.ma.masked_array([1, 2, 3], mask=[0, 1, 0]),
    np.array(["2020-01-01"] * 3, dtype="datetime64[D]"), np.float16(2), range(3), "012",
)  # fmt: skip

METHODS = (*["elastic"] * 6, *["variational"] * 2)


class CallersError(Exception):
    """Exception of a progress function, which the package must pass on to the caller."""


@dataclass
class Answer:
    """Kind of a case, and outcome and faults of the answer."""

    kind: str
    outcome: str = "refused"
    faults: list[str] = field(default_factory=list)


def answer(number: int) -> Answer:
    """Answer to the case with a number."""
    generator = np.random.default_rng([SEED, number])
    kind, ask = _chosen(generator, _KINDS)
    result = Answer(kind)
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        try:
            ask(generator, result)
        except nicmm.NicmmError as error:
            if not 20 <= len(str(error)) <= 1000:
                result.faults.append(f"a message of {len(str(error))} characters")
        # Any other exception is a finding.
        except Exception as error:
            result.outcome = "untyped"
            result.faults.append(f"{type(error).__name__} at {place_of(error)}: {error}"[:300])
    return result


def _arrays(generator: np.random.Generator, result: Answer) -> None:
    """Spoiled vertices and faces, and a curve on them if they are accepted as a mesh."""
    mesh = _sound_mesh(generator)
    vertices: Any = mesh.vertices.copy()
    faces: Any = mesh.faces.copy()
    for _ in range(generator.integers(1, 3)):
        match generator.integers(8):
            case 0:
                vertices = _object(generator)
            case 1:
                faces = _object(generator)
            case 2:
                vertices = _spoiled(generator, vertices, NUMBERS)
            case 3:
                faces = _spoiled(generator, faces, INDICES)
            case 4:
                vertices = _cast(generator, vertices)
            case 5:
                faces = _cast(generator, faces)
            case 6:
                vertices = mesh.vertices[: generator.integers(9)]
            case 7:
                faces = mesh.faces[: generator.integers(9)]
    mesh = nicmm.Mesh(vertices, faces)
    _designed(generator, result, mesh, _vertices_of_one_component(generator, mesh), {})


def _geometry(generator: np.random.Generator, result: Answer) -> None:
    """A valid mesh with geometric and topological defects."""
    mesh = _defective_mesh(generator)
    points = _vertices_of_one_component(generator, mesh)
    _designed(generator, result, mesh, points, _some_arguments(generator, mesh, len(points)))


def _control_points(generator: np.random.Generator, result: Answer) -> None:
    mesh = _any_mesh(generator)
    points = _hostile_points(generator, mesh)
    _designed(generator, result, mesh, points, {"closed": bool(generator.integers(2))})


def _arguments(generator: np.random.Generator, result: Answer) -> None:
    """Hostile values of all other arguments."""
    mesh = _any_mesh(generator)
    asked: Any = mesh
    points = _vertices_of_one_component(generator, mesh)
    arguments = _some_arguments(generator, mesh, len(points))
    for _ in range(generator.integers(1, 3)):
        match generator.integers(7):
            case 0:
                arguments["smoothness"] = _chosen(generator, (*NUMBERS, *OBJECTS))
            case 1:
                arguments["obstacles"] = _hostile_map(generator, mesh)
            case 2:
                arguments["alignment"] = _hostile_map(generator, mesh)
            case 3:
                arguments["via_points"] = _hostile_via(generator, mesh)
            case 4:
                name = _chosen(generator, ("order", "method", "closed", "progress"))
                arguments[name] = _object(generator)
            case 5:
                arguments["progress"] = _hostile_progress(generator)
            case 6:
                asked = _object(generator)
    _designed(generator, result, asked, points, arguments)


def _start(generator: np.random.Generator, result: Answer) -> None:
    """Designs that start from earlier ones, and from objects that are no curve on the mesh."""
    mesh = _any_mesh(generator)
    designer = nicmm.Designer(mesh)
    points: Any = _vertices_of_one_component(generator, mesh)
    arguments: dict[str, Any] = {
        "closed": bool(generator.integers(2)),
        "order": _chosen(generator, ("given", "shortest")),
    }
    start: Any = designer.design(points, **arguments)
    for _ in range(3):
        points = points.copy()
        match generator.integers(4):
            case 0:
                beside = np.unique(mesh.faces[mesh.faces_at(points[:1])])
                points[0] = _chosen(generator, beside)
            case 1:
                points = np.append(points, generator.choice(np.unique(mesh.faces)))
            case 2 if len(points) > 2:
                points = np.delete(points, generator.integers(len(points)))
        given = arguments | {"start": _hostile_start(generator, start)}
        if generator.random() < 0.5:
            given["max_iterations"] = int(generator.integers(1, 6))
        if generator.random() < 0.2:
            given["obstacles"] = (generator.random(len(mesh.vertices)) < 0.1).astype(float)
        try:
            start = _ask(designer, result, points, given) or start
        except nicmm.NicmmError:
            continue


def _hostile_start(generator: np.random.Generator, start: nicmm.Design) -> Any:
    """A design, its curve, or one of these with a spoiled field."""
    if generator.random() < 0.4 or not start.curves:
        return start
    curve = start.curves[0]
    names = ("faces", "barycentric", "points", "control_index", "closed")
    match generator.integers(6):
        case 0:
            return _object(generator)
        case 1:
            return replace(start, curves=[curve] * int(generator.integers(3)), resumable=None)
        case 2:
            return replace(curve, **{_chosen(generator, names): _object(generator)})
        case 3:
            name = _chosen(generator, names[:4])
            return replace(curve, **{name: _cast(generator, getattr(curve, name))})
        case 4:
            name = _chosen(generator, names[:4])
            values = INDICES if name in ("faces", "control_index") else NUMBERS
            return replace(curve, **{name: _spoiled(generator, getattr(curve, name), values)})
    return curve


def _sequence(generator: np.random.Generator, result: Answer) -> None:
    """Several requests to one Designer, some of which fail."""
    mesh = _any_mesh(generator)
    designer = nicmm.Designer(mesh)
    points: Any = _vertices_of_one_component(generator, mesh)
    for _ in range(2):
        arguments = {"smoothness": float(10.0 ** generator.uniform(-3, 3))}
        if generator.random() < 0.3:
            arguments["progress"] = _hostile_progress(generator)
        asked = points if generator.random() < 0.7 else _hostile_points(generator, mesh)
        try:
            _ask(designer, result, asked, arguments)
        except nicmm.NicmmError:
            continue
        if generator.random() < 0.5:
            points = points.copy()
            points[generator.integers(len(points))] = generator.integers(len(mesh.vertices))


def _mesh_file(generator: np.random.Generator, result: Answer) -> None:
    """A corrupt mesh file."""
    mesh = _sound_mesh(generator)
    ending = _chosen(generator, MESH_FORMATS)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"mesh{ending}"
        write_mesh(path, mesh)
        data = path.read_bytes()
        if ending == ".ply" and generator.random() < 0.5:
            data = _ply_as_text(mesh)
        if ending == ".stl" and generator.random() < 0.5:
            data = _stl_as_text(mesh)
        other = _chosen(generator, (ending, ending, ending, _chosen(generator, MESH_FORMATS)))
        path = path.with_suffix(other)
        path.write_bytes(_mutated(generator, data))
        read = read_mesh(path)
        result.outcome = "read"
        if generator.random() < 0.1:
            points = _vertices_of_one_component(generator, read)
            _designed(generator, result, read, points, {})


def _weights_file(generator: np.random.Generator, result: Answer) -> None:
    """A corrupt weights file, with right or wrong checksums of its members."""
    data = SHIPPED.read_bytes()
    if generator.random() < 0.7:
        members = dict(_weights_members())
        name = _chosen(generator, tuple(members))
        members[name] = _mutated(generator, members[name], 160)
        buffer = io.BytesIO()
        with zipfile.ZipFile(buffer, "w", _chosen(generator, _COMPRESSIONS)) as archive:
            for member, content in members.items():
                archive.writestr(member, content)
        data = buffer.getvalue()
    if generator.random() < 0.5:
        data = _mutated(generator, data)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "weights.npz"
        path.write_bytes(data)
        network = load_network(path)
    result.outcome = "read"
    shapes = {name: array.shape for name, array in network.parameters.items()}
    if shapes != parameter_shapes(network.config, network.channels):
        result.faults.append("weights of another network")
    if not all(np.isfinite(array).all() for array in network.parameters.values()):
        result.faults.append("weights that are not finite")


def _output(generator: np.random.Generator, result: Answer) -> None:
    """Paths that cannot be written or read."""
    paths = (
        "", ".", "/", "/nowhere/x.obj", "/proc/x.txt", "\0.obj", "x" * 300 + ".obj", "/dev/full",
        "/proc/x.json", "~/x.csv", "ü/x.obj",
    )  # fmt: skip
    path = _chosen(generator, (*paths, *OBJECTS[:20]))
    mesh = _sound_mesh(generator)
    match generator.integers(3):
        case 0:
            read_mesh(path)
        case 1:
            write_mesh(path, mesh)
        case 2:
            write_curve(path, _a_curve())
    result.faults.append(f"{path!r} was read or written")


_KINDS: tuple[tuple[str, Callable[[np.random.Generator, Answer], None]], ...] = (
    *[("mesh file", _mesh_file)] * 34,
    *[("arrays", _arrays)] * 12,
    *[("control points", _control_points)] * 12,
    *[("arguments", _arguments)] * 8,
    *[("weights file", _weights_file)] * 8,
    *[("output", _output)] * 4,
    ("geometry", _geometry),
    ("sequence", _sequence),
    *[("start", _start)] * 2,
)
"""Kinds of cases to choose from at random; slow kinds are rare."""

_COMPRESSIONS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)


def _designed(
    generator: np.random.Generator,
    result: Answer,
    mesh: Any,
    points: Any,
    arguments: dict[str, Any],
) -> None:
    """Request a curve and judge it."""
    _ask(nicmm.Designer(mesh), result, points, arguments)


def _ask(
    designer: nicmm.Designer, result: Answer, points: Any, arguments: dict[str, Any]
) -> nicmm.Design | None:
    mesh = designer.mesh
    before = mesh.vertices.tobytes(), mesh.faces.tobytes()
    try:
        design = designer.design(points, **arguments)
    except CallersError:
        result.outcome = "the caller's own error"
        return None
    if before != (mesh.vertices.tobytes(), mesh.faces.tobytes()):
        result.faults.append("the mesh was changed")
    result.outcome = design.status.name
    values = [*design.energy.values(), design.seconds]
    if not np.isfinite(values).all():
        result.faults.append(f"energy or seconds are not finite: {design.energy}")
    if design.field.shape != (len(mesh.vertices),) or not np.isfinite(design.field).all():
        result.faults.append("the field has another shape or is not finite")
    # Only the default method guarantees one curve.
    method = arguments.get("method", "elastic")
    if design.status is nicmm.Status.NOT_ONE_CURVE and method != "elastic":
        return design
    closed = bool(arguments.get("closed", True))
    given = locate_control_points(mesh, points, closed)
    verdict = judge(mesh, design, given, closed, arguments.get("order", "given"))
    result.faults += verdict.faults
    return design


def _sound_mesh(generator: np.random.Generator) -> nicmm.Mesh:
    return _sound_meshes()[generator.integers(len(_sound_meshes()))]


@functools.cache
def _sound_meshes() -> tuple[nicmm.Mesh, ...]:
    tetrahedron = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    return (
        shapes.sphere(1),
        shapes.disc(4),
        shapes.torus(around=10, across=6),
        shapes.moebius_strip(12, 3),
        shapes.annulus(3),
        nicmm.Mesh(tetrahedron, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]),
        nicmm.Mesh(tetrahedron, [[0, 1, 2]]),
        nicmm.Mesh(tetrahedron, [[0, 1, 2], [1, 0, 3]]),
    )


def _any_mesh(generator: np.random.Generator) -> nicmm.Mesh:
    return _sound_mesh(generator) if generator.random() < 0.7 else _defective_mesh(generator)


def _defective_mesh(generator: np.random.Generator) -> nicmm.Mesh:
    """A sound mesh with one to three kinds of defects."""
    mesh = _sound_mesh(generator)
    vertices, faces = mesh.vertices.copy(), mesh.faces.copy()
    for _ in range(generator.integers(1, 4)):
        vertices, faces = _DEFECTS[generator.integers(len(_DEFECTS))](generator, vertices, faces)
    return nicmm.Mesh(vertices, faces)


Defect = Callable[[np.random.Generator, FloatArray, IntArray], tuple[FloatArray, IntArray]]


def _holes(
    generator: np.random.Generator, vertices: FloatArray, faces: IntArray
) -> tuple[FloatArray, IntArray]:
    kept = generator.random(len(faces)) < generator.uniform(0.3, 1.0)
    kept[0] = True
    return vertices, faces[kept]


def _turned_over(
    generator: np.random.Generator, vertices: FloatArray, faces: IntArray
) -> tuple[FloatArray, IntArray]:
    turned = generator.random((len(faces), 1)) < 0.3
    return vertices, np.where(turned, faces[:, ::-1], faces)


def _duplicate_faces(
    generator: np.random.Generator, vertices: FloatArray, faces: IntArray
) -> tuple[FloatArray, IntArray]:
    again = faces[generator.integers(len(faces), size=generator.integers(1, 5))]
    return vertices, np.concatenate([faces, again[:, generator.permutation(3)]])


def _fins(
    generator: np.random.Generator, vertices: FloatArray, faces: IntArray
) -> tuple[FloatArray, IntArray]:
    """Extra faces between random vertices, which give edges with three and more faces."""
    count = generator.integers(1, 5)
    fins = [generator.choice(np.unique(faces), 3, replace=False) for _ in range(count)]
    return vertices, np.concatenate([faces, fins])


def _without_area(
    generator: np.random.Generator, vertices: FloatArray, faces: IntArray
) -> tuple[FloatArray, IntArray]:
    """Corners moved onto another corner or onto the opposite edge."""
    vertices = vertices.copy()
    for face in faces[generator.integers(len(faces), size=generator.integers(1, 5))]:
        a, b, c = generator.permutation(face)
        along = _chosen(generator, (0.0, 0.5, generator.random()))
        vertices[a] = (1.0 - along) * vertices[b] + along * vertices[c]
    return vertices, faces


def _soup(
    generator: np.random.Generator, vertices: FloatArray, faces: IntArray
) -> tuple[FloatArray, IntArray]:
    """Some faces with separate copies of their vertices."""
    faces = faces.copy()
    for face in generator.integers(len(faces), size=generator.integers(1, len(faces) + 1)):
        vertices = np.concatenate([vertices, vertices[faces[face]]])
        faces[face] = len(vertices) - np.arange(3, 0, -1)
    return vertices, faces


def _noise(
    generator: np.random.Generator, vertices: FloatArray, faces: IntArray
) -> tuple[FloatArray, IntArray]:
    size = 10.0 ** generator.uniform(-12, 0)
    return vertices + size * generator.standard_normal(vertices.shape), faces


def _flattened(
    generator: np.random.Generator, vertices: FloatArray, faces: IntArray
) -> tuple[FloatArray, IntArray]:
    """Mesh scaled down along one or two axes, sometimes to zero."""
    factors = 10.0 ** generator.uniform(-18, 0, size=3)
    factors[generator.integers(3)] = 1.0
    return vertices * np.where(generator.random(3) < 0.1, 0.0, factors), faces


def _resized(
    generator: np.random.Generator, vertices: FloatArray, faces: IntArray
) -> tuple[FloatArray, IntArray]:
    exponent = _chosen(generator, (-300, -160, -100, -20, -6, 6, 20, 100, 150, 300))
    with np.errstate(over="ignore"):
        return vertices * 10.0**exponent, faces


def _far_away(
    generator: np.random.Generator, vertices: FloatArray, faces: IntArray
) -> tuple[FloatArray, IntArray]:
    return vertices + 10.0 ** generator.uniform(0, 17), faces


def _components(
    generator: np.random.Generator, vertices: FloatArray, faces: IntArray
) -> tuple[FloatArray, IntArray]:
    """A second copy of the mesh, at a distance or in the same place, possibly sharing a vertex."""
    shift = _chosen(generator, (0.0, 3.0, 1e-9))
    second = faces + len(vertices)
    if generator.random() < 0.5:
        second = np.where(second == second[0, 0], faces[0, 0], second)
    return np.concatenate([vertices, vertices + shift]), np.concatenate([faces, second])


def _loose_vertices(
    generator: np.random.Generator, vertices: FloatArray, faces: IntArray
) -> tuple[FloatArray, IntArray]:
    loose = _chosen(generator, (0.0, 1e30, 1e300)) * np.ones((2, 3))
    return np.concatenate([loose, vertices]), faces + 2


def _random_faces(
    generator: np.random.Generator, vertices: FloatArray, faces: IntArray
) -> tuple[FloatArray, IntArray]:
    count = min(len(vertices), int(generator.integers(3, 12)))
    chosen = [generator.choice(count, 3, replace=False) for _ in range(generator.integers(1, 40))]
    return vertices, np.array(chosen)


def _snapped(
    generator: np.random.Generator, vertices: FloatArray, faces: IntArray
) -> tuple[FloatArray, IntArray]:
    """Positions snapped to a coarse grid: coinciding, collinear and coplanar vertices."""
    step = generator.uniform(0.1, 1.0) * max(float(np.ptp(vertices)), 1e-300)
    return np.round(vertices / step) * step, faces


_DEFECTS: tuple[Defect, ...] = (
    _holes,
    _turned_over,
    _duplicate_faces,
    _fins,
    _without_area,
    _soup,
    _noise,
    _flattened,
    _resized,
    _far_away,
    _components,
    _loose_vertices,
    _random_faces,
    _snapped,
)


def _vertices_of_one_component(generator: np.random.Generator, mesh: nicmm.Mesh) -> IntArray:
    component = mesh.face_component == mesh.face_component[generator.integers(len(mesh.faces))]
    vertices = np.unique(mesh.faces[component])
    return generator.choice(vertices, min(int(generator.integers(2, 7)), len(vertices)), False)


def _some_arguments(
    generator: np.random.Generator, mesh: nicmm.Mesh, n_points: int
) -> dict[str, Any]:
    """Valid arguments."""
    arguments: dict[str, Any] = {
        "closed": bool(generator.integers(2)),
        "order": _chosen(generator, ("given", "shortest")),
        "method": _chosen(generator, METHODS),
    }
    if generator.random() < 0.2:
        arguments["smoothness"] = _chosen(generator, (1e-3, 0.1, 10.0, 1e3))
    for name in ("obstacles", "alignment"):
        if generator.random() < 0.15:
            arguments[name] = generator.random(len(mesh.vertices))
    if generator.random() < 0.1 and n_points > 2:
        arguments["order"] = "given"
        arguments["via_points"] = {0: generator.choice(np.unique(mesh.faces), 1)}
    return arguments


def _hostile_points(generator: np.random.Generator, mesh: nicmm.Mesh) -> Any:
    corners = np.unique(mesh.faces)
    count = int(generator.integers(1, 6))
    faces = generator.integers(len(mesh.faces), size=count)
    barycentric = generator.dirichlet(np.ones(3), size=count)
    match generator.integers(13):
        case 0:
            return _object(generator)
        case 1:
            return _spoiled(generator, generator.choice(corners, count), INDICES)
        case 2:
            return np.full(count, corners[0])
        case 3:
            return generator.choice(corners, 1)
        case 4:  # many points for so few faces; more would only take longer
            return generator.choice(corners, min(len(corners), MANY), replace=False)
        case 5:
            return generator.integers(len(mesh.vertices), size=10_000)
        case 6:  # neighbours
            return mesh.faces[generator.integers(len(mesh.faces))]
        case 7:
            points = nicmm.SurfacePoints(faces, barycentric).positions(mesh)
            return _spoiled(generator, points, NUMBERS)
        case 8:
            return nicmm.SurfacePoints(faces, _spoiled(generator, barycentric, NUMBERS))
        case 9:
            return nicmm.SurfacePoints(_spoiled(generator, faces, INDICES), barycentric)
        case 10:  # close to one another, to edges and to corners
            size = 10.0 ** generator.uniform(-16, -1, size=(count, 2))
            near = np.stack([1.0 - size.sum(axis=1), *size.T], axis=1)
            same = np.full(count, faces[0])
            return nicmm.SurfacePoints(_chosen(generator, (same, faces)), near)
        case 11:
            return _cast(generator, generator.choice(corners, count))
        case _:
            return nicmm.SurfacePoints(_object(generator), _object(generator))


def _hostile_map(generator: np.random.Generator, mesh: nicmm.Mesh) -> Any:
    count = len(mesh.vertices)
    match generator.integers(6):
        case 0:
            return _object(generator)
        case 1:
            return np.full(count, _chosen(generator, NUMBERS))
        case 2:
            return _spoiled(generator, generator.random(count), NUMBERS)
        case 3:  # blocks the whole surface
            return np.ones(count)
        case 4:
            return _cast(generator, np.ones(count))
        case _:
            return (generator.random(count) < 0.5).astype(float)


def _hostile_via(generator: np.random.Generator, mesh: nicmm.Mesh) -> Any:
    if generator.random() < 0.3:
        return _object(generator)
    keys = (0, 1, 2, -1, 100, None, "0", 1.0, True, np.int64(1), (0, 1))
    via = {}
    for _ in range(generator.integers(1, 3)):
        points = _hostile_points(generator, mesh)
        if generator.random() < 0.5:
            points = generator.integers(len(mesh.vertices), size=2)
        via[_chosen(generator, keys)] = points
    return via


def _hostile_progress(generator: np.random.Generator) -> Any:
    def raises(fraction: float, points: FloatArray) -> object:
        raise CallersError

    def stops(fraction: float, points: FloatArray) -> object:
        return False

    def changes(fraction: float, points: FloatArray) -> object:
        points *= np.nan
        return points

    return _chosen(generator, (raises, stops, changes))


def _object(generator: np.random.Generator) -> Any:
    return _chosen(generator, OBJECTS)


def _chosen(generator: np.random.Generator, values: Sequence[Any]) -> Any:
    return values[generator.integers(len(values))]


def _spoiled(generator: np.random.Generator, values: Any, replacements: Sequence[Any]) -> Any:
    """Array with some entries replaced by some of the values."""
    spoiled = np.array(values)
    if spoiled.size == 0 or spoiled.dtype.kind not in "if":
        return spoiled
    places = generator.integers(spoiled.size, size=generator.integers(1, 4))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        values = np.array([_chosen(generator, replacements) for _ in places])
        spoiled.flat[places] = values.astype(spoiled.dtype)
    return spoiled


def _cast(generator: np.random.Generator, values: Any) -> Any:
    """The same values with another type, shape or memory order."""
    array = np.asarray(values)
    if array.dtype.kind not in "if":
        return array
    types = (np.float16, np.float32, np.int8, np.uint8, np.int32, np.uint64, object, str, complex)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        match generator.integers(6):
            case 0:
                return array.T
            case 1:
                return array[None]
            case 2:
                return array.ravel()
            case 3:
                return np.asfortranarray(array)[::-1]
            case 4:
                return array.tolist()
            case _:
                return array.astype(_chosen(generator, types))


def _mutated(generator: np.random.Generator, data: bytes, within: int | None = None) -> bytes:
    """Data with bytes changed, removed, repeated or inserted, optionally near the beginning."""
    for _ in range(generator.integers(1, 4)):
        end = max(1, min(len(data), within or len(data)))
        if within is None and generator.random() < 0.5:
            end = min(end, 300)
        place = int(generator.integers(end))
        match generator.integers(7):
            case 0:
                data = data[:place]
            case 1:
                data = data[:place] + bytes([generator.integers(256)]) + data[place + 1 :]
            case 2:
                data = data[:place] + bytes([generator.integers(256)]) + data[place:]
            case 3:
                data = data[:place] + data[place + int(generator.integers(1, 20)) :]
            case 4:
                data = data[:place] + data[max(0, place - 50) :]
            case 5:
                data = data[:place] + generator.bytes(int(generator.integers(1, 40))) + data[place:]
            case _:
                data = data[:place] + _chosen(generator, _WORDS) + data[place:]
    return data


_WORDS = (
    b" ", b"\n", b"\0", b"-", b"9999999999", b"nan", b"inf", b"1e999", b"-1", b"/", b"#", b"\\\n",
    b"\nf 1 2 3 4 5 6 7\n", b"\nv\n", b"\nf\n", b"4294967295", b"element vertex 1000000000\n",
    b"property list uchar int x\n", b"end_header\n", b"solid", b"\r", b"\xff\xfe", b"OFF\n",
)  # fmt: skip


def _ply_as_text(mesh: nicmm.Mesh) -> bytes:
    lines = ["ply", "format ascii 1.0", f"element vertex {len(mesh.vertices)}"]
    lines += [f"property double {axis}" for axis in "xyz"]
    lines += [f"element face {len(mesh.faces)}", "property list uchar int vertex_indices"]
    lines += ["end_header", *(f"{x!r} {y!r} {z!r}" for x, y, z in mesh.vertices.tolist())]
    lines += [f"3 {a} {b} {c}" for a, b, c in mesh.faces.tolist()]
    return "\n".join([*lines, ""]).encode()


def _stl_as_text(mesh: nicmm.Mesh) -> bytes:
    lines = ["solid mesh"]
    for corners in mesh.vertices[mesh.faces].tolist():
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += [f"vertex {x!r} {y!r} {z!r}" for x, y, z in corners]
        lines += ["endloop", "endfacet"]
    return "\n".join([*lines, "endsolid mesh", ""]).encode()


@functools.cache
def _weights_members() -> dict[str, bytes]:
    with zipfile.ZipFile(SHIPPED) as archive:
        return {member.filename: archive.read(member) for member in archive.infolist()}


@functools.cache
def _a_curve() -> nicmm.SurfaceCurve:
    return nicmm.design_curve(shapes.sphere(2), [3, 60, 100]).curves[0]
