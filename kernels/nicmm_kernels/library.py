# SPDX-License-Identifier: GPL-3.0-or-later
"""Loads the library, and checks everything that is passed to it.

The library trusts the sizes that it is given, so they are all derived from the arrays here, and
nothing else in the project calls it. It checks every index before it uses it.

A call may not take long, since other code has to look after progress and cancelling. So a function
whose work has no small bound stops after a certain amount of it, and is called again until all is
done; in between, it calls a function of the caller.
"""

from __future__ import annotations

import ctypes
import os
import platform
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

MOST_WORK = 500_000
"""Number of faces that a call may cross before it returns, which takes some 0.03 s."""

LIBRARY_VARIABLE = "NICMM_KERNELS_LIBRARY"
"""Environment variable with the path of another library, such as one that checks itself."""

_FILES = {"win32": "nicmm_kernels.dll", "darwin": "libnicmm_kernels.dylib"}
_TOO_SMALL = 2
_ERRORS = {
    1: "an index is out of range",
    _TOO_SMALL: "an array is too small",
    3: "a value is NaN or infinite",
    4: "a matrix is not positive definite",
}
_FLOAT, _INT, _BOOL = np.dtype(np.float64), np.dtype(np.int64), np.dtype(np.bool_)
_POINTER, _COUNT, _NUMBER = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double


class KernelError(RuntimeError):
    """A kernel is not installed, or was given data that it cannot use."""


# The library


@cache
def _library() -> ctypes.CDLL:
    given = os.environ.get(LIBRARY_VARIABLE)
    file = _FILES.get(sys.platform, "libnicmm_kernels.so")
    path = Path(given) if given else Path(__file__).resolve().with_name(file)
    try:
        library = ctypes.CDLL(str(path))
    except OSError as error:
        raise KernelError(
            f"The compiled kernels of NICMM Curves for {platform.system()} on "
            f"{platform.machine()} cannot be loaded from {path} ({error}). Install the package "
            "for this platform; in a copy of the sources, run: python3 build.py test --quick"
        ) from error
    reference = ctypes.POINTER
    library.trace_from.argtypes = [
        reference(_Mesh), _POINTER, reference(TraceLimits), _COUNT, *[_POINTER] * 5,
        reference(_COUNT), _COUNT, reference(_COUNT),
    ]  # fmt: skip
    library.even_arcs.argtypes = [reference(SpacingRules), *[_COUNT] * 4, *[_POINTER] * 6]
    library.relaxation_items.argtypes = [_COUNT, _COUNT]
    library.relaxation_items.restype = _COUNT
    library.relax_curves.argtypes = [
        reference(_Surface), reference(RelaxationRules), reference(_CurveBatch), _COUNT, _POINTER,
        _COUNT, _COUNT,
    ]  # fmt: skip
    library.trace_between.argtypes = [
        reference(_Mesh), _POINTER, _COUNT, _COUNT, reference(_TracePairs), reference(_Crossings),
        _COUNT, reference(_COUNT),
    ]  # fmt: skip
    return library


def _check(code: int, name: str) -> None:
    if code:
        raise KernelError(f"{name}: {_ERRORS.get(code, f'unknown error {code}')}")


# Arrays


def _address(name: str, array: Any, dtype: np.dtype[Any], *shape: int) -> int:
    """The address of an array, which has to have this type and shape and to be contiguous."""
    if not isinstance(array, np.ndarray):
        raise KernelError(f"{name} is {type(array).__name__}; pass an array")
    if array.dtype != dtype:
        raise KernelError(f"{name} has type {array.dtype}; pass {dtype}")
    if array.shape != shape:
        raise KernelError(f"{name} has shape {array.shape}; pass {shape}")
    if not array.flags.c_contiguous:
        raise KernelError(f"{name} has strides {array.strides}; pass a contiguous array")
    return array.ctypes.data


def _optional(name: str, array: Any, dtype: np.dtype[Any], *shape: int) -> int | None:
    return None if array is None else _address(name, array, dtype, *shape)


def _rows(name: str, array: Any) -> int:
    """Length of the first axis of an array, from which other shapes follow."""
    if not isinstance(array, np.ndarray) or array.ndim == 0:
        raise KernelError(f"{name} is {type(array).__name__}; pass an array")
    return len(array)


# The mesh


class _Mesh(ctypes.Structure):
    _fields_ = [
        ("vertices", _POINTER),
        ("faces", _POINTER),
        ("face_normals", _POINTER),
        ("opposite_sides", _POINTER),
        ("vertex_count", _COUNT),
        ("face_count", _COUNT),
        ("is_oriented", _COUNT),
    ]


class MeshArrays:
    """The arrays of a mesh, checked once for all calls. They must not change afterwards.

    Parameters
    ----------
    vertices : (V, 3) float array
        Positions.
    faces : (F, 3) int array
        Vertices of each face.
    face_normals : (F, 3) float array
        Unit vectors; zero where a face has no area.
    opposite_sides : (3 F,) int array
        For side 3 f + j, opposite corner j of face f, the same edge as a side of the adjacent face;
        the side itself where there is none, or more than one.
    is_oriented : bool
        Whether no two faces traverse an edge in the same direction.
    """

    def __init__(
        self,
        vertices: FloatArray,
        faces: IntArray,
        face_normals: FloatArray,
        opposite_sides: IntArray,
        is_oriented: bool,
    ) -> None:
        self.vertex_count = _rows("vertices", vertices)
        self.face_count = _rows("faces", faces)
        self._given = (vertices, faces, face_normals, opposite_sides, is_oriented)
        self.pointers = _Mesh(
            _address("vertices", vertices, _FLOAT, self.vertex_count, 3),
            _address("faces", faces, _INT, self.face_count, 3),
            _address("face_normals", face_normals, _FLOAT, self.face_count, 3),
            _address("opposite_sides", opposite_sides, _INT, 3 * self.face_count),
            self.vertex_count,
            self.face_count,
            int(is_oriented),
        )

    def __reduce__(self) -> tuple[Any, ...]:
        """Copies have pointers of their own."""
        return MeshArrays, self._given


# Traces


class TraceLimits(ctypes.Structure):
    """Limits of traces.

    Parameters
    ----------
    least_inside : float
        Least barycentric coordinate of a point strictly inside its face.
    most_faces : int
        Number of faces after which a trace ends.
    """

    _fields_ = [("least_inside", _NUMBER), ("most_faces", _COUNT)]


def trace_from(
    mesh: MeshArrays,
    faces: IntArray,
    barycentric: FloatArray,
    directions: FloatArray,
    lengths: FloatArray,
    folded: BoolArray | None,
    limits: TraceLimits,
    meanwhile: Callable[[], object],
) -> tuple[IntArray, FloatArray, BoolArray, int]:
    """Move m points straight along the surface.

    Parameters
    ----------
    mesh : MeshArrays
    faces : (m,) int array
        Faces of the points.
    barycentric : (m, 3) float array
        Coordinates in them, all of them positive.
    directions : (m, 3) float array
        Unit vectors, nearly tangent to the faces.
    lengths : (m,) float array
        Distances to move, in mesh units; not negative.
    folded : (F,) bool array or None
        Faces over which traces run backward.
    limits : TraceLimits
    meanwhile : callable
        Called after every `MOST_WORK` faces.

    Returns
    -------
    (m,) int array, (m, 3) float array
        Faces of the moved points and coordinates in them.
    (m,) bool array
        Whether each point stopped at a boundary or a non-manifold edge.
    int
        Greatest number of faces that a point passed.
    """
    m = _rows("faces", faces)
    _address("faces", faces, _INT, m)
    _address("barycentric", barycentric, _FLOAT, m, 3)
    faces, barycentric, blocked = faces.copy(), barycentric.copy(), np.zeros(m, dtype=np.bool_)
    done, most_passed = _COUNT(0), _COUNT(0)
    arguments = (
        mesh.pointers, _optional("folded", folded, _BOOL, mesh.face_count), limits, m,
        faces.ctypes.data, barycentric.ctypes.data,
        _address("directions", directions, _FLOAT, m, 3), _address("lengths", lengths, _FLOAT, m),
        blocked.ctypes.data, most_passed, MOST_WORK, done,
    )  # fmt: skip
    while done.value < m:
        if done.value:
            meanwhile()
        _check(_library().trace_from(*arguments), "trace_from")
    return faces, barycentric, blocked, most_passed.value


class _TracePairs(ctypes.Structure):
    _fields_ = [
        ("start_faces", _POINTER),
        ("starts", _POINTER),
        ("end_faces", _POINTER),
        ("ends", _POINTER),
        ("normals", _POINTER),
        ("ahead", _POINTER),
        ("longest", _POINTER),
        ("fold_margin", _NUMBER),
        ("reached", _POINTER),
        ("crossing_counts", _POINTER),
    ]


class _Crossings(ctypes.Structure):
    _fields_ = [("room", _COUNT), ("count", _COUNT), ("faces", _POINTER), ("barycentric", _POINTER)]


CROSSINGS_OF_A_TRACE = 8
"""Number of crossings for which there is room for each trace; where it is not enough, traces are
found in several calls."""


def trace_between(
    mesh: MeshArrays,
    starts: tuple[IntArray, FloatArray],
    ends: tuple[IntArray, FloatArray],
    normals: FloatArray,
    longest: FloatArray,
    folded: BoolArray | None,
    fold_margin: float,
    ahead: FloatArray | None,
    most_faces: int,
    meanwhile: Callable[[], object],
) -> tuple[BoolArray, IntArray, IntArray, FloatArray]:
    """Trace between m pairs of points.

    Parameters
    ----------
    mesh : MeshArrays
    starts, ends : tuple of (m,) int array and (m, 3) float array
        Faces of the points and barycentric coordinates in them; those of starts are positive.
    normals : (m, 3) float array
        Vectors in the planes of the traces, besides those from the starts to the ends.
    longest : (m,) float array
        Greatest lengths up to the faces of the ends, in mesh units.
    folded : (F,) bool array or None
        Faces over which the length of traces counts as negative.
    fold_margin : float
        Additional length, in mesh units, before such parts are subtracted.
    ahead : (m, 3) float array or None
        Directions in which the traces leave their starts; by default those to the ends.
    most_faces : int
        Number of faces after which a trace ends.
    meanwhile : callable
        Called between two calls of the kernel, at least after every `MOST_WORK` faces.

    Returns
    -------
    (m,) bool array
        Whether each trace reached its end.
    (m,) int array
        Number of crossings of each trace with edges; 0 if it did not reach its end.
    (q,) int array, (q, 3) float array
        The crossings in order: the face that is entered, and barycentric coordinates in it.
    """
    m = _rows("longest", longest)
    room = most_faces + CROSSINGS_OF_A_TRACE * m
    reached, counts = np.zeros(m, dtype=np.bool_), np.zeros(m, dtype=np.int64)
    pairs = _TracePairs(
        _address("start faces", starts[0], _INT, m), _address("starts", starts[1], _FLOAT, m, 3),
        _address("end faces", ends[0], _INT, m), _address("ends", ends[1], _FLOAT, m, 3),
        _address("normals", normals, _FLOAT, m, 3), _optional("ahead", ahead, _FLOAT, m, 3),
        _address("longest", longest, _FLOAT, m), fold_margin,
        reached.ctypes.data, counts.ctypes.data,
    )  # fmt: skip
    faces, barycentric = np.empty(room, dtype=np.int64), np.empty((room, 3))
    crossings = _Crossings(room, 0, faces.ctypes.data, barycentric.ctypes.data)
    done = _COUNT(0)
    arguments = (
        mesh.pointers, _optional("folded", folded, _BOOL, mesh.face_count), most_faces, m, pairs,
        crossings, MOST_WORK, done,
    )  # fmt: skip
    parts = []
    while done.value < m:
        if done.value:
            meanwhile()
            crossings.count = 0
        _check(_library().trace_between(*arguments), "trace_between")
        parts.append((faces[: crossings.count].copy(), barycentric[: crossings.count].copy()))
    if len(parts) == 1:
        return reached, counts, *parts[0]
    found_faces = np.concatenate([faces[:0], *(part[0] for part in parts)])
    return reached, counts, found_faces, np.concatenate([barycentric[:0], *(p[1] for p in parts)])


# Relaxation


class _Surface(ctypes.Structure):
    _fields_ = [
        ("mesh", _Mesh),
        ("vertex_normals", _POINTER),
        ("folded", _POINTER),
        ("feature_map", _POINTER),
        ("feature_weight", _NUMBER),
    ]


class SurfaceArrays:
    """The arrays of a surface, checked once for all calls. They must not change afterwards.

    Parameters
    ----------
    mesh : MeshArrays
    vertex_normals : (V, 3) float array
        Unit vectors of arbitrary sign.
    folded : (F,) bool array or None
        Faces that are folded back over others.
    feature_map : (V,) float array or None
        φ_fea.
    feature_weight : float
        Factor of the map, in 1/length².
    """

    def __init__(
        self,
        mesh: MeshArrays,
        vertex_normals: FloatArray,
        folded: BoolArray | None,
        feature_map: FloatArray | None,
        feature_weight: float,
    ) -> None:
        self.mesh = mesh
        self._given = (mesh, vertex_normals, folded, feature_map, feature_weight)
        self.pointers = _Surface(
            mesh.pointers,
            _address("vertex_normals", vertex_normals, _FLOAT, mesh.vertex_count, 3),
            _optional("folded", folded, _BOOL, mesh.face_count),
            _optional("feature_map", feature_map, _FLOAT, mesh.vertex_count),
            feature_weight,
        )

    def __reduce__(self) -> tuple[Any, ...]:
        """Copies have pointers of their own."""
        return SurfaceArrays, self._given


class ContactRules(ctypes.Structure):
    """When two nodes of a curve are in contact.

    Parameters
    ----------
    clearance : float
        Distance below which strands repel, in mean distances between neighbouring nodes.
    different_strands : float
        Distance along the curve, in clearances, above which nodes belong to different strands.
    same_side : float
        Least cosine between the normals of two nodes in contact.
    rounded : float
        Least mean distance between neighbouring nodes, relative to the greatest coordinate.
    """

    _fields_ = [
        ("clearance", _NUMBER),
        ("different_strands", _NUMBER),
        ("same_side", _NUMBER),
        ("rounded", _NUMBER),
    ]


class SpacingRules(ctypes.Structure):
    """How nodes are spaced.

    Parameters
    ----------
    nodes_per_radian : float
        Additional nodes per radian by which the normals turn.
    short_move : float
        Move below which a node stays, in mean distances between neighbouring nodes.
    """

    _fields_ = [("nodes_per_radian", _NUMBER), ("short_move", _NUMBER)]


def even_arcs(
    normals: FloatArray,
    step_lengths: FloatArray,
    lengths: FloatArray,
    fixed: BoolArray,
    closed: bool,
    times: int,
    rules: SpacingRules,
) -> tuple[FloatArray, FloatArray]:
    """Arc lengths of c curves of n nodes each, and those at which new nodes are even.

    Parameters
    ----------
    normals : (c, n, 3) float array
        Unit normals of the surface at the nodes. New nodes are closer together where they turn.
    step_lengths : (c, n) float array
        Distances from each node to the next; zero at the last node of an open curve.
    lengths : (c, n) float array
        Lengths of the ways from each node to the next, which may be longer.
    fixed : (c, n) bool array
        Nodes that stay. The first one of each curve is one of them.
    closed : bool
        Whether the last node of each curve is joined to its first.
    times : int
        Number of new steps for each step.
    rules : SpacingRules

    Returns
    -------
    (c, n + 1) float array
        Weighted arc lengths at the nodes and at the end of each curve.
    (c, m) float array
        Those of the new nodes. There are m = times n of a closed curve, and times (n - 1) + 1 of an
        open one.
    """
    c, n = _curves("fixed", fixed)
    if times < 1:
        raise KernelError(f"times is {times}; pass a positive number")
    arcs = np.zeros((c, n + 1))
    wanted = np.zeros((c, times * n if closed else times * (n - 1) + 1))
    _check(
        _library().even_arcs(
            rules, c, n, int(closed), times, _address("normals", normals, _FLOAT, c, n, 3),
            _address("step_lengths", step_lengths, _FLOAT, c, n),
            _address("lengths", lengths, _FLOAT, c, n), _first_fixed(fixed, c, n),
            arcs.ctypes.data, wanted.ctypes.data,
        ),
        "even_arcs",
    )  # fmt: skip
    return arcs, wanted


def _curves(name: str, array: Any) -> tuple[int, int]:
    """Number of curves and of nodes of each, from an array with a row for each curve."""
    c = _rows(name, array)
    if array.ndim != 2 or array.shape[1] == 0:
        raise KernelError(f"{name} has shape {array.shape}; pass one row per curve")
    return c, array.shape[1]


def _first_fixed(fixed: BoolArray, c: int, n: int) -> int:
    """The address of the marks of fixed nodes, (c, n), which include the first of each curve."""
    address = _address("fixed", fixed, _BOOL, c, n)
    if not fixed[:, 0].all():
        raise KernelError("fixed is False at the first node of a curve; it must not move")
    return address


class EnergyRules(ctypes.Structure):
    """How the terms of the energy are balanced.

    Parameters
    ----------
    smoothness : float
        Divisor of the tension and of the weight of a map.
    over_tension : float
        Multiple of the tension that is added to the weight of a map.
    contact : float
        Contact energy of a curve whose strands touch everywhere, relative to its energy without
        maps; 0 if strands may cross.
    shortest : float
        Least length of a step by which the tension is divided, in mesh units.
    """

    _fields_ = [
        ("smoothness", _NUMBER),
        ("over_tension", _NUMBER),
        ("contact", _NUMBER),
        ("shortest", _NUMBER),
    ]


class StepRules(ctypes.Structure):
    """How many steps are taken, and how far they go.

    Lengths are in mean distances between neighbouring nodes.

    Parameters
    ----------
    iterations : int
        Greatest number of steps.
    respacing : int
        Number of steps from one respacing of the nodes to the next.
    quiet : int
        Number of consecutive quiet steps after which a curve has converged.
    least_decrease : float
        Relative decrease of the energy up to which a step counts as quiet, if no node has moved by
        more than half of `longest_move` either.
    longest_move : float
        Trust radius of the linearised energy.
    least_damping, most_damping : float
        Damping of the first step and its lower bound, and the damping above which a curve stays.
    damping_factor : float
        Factor by which damping rises after a failed step and falls after a successful one.
    """

    _fields_ = [
        ("iterations", _COUNT),
        ("respacing", _COUNT),
        ("quiet", _COUNT),
        ("least_decrease", _NUMBER),
        ("longest_move", _NUMBER),
        ("least_damping", _NUMBER),
        ("most_damping", _NUMBER),
        ("damping_factor", _NUMBER),
    ]


class RelaxationRules(ctypes.Structure):
    """All rules of a relaxation.

    Parameters
    ----------
    traces : TraceLimits
    contact : ContactRules
    spacing : SpacingRules
    energy : EnergyRules
    steps : StepRules
    """

    _fields_ = [
        ("traces", TraceLimits),
        ("contact", ContactRules),
        ("spacing", SpacingRules),
        ("energy", EnergyRules),
        ("steps", StepRules),
    ]


class _CurveBatch(ctypes.Structure):
    _fields_ = [
        ("c", _COUNT),
        ("n", _COUNT),
        ("closed", _COUNT),
        ("faces", _POINTER),
        ("barycentric", _POINTER),
        ("fixed", _POINTER),
        ("iterations", _POINTER),
        ("quiet", _POINTER),
        ("dampings", _POINTER),
    ]


PAIRS_OF_A_NODE = 8
"""Number of close nodes for which there is room at first; there is more room when it is needed."""


def relax_curves(
    surface: SurfaceArrays,
    faces: IntArray,
    barycentric: FloatArray,
    fixed: BoolArray,
    closed: bool,
    rules: RelaxationRules,
    meanwhile: Callable[[], object],
) -> tuple[IntArray, FloatArray]:
    """Relax c curves of n nodes each; every curve is relaxed on its own.

    Parameters
    ----------
    surface : SurfaceArrays
    faces : (c, n) int array
        Faces of the nodes.
    barycentric : (c, n, 3) float array
        Coordinates in them.
    fixed : (c, n) bool array
        Nodes that do not move. The first one of each curve is one of them.
    closed : bool
        Whether the last node of each curve is joined to its first.
    rules : RelaxationRules
    meanwhile : callable
        Called after every `MOST_WORK` faces, or the time of as many.

    Returns
    -------
    (c, n) int array, (c, n, 3) float array
        Faces of the relaxed nodes and coordinates in them.
    """
    c, n = _curves("faces", faces)
    _address("faces", faces, _INT, c, n)
    _address("barycentric", barycentric, _FLOAT, c, n, 3)
    of_fixed = _first_fixed(fixed, c, n)
    faces, barycentric = faces.copy(), barycentric.copy()
    iterations, quiet = np.zeros(c, dtype=np.int64), np.zeros(c, dtype=np.int64)
    dampings = np.full(c, rules.steps.least_damping)
    curves = _CurveBatch(
        c, n, int(closed), faces.ctypes.data, barycentric.ctypes.data, of_fixed,
        iterations.ctypes.data, quiet.ctypes.data, dampings.ctypes.data,
    )  # fmt: skip
    library, room, started = _library(), PAIRS_OF_A_NODE * n, False
    while (iterations < rules.steps.iterations).any():
        if started:
            meanwhile()
        started = True
        items = library.relaxation_items(n, room)
        scratch = np.empty(items)
        code = library.relax_curves(
            surface.pointers, rules, curves, room, scratch.ctypes.data, items, MOST_WORK
        )
        if code == _TOO_SMALL and room < n * n:
            room = max(4 * room, n)
        else:
            _check(code, "relax_curves")
    return faces, barycentric
