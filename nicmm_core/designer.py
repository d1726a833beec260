"""Designs curves on one mesh; keeps what only depends on the mesh.

A request is checked, and faces inside obstacles are removed (`repair.free_surface`). If the
remaining surface is not a manifold, it is repaired (`repaired_surface`). The curve is designed on
a canonical copy of this manifold (`geometry.numbering`), by `surface_designer`.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .arguments import (
    check_iterations,
    checked_corners,
    checked_map,
    checked_options,
    checked_surface_curve,
)
from .avoidance.avoided_curve import Avoided, avoided_curves
from .avoidance.contacts import is_too_close, meeting_only_at_junctions, meets
from .blas_threads import single_blas_thread
from .continued import is_uneven
from .design_result import Design, cancelled_design, with_curves_of_designs
from .errors import ArgumentError, CurveError, UnreachableError
from .geometry.array_types import FloatArray
from .geometry.curve import SurfaceCurve, points_of
from .geometry.mesh import Mesh, MeshLike, as_mesh
from .geometry.mirror import Plane, checked_plane
from .geometry.surface_points import (
    SurfacePoints,
    check_connected,
    check_count,
    locate_control_points,
    locate_points,
    nearest_points,
    snapped,
)
from .improvement import Rival
from .measures import checked_up, measures_of
from .offsets.curve_offsets import checked_distances, offset_curves
from .options import OPTIONS
from .path.via_points import ViaPoints, located_via_points, with_via_points
from .progress import INTERVAL, CancelledError, Progress, checkpoint, placed, subrange, watched
from .repair.clean_surface import clean_surfaces
from .repair.free_surface import check_reachable, free_faces
from .repair.mapped_mesh import MappedMesh
from .repaired_surface import (
    Manifold,
    NotOnOriginalError,
    RepairedSurface,
    SurfaceOffCurves,
    curve_of_design,
    is_on,
    only_curve,
    start_on,
)
from .request import Request, same_request
from .start import WITHOUT_START
from .status import Status
from .strokes.feature_lines import feature_line
from .strokes.stroke_fit import Differs, Line, checked_stroke, fitted_points
from .symmetry.mirrored_design import mirrored_design
from .symmetry.symmetric_request import (
    FARTHEST_IMAGE,
    ReflectedVertices,
    reflected_vertices,
    symmetric_weights,
    with_images,
    with_via_images,
)

PARTS = (
    "control_points, or via points, lie on parts of the mesh that share only single vertices; a "
    "curve cannot pass from one part to the other there; join the parts along an edge, or choose "
    "points on one of them"
)


NO_POINTS = SurfacePoints(np.zeros(0, dtype=np.int64), np.zeros((0, 3)))
"""The control points of a fit that has been cancelled."""


@dataclass(frozen=True)
class _Free:
    """The surface outside the obstacles of a request, kept for the next request."""

    obstacles: FloatArray
    clearance: float
    surface: RepairedSurface


@dataclass(frozen=True)
class _Kept:
    """A request and its design, kept for a caller who asks for the same."""

    request: Request
    design: Design


class Designer:
    """Designs any number of curves on one mesh.

    Everything that depends only on the mesh is computed once. Earlier designs have no effect on
    later ones: equal arguments always give the same curve, which is also that of `design_curve`.
    Threads may share a Designer; it designs one curve at a time.

    Parameters
    ----------
    mesh : Mesh or object with `vertices` and `faces`
    """

    def __init__(self, mesh: MeshLike) -> None:
        self.mesh = as_mesh(mesh)
        self._free: _Free | None = None  # of the last request with obstacles
        self._off_curves: SurfaceOffCurves | None = None  # of the last one with curves to avoid
        self._reflected: ReflectedVertices | None = None  # of the last one with maps and a mirror
        self._kept: _Kept | None = None  # the last design of a fit
        # Reentrant, since a progress function may design another curve with the same Designer.
        self._lock = threading.RLock()

    def design(
        self,
        control_points: ArrayLike | SurfacePoints,
        *,
        closed: bool = True,
        order: str = "given",
        via_points: ViaPoints | None = None,
        method: str = "elastic",
        obstacles: ArrayLike | None = None,
        alignment: ArrayLike | None = None,
        clearance: float = 0.0,
        avoid: Sequence[SurfaceCurve | Design] | None = None,
        smoothness: float = 1.0,
        corners: ArrayLike | None = None,
        normal_bending: float = 0.0,
        mirror: ArrayLike | None = None,
        alternatives: int = 0,
        start: Design | SurfaceCurve | None = None,
        max_iterations: int | None = None,
        progress: Progress | None = None,
    ) -> Design:
        """Design a curve.

        The result and the other parameters and errors are those of `design_curve`.

        Parameters
        ----------
        start : Design or SurfaceCurve, optional
            A curve on this mesh from which the design starts; only with the method "elastic". Its
            course and the order of its points are kept, so the result may differ from a design
            without a start, and `via_points` have no effect. Obstacles, maps and smoothness may
            differ from those of the start. If the start is a converged Design and only painted
            weights differ, only the curve near them moves. Control points may have been added,
            removed, or moved by up to a tenth of the curve's length; the legs at a point that came
            or went may take another course if that is fairer, unless `max_iterations` is given. The
            cost of a move depends on the curve and not on the size of the mesh, so a start suits
            interactive dragging of a point.
        max_iterations : int, optional
            Limit on the iterations of the relaxation; only with the method "elastic". If the curve
            has not converged by then, the status is `ITERATION_LIMIT`. For interactive drawing,
            pass each design as the next start until the curve has converged.

        Raises
        ------
        CurveError
            If the start lies on another mesh, enters an obstacle, meets a curve of `avoid`, is too
            far from the control points, or would cross itself when moved to them.
        """
        started = time.perf_counter()
        given = {
            "closed": closed,
            "order": order,
            "via_points": via_points,
            "method": method,
            "smoothness": smoothness,
            "corners": corners,
            "normal_bending": normal_bending,
            "obstacles": obstacles,
            "clearance": clearance,
            "avoid": with_curves_of_designs(avoid),
            "alignment": alignment,
            "mirror": mirror,
            "alternatives": alternatives,
        }
        _check_progress(progress)
        try:
            with watched(progress), single_blas_thread(), self._exclusive():
                options = checked_options(self.mesh, given)
                _check_start(start, method, max_iterations, options["alternatives"])
                request = self._request(control_points, options)
                design = self._designed(request, started, start, max_iterations)
                if request.avoid is not None:
                    avoided = avoided_curves(self.mesh, request.avoid, request.points)
                    design = _off_avoided(self.mesh, design, avoided, request.clearance)
                    if isinstance(start, Design) and max_iterations is None:
                        _check_even(start, design)
                return design
        except CancelledError:
            return cancelled_design(time.perf_counter() - started)

    def _designed(
        self,
        request: Request,
        started: float,
        start: Design | SurfaceCurve | None = None,
        max_iterations: int | None = None,
        rival: Rival | None = None,
    ) -> Design:
        """The design on the first manifold whose curve can be mapped back to the given mesh.

        Faces that cleaning removes may be so wide, compared with the rest, that no curve leads
        across them; a manifold that is cleaned less has them.
        """
        kept, anew = self._kept, start is None and max_iterations is None and rival is None
        if anew and kept is not None and same_request(request, kept.request):
            return replace(kept.design, seconds=time.perf_counter() - started)
        failure: NotOnOriginalError | None = None
        for manifold, there in self._manifolds(request):
            if isinstance(start, Design) and _answers(start, manifold, there):
                return replace(start, seconds=time.perf_counter() - started)
            begin = None if start is None else start_on(manifold, start)
            with placed(manifold.in_original):
                found = manifold.designer.design(there, started, begin, max_iterations, rival)
                rival = None  # it lies on the first manifold
                try:
                    return manifold.design_on_original(found, request)
                except NotOnOriginalError as error:
                    failure = failure or error
        assert failure is not None  # there is at least one manifold
        raise failure

    def mirrored(self, design: Design, plane: ArrayLike) -> Design:
        """The mirror image of a design; see the function `mirrored`."""
        started = time.perf_counter()
        if not isinstance(design, Design):
            raise ArgumentError(f"design is a {type(design).__name__}; pass a Design")
        checked = checked_plane("plane", plane, self.mesh)
        curve, _ = curve_of_design(self.mesh, only_curve(design, "design"), "design")
        positions = checked.reflected(curve.points)
        with self._exclusive():
            images, distance = nearest_points(self.mesh, positions)
            if (distance > FARTHEST_IMAGE * self.mesh.diagonal).any():
                raise CurveError(
                    f"the mirror image of design is up to {distance.max():.3g} away from the "
                    f"surface, more than {FARTHEST_IMAGE:.0%} of the mesh's diagonal; pass another "
                    "plane"
                )
            unpainted = checked_options(
                self.mesh, {option.name: option.default for option in OPTIONS}
            )
            unpainted |= {"closed": curve.closed, "via_points": {}}
            unpainted["corners"] = checked_corners(None, len(curve.control_index))
            if design.resumable is not None:
                before = design.resumable
                corners = before.request.are_corners(before.visited)
                unpainted["corners"] = np.flatnonzero(corners)
                unpainted["normal_bending"] = before.request.normal_bending
            request = Request(points=snapped(images[curve.control_index]), **unpainted)
            manifold, there = next(self._manifolds(request))
            found = mirrored_design(
                manifold.unrounded,
                there,
                manifold.from_original(positions),
                curve,
                design.status,
            )
            result = manifold.design_on_original(found, request)
        return replace(result, seconds=time.perf_counter() - started)

    def check_avoids(
        self, design: Design, avoid: Sequence[SurfaceCurve | Design], clearance: float = 0.0
    ) -> None:
        """Check that the curve of a design avoids other curves, as one designed with `avoid` does.

        A mirror image is not relaxed (`mirrored`), so it may come too close to curves that the
        mirrored curve avoids.

        Parameters
        ----------
        design : Design
            A design with one curve on this mesh.
        avoid : list of SurfaceCurve or Design
            Other curves on this mesh; control points of the design on them are junctions.
        clearance : float, default 0
            Least distance from these curves along the surface; it does not count near junctions.

        Raises
        ------
        UnreachableError
            If the curve crosses one of them, or comes closer to it than the clearance.
        CurveError
            If a curve does not lie on the mesh.
        ArgumentError
            If another argument cannot be used.
        """
        given = {option.name: option.default for option in OPTIONS}
        given |= {"avoid": with_curves_of_designs(avoid), "clearance": clearance}
        options = checked_options(self.mesh, given)
        curve, _ = curve_of_design(self.mesh, only_curve(design, "design"), "design")
        with self._exclusive():
            points = points_of(curve)[curve.control_index[curve.control_index >= 0]]
            avoided = avoided_curves(self.mesh, options["avoid"] or (), points)
            for number, each in enumerate(avoided):
                if meets(self.mesh, curve, each):
                    raise UnreachableError(
                        f"design crosses avoid[{number}]; move control points so that it stays on "
                        "one side, or leave the other curve out"
                    )
            if not options["clearance"]:
                return
            mapped, there = self._curve_on_manifold(
                curve, "design", "on which the clearance is measured; leave clearance out"
            )
            for number, each in enumerate(avoided):
                if is_too_close(mapped, there, each, options["clearance"]):
                    raise UnreachableError(
                        f"design comes closer to avoid[{number}] than the clearance "
                        f"({clearance:g}); move control points away from it, or use a smaller one"
                    )

    def offset_curves(
        self, curve: SurfaceCurve | Design, distances: Sequence[ArrayLike]
    ) -> list[list[SurfaceCurve]]:
        """Offsets of a curve at several distances, as `offset_curve` computes each of them.

        Parameters
        ----------
        curve : SurfaceCurve or Design
            A curve on this mesh, or a design with one.
        distances : sequence of float or (k,) float array_like
            Distances along the surface, positive for the left side.

        Returns
        -------
        list of list of SurfaceCurve
            The curves at each distance.
        """
        given = only_curve(curve, "curve") if isinstance(curve, Design) else curve
        checked = checked_surface_curve(self.mesh, "curve", given)
        widths = checked_distances(checked, distances)
        with self._exclusive():
            mapped, there = self._curve_on_manifold(
                checked, "curve", "on which its offsets are computed; design a curve elsewhere"
            )
            return offset_curves(mapped, there, widths)

    def fit_stroke(
        self,
        points: ArrayLike,
        tolerance: float,
        closed: bool = False,
        *,
        smoothness: float = 1.0,
        normal_bending: float = 0.0,
        progress: Progress | None = None,
    ) -> SurfacePoints:
        """The control points that `fit_stroke` finds, as points of the surface.

        The curve that stays within the tolerance is the one with the same smoothness and normal
        bending, since these change its shape between the points. If the progress function returns
        False, there are no points.
        """
        if not isinstance(closed, bool | np.bool_):
            raise ArgumentError(f"closed is {closed!r}; pass True or False")
        _check_progress(progress)
        stroke, within = checked_stroke(self.mesh, points, tolerance, bool(closed))
        shape = {"smoothness": smoothness, "normal_bending": normal_bending}
        try:
            with watched(progress), single_blas_thread(), self._exclusive():
                return self._fitted(stroke, within, bool(closed), shape)
        except CancelledError:
            return NO_POINTS

    def feature_loop(
        self,
        point: ArrayLike | SurfacePoints,
        edges: ArrayLike | None = None,
        weights: ArrayLike | None = None,
        reach: float | None = None,
        progress: Progress | None = None,
    ) -> tuple[SurfacePoints, bool]:
        """The control points that `feature_loop` finds, and whether the line is closed.

        If the progress function returns False, there are no points.
        """
        _check_progress(progress)
        try:
            with watched(progress), single_blas_thread(), self._exclusive():
                line = feature_line(self.mesh, point, edges, weights, reach)
                stroke, within = checked_stroke(self.mesh, line.points, line.tolerance, line.closed)
                return self._fitted(stroke, within, line.closed, {}), line.closed
        except CancelledError:
            return NO_POINTS, False

    def _fitted(
        self, stroke: FloatArray, tolerance: float, closed: bool, shape: dict[str, float]
    ) -> SurfacePoints:
        """Control points that follow a stroke, for curves with some options."""
        options = {option.name: option.default for option in OPTIONS}
        options |= {"closed": closed, **shape}
        left = 1.0  # of the progress; each design takes half of it

        def relax_along(points: SurfacePoints, line: Line) -> SurfaceCurve | None:
            request = self._request(points, checked_options(self.mesh, options))
            manifold, there = next(self._manifolds(request))
            found = self._relaxed_along(manifold, there, line)
            if found is None:
                return None
            return only_curve(manifold.design_on_original(found, request), "design")

        def design(points: SurfacePoints, line: Line, differs: Differs) -> SurfaceCurve:
            nonlocal left
            request = self._request(points, checked_options(self.mesh, options))
            manifold, there = next(self._manifolds(request))
            rival = None
            with contextlib.suppress(CurveError, UnreachableError):
                along = self._relaxed_along(manifold, there, line)
                if along is not None and along.resumable is not None:
                    rival = Rival(
                        along.resumable.curve, lambda curve: differs(manifold.in_original(curve))
                    )
            with subrange(1.0 - left, 1.0 - 0.5 * left):
                found = self._designed(request, time.perf_counter(), rival=rival)
                checkpoint()  # a cancelled design may have an unfinished curve
                ended_early = rival is not None and rival.is_beaten
                if ended_early and not differs(found.curves[0].points):
                    # It differed only before it was relaxed on the given faces.
                    found, ended_early = self._designed(request, time.perf_counter()), False
                    checkpoint()
            left *= 0.5
            if not ended_early:
                self._kept = _Kept(request, found)
            return only_curve(found, "design")

        return fitted_points(self.mesh, stroke, tolerance, closed, relax_along, design)

    def _relaxed_along(self, manifold: Manifold, there: Request, line: Line) -> Design | None:
        """The curve on a manifold relaxed from a line; None if there is no curve along it."""
        positions = manifold.from_original(line.positions)
        begin = manifold.curve_along(positions, there.closed, line.control_index)
        if begin is None:
            return None
        with placed(manifold.in_original):
            return manifold.designer.design(there, time.perf_counter(), begin)

    def measures(
        self,
        curve: SurfaceCurve | Design,
        obstacles: ArrayLike | None = None,
        up: ArrayLike = (0.0, 0.0, 1.0),
        corners: Any = None,
    ) -> dict[str, Any]:
        """The measures of a curve on this mesh, as `SurfaceCurve.measures` describes them."""
        given = only_curve(curve, "curve") if isinstance(curve, Design) else curve
        checked = checked_surface_curve(self.mesh, "curve", given)
        weights, direction = checked_map("obstacles", obstacles, self.mesh), checked_up(up)
        bends = checked_corners(corners, len(checked.control_index))
        with self._exclusive():
            mapped, there = self._curve_on_manifold(
                checked, "curve", "on which areas and distances are measured"
            )
            return measures_of(mapped, checked, there, weights, direction, bends)

    def _curve_on_manifold(
        self, curve: SurfaceCurve, name: str, consequence: str
    ) -> tuple[MappedMesh, SurfaceCurve]:
        """The first manifold of the whole surface that has a curve, and the curve on it.

        Raises
        ------
        CurveError
            If no manifold has it. The message names the argument, and ends with the consequence.
        """
        for mapped in self._whole.manifolds():
            there = mapped.curve_to(curve) if mapped.differs else curve
            if there is not None:
                return mapped, there
        raise CurveError(f"{name} cannot be mapped to a manifold, {consequence}")

    @contextlib.contextmanager
    def _exclusive(self) -> Iterator[None]:
        """Wait until no other thread uses this Designer; the caller may cancel while waiting."""
        while not self._lock.acquire(timeout=INTERVAL):
            checkpoint()
        try:
            yield
        finally:
            self._lock.release()

    def _request(
        self, control_points: ArrayLike | SurfacePoints, options: dict[str, Any]
    ) -> Request:
        """The request for checked options, with the mirror images if it has a mirror."""
        mesh, plane, via = self.mesh, options["mirror"], options["via_points"]
        order, closed = options["order"], options["closed"]
        if plane is None:
            points = locate_control_points(mesh, control_points, closed, connected=False)
            options["via_points"] = located_via_points(mesh, points, via, order, closed)
            options["corners"] = checked_corners(options["corners"], len(points))
            return Request(points=points, **options)
        if options["avoid"] is not None:
            raise ArgumentError("avoid and mirror cannot be combined; leave one out")
        given = locate_points(mesh, control_points, "control_points")
        if not len(given):
            check_count(0, closed)
        among = self._whole.faces_connected_to(given)
        points, mirror = with_images(mesh, given, plane, closed, order, among)
        crosses = bool(mirror.side[len(given) - 1])  # the last leg of the half leads to the plane
        located = located_via_points(mesh, given, via, order, crosses)
        options["via_points"] = with_via_images(mesh, located, len(given), mirror, among)
        options["mirror"] = mirror
        corners = checked_corners(options["corners"], len(given))
        options["corners"] = np.union1d(corners, mirror.image[corners])
        for name in ("obstacles", "alignment"):
            if options[name] is not None:
                reflected = self._reflected_under(mirror.plane)
                options[name] = symmetric_weights(mesh, options[name], reflected)
        return Request(points=points, **options)

    def _reflected_under(self, plane: Plane) -> ReflectedVertices:
        """The mirror images of the vertices; they are kept until a request has another mirror."""
        last = self._reflected
        if last is None or not (
            np.array_equal(last.plane.point, plane.point)
            and np.array_equal(last.plane.normal, plane.normal)
        ):
            last = self._reflected = reflected_vertices(self.mesh, plane)
        return last

    @cached_property
    def _whole(self) -> RepairedSurface:
        """The surface of all faces."""
        return RepairedSurface(clean_surfaces(self.mesh), np.arange(len(self.mesh.faces)))

    def _manifolds(self, request: Request) -> Iterator[tuple[Manifold, Request]]:
        """Yield the manifolds that connect the points, and the request on each.

        Raises
        ------
        UnreachableError
            If no manifold connects them.
        """
        surface = self._surface_off_obstacles(request)
        kept_off = None if request.avoid is None else self._surface_off_curves(surface, request)
        found = surface.connecting(request) if kept_off is None else kept_off.connecting(request)
        first = next(found, None)
        if first is not None:
            yield first
            yield from found
            return
        if kept_off is not None:
            kept_off.check_reachable(request)
        check_connected(self.mesh, request.points)
        if request.via_points:
            with_via_points(
                self.mesh, request.points, request.via_points, request.order, request.closed
            )
        if surface is not self._whole and any(self._whole.connecting(request)):
            check_reachable(surface.most_connected, request.named_points)
        raise UnreachableError(PARTS)

    def _surface_off_obstacles(self, request: Request) -> RepairedSurface:
        """The surface outside obstacles; it is kept until a request has other obstacles."""
        obstacles, clearance = request.obstacles, request.clearance
        if obstacles is None:
            return self._whole
        last = self._free
        same = last is not None and last.clearance == clearance
        if last is None or not (same and np.array_equal(last.obstacles, obstacles)):
            free = free_faces(next(self._whole.manifolds()), obstacles, clearance)
            every = len(free) == len(self.mesh.faces)
            surface = self._whole if every else RepairedSurface(self._whole.surfaces, free)
            last = self._free = _Free(obstacles, clearance, surface)
        return last.surface

    def _surface_off_curves(self, surface: RepairedSurface, request: Request) -> SurfaceOffCurves:
        """The surface off the curves to avoid; it is kept until a request has other curves.

        Control points matter only where they lie on the curves.
        """
        assert request.avoid is not None
        avoided = avoided_curves(self.mesh, request.avoid, request.points)
        last = self._off_curves
        if last is None or not last.is_of(surface, avoided, request.clearance):
            last = self._off_curves = SurfaceOffCurves(surface, avoided, request.clearance)
        return last


def _check_progress(progress: object) -> None:
    """Raise ArgumentError unless a progress function can be called, or is None."""
    if progress is not None and not callable(progress):
        raise ArgumentError(f"progress is {progress!r}; pass a function or None")


def _check_even(start: Design, design: Design) -> None:
    """Raise CurveError if a curve beside avoided ones bends far more than its start."""
    before, after = start.resumable, design.resumable
    if before is not None and after is not None and is_uneven(before.curve, after.curve):
        raise CurveError(f"start would become uneven beside the curves of avoid{WITHOUT_START}")


def _off_avoided(mesh: Mesh, design: Design, avoided: list[Avoided], clearance: float) -> Design:
    """A design that meets avoided curves only at junctions, without alternatives that cross them.

    Raises
    ------
    UnreachableError
        If the curve of the design itself crosses one of them.
    """
    curves = [meeting_only_at_junctions(mesh, curve, avoided, clearance) for curve in design.curves]
    kept = []
    for other in design.alternatives:
        with contextlib.suppress(UnreachableError):
            kept.append(_off_avoided(mesh, other, avoided, clearance))
    return replace(design, curves=curves, alternatives=kept)


def _answers(design: Design, manifold: Manifold, request: Request) -> bool:
    """Whether a design is already the complete answer to a request on a manifold."""
    resumable = design.resumable
    return (
        resumable is not None
        and design.status not in (Status.ITERATION_LIMIT, Status.CANCELLED)
        and is_on(manifold, resumable)
        and same_request(request, resumable.request)
    )


def _check_start(start: object, method: str, max_iterations: int | None, alternatives: int) -> None:
    """Raise ArgumentError unless the arguments fit the method and each other."""
    check_iterations(max_iterations)
    if alternatives and (start is not None or max_iterations is not None):
        raise ArgumentError(
            f"alternatives is {alternatives}, which cannot be combined with start or "
            "max_iterations; leave one out"
        )
    if start is not None and not isinstance(start, Design | SurfaceCurve):
        raise ArgumentError(
            f"start is a {type(start).__name__}; pass a Design, a SurfaceCurve or None"
        )
    for name, value in (("start", start), ("max_iterations", max_iterations)):
        if value is not None and method != "elastic":
            raise ArgumentError(f'{name} needs the method "elastic", not {method!r}; leave one out')
