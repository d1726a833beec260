"""The front door: a mesh and control points go in, a curve comes out. Read this file first.

A request is checked, faces inside obstacles are taken away (`repair.free_surface`), what is left is
made a manifold if it is not one (`repaired_surface`), and the request is answered there
(`surface_designer`):

control points → initial loop → signed distance → features (`problem`) → network, pretrained
→ its level set → one loop through the points → contour → relaxation of the curve.

On all but small meshes all but the last is done on a coarse mesh of the same surface, and the
curve is mapped from there to the fine mesh (`coarsening`).
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from .arguments import check_iterations, check_torch, checked_options
from .design_result import Design, cancelled_design
from .errors import ArgumentError, UnreachableError
from .geometry.array_types import FloatArray
from .geometry.curve import SurfaceCurve
from .geometry.mesh import Mesh, same_mesh
from .geometry.surface_points import SurfacePoints, check_connected, locate_control_points
from .path.via_points import ViaPoints, located_via_points
from .progress import INTERVAL, CancelledError, Progress, checkpoint, displaced, watched
from .repair.free_surface import check_reachable, free_faces
from .repair.mapped_mesh import MappedMesh
from .repaired_surface import RepairedSurface, design_on_original, start_on
from .request import Request, same_request
from .status import Status
from .surface_designer import SurfaceDesigner

PARTS = (
    "control_points, or via points, lie on parts of the mesh that meet in single vertices only, "
    "which no curve crosses; join the parts along an edge, or choose points on one of them"
)


@dataclass(frozen=True)
class _Free:
    """What obstacles leave of the surface."""

    obstacles: FloatArray
    clearance: float
    surface: RepairedSurface


class Designer:
    """A surface that will be asked for many curves.

    What depends on the mesh alone is found once. Answers are not remembered: equal arguments give
    equal curves, whatever was asked before, and those of `design_curve`. Threads may share a
    Designer: it designs one curve after the other.

    Parameters
    ----------
    mesh : Mesh
    """

    def __init__(self, mesh: Mesh) -> None:
        if not isinstance(mesh, Mesh):
            raise ArgumentError(
                f"mesh is a {type(mesh).__name__}; pass nicmm_core.Mesh(vertices, faces)"
            )
        self.mesh = mesh
        self._whole = RepairedSurface(mesh, np.arange(len(mesh.faces)))
        self._free: _Free | None = None  # of the last request with obstacles
        # A progress function may ask the same Designer for another curve.
        self._lock = threading.RLock()

    def design(
        self,
        control_points: ArrayLike | SurfacePoints,
        *,
        closed: bool = True,
        order: str = "given",
        via_points: ViaPoints | None = None,
        method: str = "nicmm",
        obstacles: ArrayLike | None = None,
        alignment: ArrayLike | None = None,
        clearance: float = 0.0,
        smoothness: float = 1.0,
        start: Design | SurfaceCurve | None = None,
        max_iterations: int | None = None,
        progress: Progress | None = None,
    ) -> Design:
        """Design a curve; arguments, result and errors are those of `design_curve`, and more.

        Parameters
        ----------
        start : Design or SurfaceCurve, optional
            A curve on this mesh to go on from; only with the method "nicmm". Its course and the
            order of its points are kept, so the result may differ from that without a start, and
            `via_points` have no effect. Obstacles, maps and smoothness may be others. Control
            points may have moved by a tenth of the curve's length, come or gone. The cost follows
            the curve and not the mesh: that is what dragging a point needs.
        max_iterations : int, optional
            Of the relaxation; only with the method "nicmm". The status is `ITERATION_LIMIT` until
            the curve has converged: for live drawing, pass the last design as the next start until
            it has.

        Raises
        ------
        CurveError
            If the start lies on another mesh, enters an obstacle, is too far from the control
            points, or would cross itself on its way there.
        """
        started = time.perf_counter()
        given = {
            "closed": closed,
            "order": order,
            "via_points": via_points,
            "method": method,
            "smoothness": smoothness,
            "obstacles": obstacles,
            "clearance": clearance,
            "alignment": alignment,
        }
        if progress is not None and not callable(progress):
            raise ArgumentError(f"progress is {progress!r}; pass a function or None")
        try:
            with watched(progress), self._its_turn():
                options = checked_options(self.mesh, given)
                _check_start(start, method, max_iterations)
                if method == "nicmm-paper":
                    check_torch()
                points = locate_control_points(self.mesh, control_points, closed, connected=False)
                options["via_points"] = located_via_points(
                    self.mesh, points, options["via_points"] or {}, order, closed
                )
                request = Request(points=points, **options)
                mapped, designer, there = self._on_manifold(request)
                if isinstance(start, Design) and _answers(start, mapped, there):
                    return replace(start, seconds=time.perf_counter() - started)
                begin = None if start is None else start_on(mapped, start)
                with displaced(mapped.origin):
                    found = designer.design(there, started, begin, max_iterations)
                    return design_on_original(mapped, found)
        except CancelledError:
            return cancelled_design(time.perf_counter() - started)

    @contextlib.contextmanager
    def _its_turn(self) -> Iterator[None]:
        """Wait until no other thread uses this Designer, or the caller has enough of waiting."""
        while not self._lock.acquire(timeout=INTERVAL):
            checkpoint()
        try:
            yield
        finally:
            self._lock.release()

    def _on_manifold(self, request: Request) -> tuple[MappedMesh, SurfaceDesigner, Request]:
        """The first manifold on which the points are connected, and the request there."""
        surface = self._surface_off_obstacles(request)
        found = surface.find(request)
        if found is not None:
            return found
        check_connected(self.mesh, request.points)
        if surface is not self._whole and self._whole.find(request) is not None:
            check_reachable(surface.most_connected, request.named_points)
        raise UnreachableError(PARTS)

    def _surface_off_obstacles(self, request: Request) -> RepairedSurface:
        """What obstacles leave of the surface, kept for the next request with the same ones."""
        obstacles, clearance = request.obstacles, request.clearance
        if obstacles is None:
            return self._whole
        last = self._free
        same = last is not None and last.clearance == clearance
        if last is None or not (same and np.array_equal(last.obstacles, obstacles)):
            free = free_faces(self._whole.first, obstacles, clearance)
            every = len(free) == len(self.mesh.faces)
            surface = self._whole if every else RepairedSurface(self.mesh, free)
            last = self._free = _Free(obstacles, clearance, surface)
        return last.surface


def _answers(design: Design, mapped: MappedMesh, request: Request) -> bool:
    """Whether a design is already the answer to a request, on a mapped mesh."""
    resumable = design.resumable
    return (
        resumable is not None
        and design.status not in (Status.ITERATION_LIMIT, Status.CANCELLED)
        and same_mesh(resumable.mesh, mapped.mesh)
        and same_request(request, resumable.request)
    )


def _check_start(start: object, method: str, max_iterations: int | None) -> None:
    """Raise ArgumentError unless a start and a bound can be used with the method."""
    check_iterations(max_iterations)
    if start is not None and not isinstance(start, Design | SurfaceCurve):
        raise ArgumentError(
            f"start is a {type(start).__name__}; pass a Design, a SurfaceCurve or None"
        )
    for name, value in (("start", start), ("max_iterations", max_iterations)):
        if value is not None and method != "nicmm":
            raise ArgumentError(f'{name} needs the method "nicmm", not {method!r}; leave one out')


def design_curve(
    mesh: Mesh,
    control_points: ArrayLike | SurfacePoints,
    *,
    closed: bool = True,
    order: str = "given",
    via_points: ViaPoints | None = None,
    method: str = "nicmm",
    obstacles: ArrayLike | None = None,
    alignment: ArrayLike | None = None,
    clearance: float = 0.0,
    smoothness: float = 1.0,
    progress: Progress | None = None,
) -> Design:
    """Design a smooth curve on a mesh through control points.

    Parameters
    ----------
    mesh : Mesh
    control_points : (k,) int array_like, (k, 3) float array_like or SurfacePoints
        Vertex indices, points on the surface, or faces with barycentric coordinates; at least
        three, or two of an open curve.
    closed : bool, default True
        A closed curve, or an open one from the first point visited to the last.
    order : {"given", "shortest"}
        Visit the points in this order, or in the shortest one: cyclic where the curve is closed.
    via_points : mapping, optional
        Which way the curve goes from one control point to the next, where there are several: from
        the index of a control point to points, in any form that control points may have, that the
        initial path passes on its way from there, such as ``{1: [57]}``. The curve does not pass
        them exactly. Only for the order "given".
    method : {"nicmm", "nicmm-paper", "variational"}
        The pretrained network's level set, relaxed on the surface (the default); the paper's own
        method, which trains the network on for every curve; or the same energy minimised without
        a network.
    obstacles, alignment : (V,) array_like of weights in [0, 1], optional
        What the curve shall avoid and what it shall follow. No curve enters a face whose three
        corners are obstacles of weight 1; lower weights cost in proportion.
    clearance : float, default 0
        Distance along the surface, in mesh units, that the curve keeps from obstacles of weight 1.
    smoothness : float, default 1
        Larger gives a fairer curve that follows the shortest way less closely.
    progress : callable, optional
        Called a few times a second with the fraction done and the points of the curve so far, of
        which there are none at first. The design stops when it returns False, with the last curve
        that it had or with none.

    Returns
    -------
    Design

    Raises
    ------
    ControlPointError
        If there are too few points, or one is repeated, out of range or off the surface.
    UnreachableError
        If no such curve exists on the surface, or only one that winds round itself too often; also
        where obstacles of weight 1 leave no way.
    ArgumentError
        If another argument cannot be used.
    MissingPackageError
        If the method needs PyTorch and it cannot be imported.

    Examples
    --------
    >>> import nicmm_core as nicmm
    >>> from nicmm_core import shapes
    >>> mesh = shapes.sphere(3)
    >>> design = nicmm.design_curve(mesh, [12, 80, 41], order="shortest")
    >>> len(design.curves)
    1
    """
    return Designer(mesh).design(
        control_points,
        closed=closed,
        order=order,
        via_points=via_points,
        method=method,
        obstacles=obstacles,
        alignment=alignment,
        clearance=clearance,
        smoothness=smoothness,
        progress=progress,
    )
