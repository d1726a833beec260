"""Computes closed curves with other systems, in a separate process because some of them can crash.

Each function takes a task, which contains the surface, the control points in visiting order and a
path of edges through them. It returns polylines and the time of the system in seconds, including
its preparation. None of these packages is a dependency of the project; systems whose package is
not installed are left out.
"""

from __future__ import annotations

import importlib
import multiprocessing
import time
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import cast

import numpy as np

from nicmm_core.geometry.array_types import FloatArray, IntArray
from nicmm_core.geometry.mesh import Mesh
from nicmm_core.geometry.surface_points import locate_control_points
from nicmm_core.paper.problem import build_problem


@dataclass(frozen=True)
class Task:
    """Input of a system: a surface, and control points on it.

    Attributes
    ----------
    vertices : (n, 3) float array
        Vertex positions.
    faces : (m, 3) int array
        Vertex indices of the triangles.
    path : (l,) int array
        Vertices of a closed path of edges through the control points.
    controls : (k,) int array
        Vertices of the control points, in visiting order.
    spacing : float
        Mean edge length of the mesh, for systems that need a sampling step.
    """

    vertices: FloatArray
    faces: IntArray
    path: IntArray
    controls: IntArray
    spacing: float


def task_on(mesh: Mesh, points: IntArray) -> Task:
    """Task for other systems: a closed curve through vertices, in the shortest order."""
    problem = build_problem(mesh, locate_control_points(mesh, points, True), "shortest")
    working, loop = problem.working, problem.loop
    return Task(
        working.vertices,
        working.faces,
        loop.vertices,
        loop.control_vertices,
        mesh.mean_edge_length,
    )


Answer = tuple[list[FloatArray], float]
"""Polylines, without a repeated first point where they are closed, and the time in seconds."""


def meshlib_spline(task: Task) -> Answer:
    """MeshLib: a spline through the points in space, projected to the mesh."""
    mrmeshpy = importlib.import_module("meshlib.mrmeshpy")
    mrmeshnumpy = importlib.import_module("meshlib.mrmeshnumpy")
    started = time.perf_counter()
    mesh = mrmeshnumpy.meshFromFacesVerts(task.faces.astype(np.int32), task.vertices)
    points = mrmeshpy.std_vector_Vector3_float()
    for place in task.vertices[np.append(task.controls, task.controls[0])]:
        points.append(mrmeshpy.Vector3f(*map(float, place)))
    settings = mrmeshpy.SplineSettings()
    settings.samplingStep = task.spacing
    spline = mrmeshpy.makeSpline(points, settings)
    projected = mrmeshpy.projectSpline(mesh, spline)
    seconds = time.perf_counter() - started
    return [_without_repetition(np.array([[p.x, p.y, p.z] for p in projected]))], seconds


def flip_loop(task: Task) -> Answer:
    """potpourri3d: the geodesic loop that edge flips reach from the path."""
    potpourri3d = importlib.import_module("potpourri3d")
    started = time.perf_counter()
    solver = potpourri3d.EdgeFlipGeodesicSolver(task.vertices, task.faces)
    loop = solver.find_geodesic_loop([int(vertex) for vertex in task.path])
    return [_without_repetition(np.asarray(loop))], time.perf_counter() - started


def signed_heat(task: Task) -> Answer:
    """potpourri3d: zero set of the signed distance to the path; it may deviate from the path."""
    return _signed_heat(task, "None")


def signed_heat_fixed(task: Task) -> Answer:
    """potpourri3d: the same with the distance forced to zero on the path, its default setting."""
    return _signed_heat(task, "ZeroSet")


SYSTEMS: dict[str, tuple[str, Callable[[Task], Answer]]] = {
    "MeshLib, projected spline": ("meshlib", meshlib_spline),
    "potpourri3d, edge-flip loop": ("potpourri3d", flip_loop),
    "potpourri3d, signed heat": ("potpourri3d", signed_heat),
    "potpourri3d, signed heat, zero on the path": ("potpourri3d", signed_heat_fixed),
}
"""Package and function of each system, by name."""

PACKAGES = tuple(dict.fromkeys(package for package, _ in SYSTEMS.values()))
"""All of these packages."""

LATER = "potpourri3d, signed heat, later"


class SystemsProcess:
    """A process that runs the systems; it is restarted after a crash or a hang."""

    def __init__(self) -> None:
        # Forking a process that has started threads, as PyTorch has, can hang.
        self._context = multiprocessing.get_context("spawn")
        self._start()

    def ask(self, name: str, task: Task, patience: float) -> Answer | str:
        """Answer of a system, or the reason why there is none.

        Parameters
        ----------
        name : str
            Key of `SYSTEMS`, or `LATER`.
        task : Task
            Surface and control points.
        patience : float
            Time limit in seconds.

        Returns
        -------
        Answer or str
            Polylines and time, or the reason why there are none.
        """
        try:
            self._connection.send((name, task))
            if self._connection.poll(patience):
                return cast("Answer | str", self._connection.recv())
            reason = f"no answer within {patience:g} s"
        except (EOFError, ConnectionError):
            self._process.join()
            reason = f"crashed with exit status {self._process.exitcode}"
        self.end()
        self._start()
        return reason

    def end(self) -> None:
        """Terminate the process, even if it is busy."""
        self._process.terminate()
        self._process.join()
        self._connection.close()

    def _start(self) -> None:
        self._connection, theirs = self._context.Pipe()
        self._process = self._context.Process(target=_serve, args=(theirs,), daemon=True)
        self._process.start()
        theirs.close()


def _serve(connection: Connection) -> None:
    while True:
        name, task = connection.recv()
        try:
            system = later_signed_heat if name == LATER else SYSTEMS[name][1]
            connection.send(system(task))
        except Exception as error:  # any exception of a third-party package is its answer
            connection.send(f"{type(error).__name__}: {error}")


def _signed_heat(task: Task, constraint: str) -> Answer:
    potpourri3d = importlib.import_module("potpourri3d")
    started = time.perf_counter()
    solver = potpourri3d.MeshSignedHeatSolver(task.vertices, task.faces)
    path: list[tuple[int, list[float]]] = [
        (int(vertex), []) for vertex in np.append(task.path, task.path[0])
    ]
    distance = solver.compute_distance([path], level_set_constraint=constraint)
    contour = potpourri3d.MeshMarchingTrianglesSolver(task.vertices, task.faces)
    pieces = contour.marching_triangles(distance, 0.0)
    seconds = time.perf_counter() - started
    edges = potpourri3d.edges(task.vertices, task.faces)
    return [_positions(task.vertices, edges, piece) for piece in pieces], seconds


def later_signed_heat(task: Task) -> Answer:
    """potpourri3d: a second signed distance with stored factorisations, without its zero set."""
    potpourri3d = importlib.import_module("potpourri3d")
    solver = potpourri3d.MeshSignedHeatSolver(task.vertices, task.faces)
    path: list[tuple[int, list[float]]] = [
        (int(vertex), []) for vertex in np.append(task.path, task.path[0])
    ]
    solver.compute_distance([path])
    started = time.perf_counter()
    solver.compute_distance([path])
    return [], time.perf_counter() - started


def _positions(
    vertices: FloatArray, edges: IntArray, piece: list[tuple[int, list[float]]]
) -> FloatArray:
    """Positions of contour points, which are given as vertices or as fractions of edges."""
    places = []
    for index, share in piece:
        if share:
            start, end = vertices[edges[index]]
            places.append((1.0 - share[0]) * start + share[0] * end)
        else:
            places.append(vertices[index])
    return _without_repetition(np.array(places))


def _without_repetition(points: FloatArray) -> FloatArray:
    """Points of a closed polyline without those that repeat their predecessor."""
    size = np.abs(points).max()
    steps = np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1)
    return points[steps > 1e-7 * size] if len(points) > 1 else points
