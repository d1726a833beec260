"""The door of the compiled kernels: what does not fit raises an error, and crashes nothing."""

import pickle
import subprocess
import sys

import nicmm_kernels
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from nicmm_kernels import KernelError

import build
from nicmm_core import shapes

BALL = shapes.sphere(2)
LIMITS = nicmm_kernels.TraceLimits(1e-6, 4096)
BAD_NUMBERS = st.sampled_from([np.nan, np.inf, -np.inf])
BAD_INDICES = st.integers(-(2**62), 2**62).filter(lambda i: not 0 <= i < len(BALL.faces))


def nothing():
    pass


def arguments_from(m=4):
    """Arguments of `trace_from` for m points, by name."""
    return {
        "mesh": BALL.for_kernels,
        "faces": np.arange(m),
        "barycentric": np.full((m, 3), 1.0 / 3.0),
        "directions": np.cross(BALL.face_normals[:m], [0.1, 0.2, 0.3]),
        "lengths": np.full(m, 0.5),
        "folded": np.zeros(len(BALL.faces), dtype=bool),
        "limits": LIMITS,
        "meanwhile": nothing,
    }


def arguments_between(m=4):
    """Arguments of `trace_between` for m pairs of points, by name."""
    third = np.full((m, 3), 1.0 / 3.0)
    return {
        "mesh": BALL.for_kernels,
        "starts": (np.arange(m), third),
        "ends": (np.arange(m) + 7, third.copy()),
        "normals": BALL.face_normals[:m].copy(),
        "longest": np.full(m, 5.0),
        "folded": np.zeros(len(BALL.faces), dtype=bool),
        "fold_margin": 0.1,
        "ahead": None,
        "most_faces": 4096,
        "meanwhile": nothing,
    }


CALLS = {
    "trace_from": (nicmm_kernels.trace_from, arguments_from),
    "trace_between": (nicmm_kernels.trace_between, arguments_between),
}


def arrays_in(given):
    """Names of the arrays among arguments; those in tuples also have a number."""
    for name, value in given.items():
        if isinstance(value, np.ndarray):
            yield name, None
        if isinstance(value, tuple):
            yield from ((name, number) for number in range(len(value)))


def replaced(given, place, change):
    """Arguments with one array replaced by a function of it."""
    name, number = place
    value = given[name]
    if number is not None:
        changed = list(value)
        changed[number] = change(changed[number])
        return {**given, name: tuple(changed)}
    return {**given, name: change(value)}


PLACES = [
    (name, place) for name, (_, arguments) in CALLS.items() for place in arrays_in(arguments())
]


@pytest.mark.parametrize("name", CALLS)
def test_the_arguments_of_these_tests_are_valid(name):
    function, arguments = CALLS[name]
    function(**arguments())


def array_at(given, place):
    name, number = place
    return given[name] if number is None else given[name][number]


@pytest.mark.parametrize(("name", "place"), PLACES)
def test_arrays_that_do_not_fit_are_refused(name, place):
    function, arguments = CALLS[name]
    given = arguments()
    array = array_at(given, place)
    other_type = np.float32 if array.dtype == np.float64 else np.int32
    for changed, message in (
        (array.astype(other_type), f"type {np.dtype(other_type)}; pass"),
        (array[:-1], "shape .*; pass"),
        (array[..., None], "shape .*; pass"),
        (np.repeat(array, 2, axis=0)[::2], "strides .*; pass"),
        (array[::-1], "strides .*; pass"),
        (array.tolist(), "is list; pass an array"),
    ):
        with pytest.raises(KernelError, match=message):
            function(**replaced(given, place, lambda array, changed=changed: changed))


@given(st.sampled_from(sorted(CALLS)), st.data())
def test_numbers_that_are_not_finite_are_refused(name, data):
    function, arguments = CALLS[name]
    given = arguments()
    floats = [
        place
        for place in arrays_in(given)
        if array_at(given, place).dtype == np.float64
        and place[0] != "longest"  # a trace may have any length
    ]
    place = data.draw(st.sampled_from(floats))

    def spoilt(array):
        array = array.copy()
        array.flat[data.draw(st.integers(0, array.size - 1))] = data.draw(BAD_NUMBERS)
        return array

    with pytest.raises(KernelError, match="NaN or infinite"):
        function(**replaced(given, place, spoilt))


@given(st.sampled_from(sorted(CALLS)), BAD_INDICES, st.integers(0, 3), st.booleans())
def test_faces_that_do_not_exist_are_refused(name, index, row, at_end):
    function, arguments = CALLS[name]
    place = {"trace_from": ("faces", None), "trace_between": ("ends" if at_end else "starts", 0)}

    def spoilt(faces):
        faces = faces.copy()
        faces[row] = index
        return faces

    with pytest.raises(KernelError, match="index is out of range"):
        function(**replaced(arguments(), place[name], spoilt))


@given(st.sampled_from(sorted(CALLS)), BAD_INDICES, st.booleans(), st.integers(0, 10**6))
def test_meshes_with_wrong_indices_crash_nothing(name, index, in_faces, at):
    """Only the indices that are used are checked, so a trace elsewhere may succeed."""
    function, arguments = CALLS[name]
    faces, opposite = BALL.faces.copy(), BALL.opposite_sides.copy()
    spoilt = faces.ravel() if in_faces else opposite
    spoilt[at % spoilt.size] = index if index < 0 else index + 3 * len(BALL.faces)
    mesh = nicmm_kernels.MeshArrays(BALL.vertices, faces, BALL.face_normals, opposite, True)
    given = {**arguments(8), "mesh": mesh}
    try:
        function(**given)
    except KernelError as error:
        assert "index is out of range" in str(error)


@given(st.sampled_from(sorted(CALLS)), st.integers(0, 2**32 - 1))
def test_meshes_with_arbitrary_neighbours_crash_nothing(name, seed):
    function, arguments = CALLS[name]
    rng = np.random.default_rng(seed)
    opposite = rng.integers(0, 3 * len(BALL.faces), 3 * len(BALL.faces))
    oriented = bool(rng.integers(2))
    mesh = nicmm_kernels.MeshArrays(
        BALL.vertices, BALL.faces, BALL.face_normals, opposite, oriented
    )
    function(**{**arguments(8), "mesh": mesh})


@pytest.mark.parametrize(
    ("place", "change"),
    [
        (0, lambda vertices: vertices[:, :2]),
        (1, lambda faces: faces.astype(np.int32)),
        (2, lambda normals: normals[:-1]),
        (3, lambda opposite: opposite.reshape(-1, 3)),
    ],
)
def test_mesh_arrays_that_do_not_fit_are_refused(place, change):
    arrays = [BALL.vertices, BALL.faces, BALL.face_normals, BALL.opposite_sides]
    arrays[place] = change(arrays[place])
    with pytest.raises(KernelError, match="pass"):
        nicmm_kernels.MeshArrays(*arrays, True)


def test_copies_of_a_mesh_have_their_own_pointers():
    copy = pickle.loads(pickle.dumps(BALL.for_kernels))
    assert copy.pointers.vertices != BALL.for_kernels.pointers.vertices
    one, other = (
        nicmm_kernels.trace_from(**{**arguments_from(), "mesh": mesh})
        for mesh in (BALL.for_kernels, copy)
    )
    assert (one[1] == other[1]).all()


@pytest.mark.parametrize("name", CALLS)
def test_calls_of_bounded_work_give_the_same_as_a_single_one(name, monkeypatch):
    function, arguments = CALLS[name]
    whole = function(**arguments(40))
    pauses = []
    monkeypatch.setattr(nicmm_kernels.library, "MOST_WORK", 7)
    parts = function(**{**arguments(40), "meanwhile": lambda: pauses.append(None)})
    assert len(pauses) > 5
    for one, other in zip(whole, parts, strict=True):
        assert np.array_equal(one, other)


def test_crossings_that_do_not_fit_are_found_in_several_calls(monkeypatch):
    whole = nicmm_kernels.trace_between(**arguments_between(40))
    monkeypatch.setattr(nicmm_kernels.library, "CROSSINGS_OF_A_TRACE", 0)
    few = nicmm_kernels.trace_between(**{**arguments_between(40), "most_faces": 30})
    for one, other in zip(whole, few, strict=True):
        assert np.array_equal(one, other)


def test_an_exception_between_two_calls_ends_the_function(monkeypatch):
    monkeypatch.setattr(nicmm_kernels.library, "MOST_WORK", 1)

    def cancel():
        raise InterruptedError

    for function, arguments in CALLS.values():
        with pytest.raises(InterruptedError):
            function(**{**arguments(), "meanwhile": cancel})


def test_no_points_give_no_result():
    assert all(np.size(part) <= 1 for part in nicmm_kernels.trace_from(**arguments_from(0)))
    assert all(len(part) == 0 for part in nicmm_kernels.trace_between(**arguments_between(0)))


def test_missing_library_says_what_to_do(tmp_path):
    script = (
        "import nicmm_core as n, nicmm_core.shapes as s; n.design_curve(s.sphere(2), [0, 9, 50])"
    )
    ran = subprocess.run(
        [sys.executable, "-c", script],
        cwd=build.ROOT,
        env={"PYTHONPATH": "kernels", "NICMM_KERNELS_LIBRARY": str(tmp_path / "none.so")},
        capture_output=True,
        text=True,
        check=False,
    )
    assert "KernelError: The compiled kernels of NICMM Curves for" in ran.stderr
    assert "cannot be loaded" in ran.stderr and "Install the package" in ran.stderr


def test_the_library_is_that_of_the_present_sources():
    stamp = build.KERNELS / "nicmm_kernels" / "compiled.sha256"
    ran = subprocess.run(
        [
            sys.executable,
            "-c",
            "import compile_library as c; print(c.fingerprint(c.this_platform()))",
        ],
        cwd=build.KERNELS,
        capture_output=True,
        text=True,
        check=True,
    )
    assert stamp.read_text() == ran.stdout.strip(), "run python3 build.py test to compile it"
