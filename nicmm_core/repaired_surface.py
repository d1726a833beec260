"""Finds a manifold for each request, and maps requests, starts and designs between it and the mesh.

A curve is designed on a copy of a copy of the given mesh, and mapped back through both:

given mesh → repaired mesh (`repair.mapped_mesh`) → canonical copy (`geometry.numbering`).

The surface is cleaned (`repair.clean_surface`), made a manifold (`repair.nonmanifold`), and edges
that only cleaning has divided become whole again (`repair.straight_edges`). If that separates the
points of the request, manifolds that connect more or are cleaned less are tried in turn. The
canonical copy of the component of the points depends only on the surface, so neither the numbering
nor the position or size of the mesh affects the curve.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from itertools import product

import numpy as np

from .avoidance.avoided_curve import Avoided
from .avoidance.off_curves import check_off_curves, surface_off_curves
from .design_result import Design
from .errors import CurveError, UnreachableError
from .geometry import tolerances
from .geometry.array_types import FloatArray, IntArray
from .geometry.curve import SurfaceCurve, checked_curve, curve_on_mesh, lies_on, weights_in_faces
from .geometry.mesh import Mesh, same_mesh
from .geometry.numbering import Renumbered, renumbered
from .geometry.surface_points import SurfacePoints, coincide, joined
from .mapped_surface import MappedSurface
from .path.via_points import with_via_points
from .relaxation.curve_along import curve_along
from .repair.clean_surface import CleanSurface
from .repair.mapped_mesh import MappedMesh
from .repair.nonmanifold import manifold
from .request import Request, mapped_request
from .start import WITHOUT_START, Resumable
from .status import Status
from .surface_designer import SurfaceDesigner
from .symmetry.halves import exactly_symmetric
from .symmetry.reflection import asymmetry

LARGEST_COPY = 200_000
"""Number of faces of a connected mesh above which curves are designed on the mesh itself.

A canonical copy of it would take a large part of the time of a curve.
"""

Copies = tuple[MappedMesh | Renumbered, ...]
"""Copies of meshes, each made from the one before, with the maps `points_to`, `weights_to` and
`curve_to` to it, and `curve_back` and `field_back` from it."""


class NotOnOriginalError(UnreachableError):
    """A curve is simple on a repaired mesh, but there is no such curve on the given one."""


@dataclass(frozen=True)
class Manifold:
    """The surface on which the curve of a request is designed, and the copies that lead to it.

    Attributes
    ----------
    repaired : MappedMesh
        A manifold made from the faces of the given mesh, with the component of the request.
    copies : tuple
        The copies from the given mesh to the mesh of the designer, each made from the one before:
        the repaired mesh, unless it is the given mesh itself, the part of it off curves that are
        avoided, and the canonical copy of a component, unless the mesh is large and connected.
    designer : SurfaceDesigner
        Designer on the last of these meshes.
    """

    repaired: MappedMesh
    copies: Copies
    designer: SurfaceDesigner

    @property
    def mesh(self) -> Mesh:
        """The mesh of the designer."""
        return self.designer.mesh

    @cached_property
    def unrounded(self) -> MappedSurface:
        """The surface of the designer's mesh with coordinates that are not rounded."""
        last = self.copies[-1] if self.copies else None
        if not isinstance(last, Renumbered):
            return self.designer.surface
        return MappedSurface(last.unrounded)

    def from_original(self, positions: FloatArray) -> FloatArray:
        """Map positions in the space of the given mesh, (n, 3), to that of the designer's mesh."""
        for copy in self.copies:
            positions = copy.from_original(positions)
        return positions

    def in_original(self, positions: FloatArray) -> FloatArray:
        """Map positions on the mesh of the designer, (n, 3), to the given mesh."""
        for copy in self.copies[::-1]:
            positions = copy.in_original(positions)
        return positions

    def request(self, request: Request) -> Request:
        """Map a request from the given mesh to the mesh of the designer."""
        for copy in self.copies:
            request = mapped_request(request, copy.points_to, copy.weights_to)
        if request.mirror is not None:
            request = replace(
                request, mirror=request.mirror.mapped(self.from_original, self.mesh.diagonal)
            )
        return request

    def curve(self, curve: SurfaceCurve) -> SurfaceCurve:
        """Map a curve from the given mesh to that of the designer.

        Raises
        ------
        CurveError
            If the curve enters faces that curves may not enter, cannot be mapped at a non-manifold
            edge, or lies on another component.
        """
        for number, copy in enumerate(self.copies):
            mapped = copy.curve_to(curve)
            if mapped is None and copy is self.repaired:
                raise CurveError(
                    "start enters an obstacle of weight 1 or its clearance, or cannot be mapped at "
                    f"a non-manifold edge{WITHOUT_START}"
                )
            is_cut = isinstance(copy, MappedMesh) and copy is not self.repaired
            if is_cut and (mapped is None or not lies_on(copy.mesh, mapped)):
                return self._displaced(curve, self.copies[number:])
            if mapped is None:
                raise CurveError(
                    "start and control_points lie on different components of the mesh"
                    f"{WITHOUT_START}"
                )
            curve = mapped
        return curve

    def _displaced(self, curve: SurfaceCurve, copies: Copies) -> SurfaceCurve:
        """A curve before some copies, moved off the curves that are avoided."""
        points = curve.points
        for copy in copies:
            points = copy.from_original(points)
        moved = self.curve_along(points, curve.closed, curve.control_index)
        if moved is None:
            raise CurveError(
                "start crosses a curve of avoid, or comes much closer to one than the clearance"
                f"{WITHOUT_START}"
            )
        return moved

    def curve_along(
        self, points: FloatArray, closed: bool, control_index: IntArray
    ) -> SurfaceCurve | None:
        """A simple curve along a polyline in the coordinates of the designer's mesh, (n, 3).

        None if there is no such curve near the polyline.
        """
        surface = self.designer.surface.without_maps
        found = curve_along(surface, points, closed, control_index)
        return None if found is None else found.surface_curve(self.mesh)

    def design_on_original(self, design: Design, request: Request) -> Design:
        """Map a design to the given mesh, on which it is requested.

        It continues only on a mesh that equals the given one. Alternatives that cannot be mapped
        are left out.

        Raises
        ------
        NotOnOriginalError
            If the curve is not simple on the given mesh, since it crosses removed faces.
        """
        curves, resumable = design.curves, design.resumable
        if resumable is not None and design.status is not Status.CANCELLED:
            curves = [self._with_exact_images(curves[0], resumable)]
        for copy in self.copies[::-1]:
            curves = [copy.curve_back(curve) for curve in curves]
        if self.repaired.differs:
            curves = [self._across_removed_faces(curve, request) for curve in curves]
        alternatives = []
        for other in design.alternatives:
            with contextlib.suppress(NotOnOriginalError):
                alternatives.append(self.design_on_original(other, request))
        mirror = request.mirror
        return replace(
            design,
            curves=curves,
            alternatives=alternatives,
            asymmetry=None if mirror is None else asymmetry(curves[0], mirror.plane),
            find_field=partial(_field_back, self.copies, design),
            resumable=resumable and replace(resumable, given=self.repaired.original),
            repairs=dict(self.repaired.repairs),
        )

    def _with_exact_images(self, curve: SurfaceCurve, design: Resumable) -> SurfaceCurve:
        """A curve of the designer, with mirror images that rounding has not moved."""
        if design.request.mirror is None:
            return curve
        surface = self.unrounded.without_maps
        return exactly_symmetric(surface, curve, design.curve, design.visited, design.request)

    def _across_removed_faces(self, curve: SurfaceCurve, request: Request) -> SurfaceCurve:
        """A curve mapped back to the given mesh, led across the faces that were removed from it."""
        removed = self.repaired.clean.removed_faces
        led = removed.led_across(curve, request.points)
        if not removed.is_simple(led):
            raise NotOnOriginalError(
                "no simple curve was found across the faces without area; remove these faces, and "
                "merge vertices by distance"
            )
        return led


def _field_back(copies: Copies, design: Design) -> FloatArray:
    """The level set of a design on the given mesh."""
    values = design.field
    for copy in copies[::-1]:
        values = copy.field_back(values)
    return values


class RepairedSurface:
    """Manifolds made from the same faces of a mesh in different ways, with their designers.

    Each manifold is made when it is first needed, and then kept.

    Parameters
    ----------
    surfaces : list of CleanSurface
        The surface of the mesh, cleaned less and less.
    usable : (u,) int array
        Faces that curves may enter, ascending.
    """

    def __init__(self, surfaces: list[CleanSurface], usable: IntArray) -> None:
        self.surfaces = surfaces
        self._manifold = cache(lambda clean, connected: manifold(clean, usable, connected))
        self._on_component = cache(_on_component)

    def manifolds(self) -> Iterator[MappedMesh]:
        """The manifolds in the order in which they are tried: with less cleaning later.

        At an edge of more than two faces, first the straightest pairs of faces are connected, then
        all faces. Manifolds that connect no more than the one before are left out.
        """
        for clean, connected in product(self.surfaces, (False, True)):
            made = self._manifold(clean, connected)
            if made is not None:
                yield made

    def faces_connected_to(self, points: SurfacePoints) -> IntArray | None:
        """Faces of the given mesh on the component that contains points.

        None if these are all faces, or if there is no such component.
        """
        made = next(self.manifolds(), None)
        component = None if made is None else made.common_component(points)
        if made is None or component is None:
            return None
        label = made.mesh.face_component[made.in_mesh.parent]
        return (
            None
            if (label == component).all()
            else np.unique(made.in_given.parent[label == component])
        )

    @property
    def most_connected(self) -> MappedMesh:
        """The manifold with the fewest components."""
        return min(self.manifolds(), key=lambda made: int(made.mesh.face_component.max()))

    def connecting(self, request: Request) -> Iterator[tuple[Manifold, Request]]:
        """Yield the manifolds on which the points of a request are connected, with the request.

        Raises
        ------
        ControlPointError
            If via points coincide with control points.
        """
        points = joined([request.points, *request.via_points.values()])
        for mapped in self.manifolds():
            component = mapped.common_component(points)
            if component is None:
                continue
            found = self._on_component(mapped, component)
            there = _request_on(found, request)
            if there is not None:
                yield found, there


class SurfaceOffCurves:
    """The manifolds of a surface, without what is too close to curves that are avoided.

    Parameters
    ----------
    surface : RepairedSurface
    avoided : list of Avoided
    clearance : float
    """

    def __init__(self, surface: RepairedSurface, avoided: list[Avoided], clearance: float) -> None:
        self.surface, self.avoided, self.clearance = surface, avoided, clearance
        self._off_curves = cache(lambda mapped: surface_off_curves(mapped, avoided, clearance))
        self._on_component = cache(_on_component)

    def is_of(self, surface: RepairedSurface, avoided: list[Avoided], clearance: float) -> bool:
        """Whether it was made from these arguments."""
        return (
            self.surface is surface
            and self.clearance == clearance
            and len(self.avoided) == len(avoided)
            and all(map(Avoided.equals, self.avoided, avoided))
        )

    def connecting(self, request: Request) -> Iterator[tuple[Manifold, Request]]:
        """Yield the manifolds on which the points of a request are connected, with the request."""
        points = joined([request.points, *request.via_points.values()])
        for mapped in self.surface.manifolds():
            component = mapped.common_component(points)
            off = None if component is None else self._off_curves(mapped)
            if component is None or off is None:
                continue
            whole = replace(mapped, component=component)
            part = off.common_component(whole.points_to(points) if whole.differs else points)
            if part is None:
                continue
            found = self._on_component(mapped, component, off, part)
            there = _request_on(found, request)
            if there is not None:
                yield found, there

    def check_reachable(self, request: Request) -> None:
        """Raise an error if points of a request lie too close to the curves, or are separated.

        Raises
        ------
        ControlPointError
        UnreachableError
        """
        points = joined([request.points, *request.via_points.values()])
        for mapped in self.surface.manifolds():
            component = mapped.common_component(points)
            if component is None:
                continue
            whole, off = replace(mapped, component=component), self._off_curves(mapped)
            named = request.named_points
            if whole.differs:
                named = {name: whole.points_to(of_name) for name, of_name in named.items()}
            check_off_curves(off, named, self.clearance)


def _request_on(found: Manifold, request: Request) -> Request | None:
    """A request on a manifold; None if points coincide there, on two sides of a gap."""
    there = found.request(request)
    if coincide(found.mesh, there.points):
        return None
    if there.via_points:
        with_via_points(found.mesh, there.points, there.via_points, there.order, there.closed)
    return there


def _on_component(
    mapped: MappedMesh, component: int, off_curves: MappedMesh | None = None, part: int = 0
) -> Manifold:
    """A component of a manifold with its canonical copy and a designer.

    With `off_curves`, it is a component of this part of the manifold.
    """
    mapped = replace(mapped, component=component)
    copies: Copies = (mapped,) if mapped.differs else ()
    mesh, last, component = mapped.mesh, mapped, mapped.component
    if off_curves is not None:
        last, component = replace(off_curves, component=part), part
        copies = (*copies, last) if last.differs else copies
        mesh = last.mesh
    is_copied = len(mesh.faces) <= LARGEST_COPY or bool((mesh.face_component != component).any())
    if is_copied:
        copy = renumbered(mesh, component, apart=last.moved or mapped.moved)
        copies, mesh = (*copies, copy), copy.mesh
    return Manifold(mapped, copies, SurfaceDesigner(mesh, is_copied))


def is_on(manifold: Manifold, start: Resumable) -> bool:
    """Whether a start lies on the given mesh of a manifold and on the mesh of its designer."""
    given = start.given
    return (
        given is not None
        and same_mesh(given, manifold.repaired.original)
        and same_mesh(start.mesh, manifold.mesh)
    )


def start_on(manifold: Manifold, start: Design | SurfaceCurve) -> Resumable | SurfaceCurve:
    """Map a start to a manifold.

    Returns
    -------
    Resumable or SurfaceCurve
        The start on the mesh of the manifold's designer. Each point of a SurfaceCurve is given in
        the face of the segment that begins there.

    Raises
    ------
    CurveError
        If the start is not one curve through its control points on the original, enters faces that
        curves may not enter, cannot be mapped at a non-manifold edge, or lies on another component.
    """
    if isinstance(start, Design):
        if start.resumable is not None and is_on(manifold, start.resumable):
            return start.resumable
        start = only_curve(start, "start")
    original = manifold.repaired.original
    curve, segment_faces = curve_of_design(original, start, "start")
    if not curve.closed:
        segment_faces[-1] = curve.faces[-1]
    weights = weights_in_faces(original, curve.faces, curve.barycentric, segment_faces)
    curve = replace(curve, faces=segment_faces, barycentric=weights)
    if not curve.closed:
        curve = _between_ends(original, curve)
    return manifold.curve(curve)


def only_curve(design: Design, name: str) -> SurfaceCurve:
    """The curve of a design; raises CurveError, with its name, unless it has exactly one."""
    if len(design.curves) != 1:
        raise CurveError(
            f"{name} has {len(design.curves)} curves ({design.status.name}); pass a design with "
            "exactly one curve"
        )
    return design.curves[0]


def curve_of_design(
    original: Mesh, given: SurfaceCurve, name: str
) -> tuple[SurfaceCurve, IntArray]:
    """Check that a curve lies on a mesh and visits its control points in order.

    Returns what `checked_curve` returns. The name is that of the argument in messages.
    """
    curve, segment_faces = checked_curve(original, given, across_gaps=True)
    index = curve.control_index
    first = int(index.argmin()) if curve.closed and len(index) else 0
    if len(index) < 2 or (index < 0).any() or (np.diff(np.roll(index, -first)) <= 0).any():
        raise CurveError(
            f"{name} has the control_index {index.tolist()}; pass a curve with at least two "
            "control points that visits each of them once and in order"
        )
    points = SurfacePoints(curve.faces, curve.barycentric)
    away = np.abs(points.positions(original) - curve.points).max(initial=0.0)
    if not away <= tolerances.SAME_CURVE * original.diagonal:
        raise CurveError(
            f"{name} lies on another mesh: its points differ by up to {away:g} from the positions "
            "that their faces and barycentric coordinates give on this mesh; pass the mesh that it "
            "was designed on"
        )
    return curve, segment_faces


def _between_ends(mesh: Mesh, curve: SurfaceCurve) -> SurfaceCurve:
    """The part of an open curve between its first and its last control point."""
    index = curve.control_index
    kept = slice(index[0], index[-1] + 1)
    return curve_on_mesh(mesh, False, curve.faces[kept], curve.barycentric[kept], index - index[0])
