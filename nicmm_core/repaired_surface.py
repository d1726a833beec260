"""Finds a manifold for each request, and maps requests, starts and designs between it and the mesh.

For a mesh with defects, `repair.nonmanifold` has several methods to make a manifold, which are
tried in turn until the points of the request are connected. The curve is designed on a canonical
copy of their component (`geometry.numbering`), which depends only on the surface, so neither the
numbering nor the position or size of the mesh affects the curve.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from .design_result import Design
from .errors import CurveError
from .geometry import tolerances
from .geometry.array_types import FloatArray, IntArray
from .geometry.curve import SurfaceCurve, checked_curve, curve_on_mesh
from .geometry.mesh import Mesh, same_mesh
from .geometry.numbering import Renumbered, renumbered
from .geometry.surface_points import SurfacePoints, in_faces
from .path.via_points import with_via_points
from .repair.mapped_mesh import MappedMesh
from .repair.nonmanifold import REPAIRS, repaired
from .request import Request, renumbered_request
from .start import WITHOUT_START, Resumable
from .surface_designer import SurfaceDesigner

LARGEST_COPY = 200_000
"""Number of faces of a component above which curves are designed on the component itself.

A canonical copy of it would take a large part of the time of a curve.
"""


@dataclass(frozen=True)
class Manifold:
    """The surface on which the curve of a request is designed.

    Attributes
    ----------
    repaired : MappedMesh
        A manifold made from the faces of the given mesh.
    copy : Renumbered or None
        Canonical copy of the component of the request; None if the component is large.
    designer : SurfaceDesigner
        Designer on the copy, or on the repaired mesh if there is no copy.
    """

    repaired: MappedMesh
    copy: Renumbered | None
    designer: SurfaceDesigner

    @property
    def mesh(self) -> Mesh:
        """The mesh of the designer."""
        return self.designer.mesh

    def in_original(self, positions: FloatArray) -> FloatArray:
        """Map positions on the mesh of the designer, (n, 3), to the given mesh."""
        if self.copy is not None:
            positions = self.copy.in_original(positions)
        return positions + self.repaired.origin


class RepairedSurface:
    """Manifolds made from the same faces of a mesh by different methods, with their designers.

    Each manifold is made when it is first needed, and then kept.

    Parameters
    ----------
    mesh : Mesh
        The given mesh.
    usable : (u,) int array
        Faces that curves may enter, ascending.
    """

    def __init__(self, mesh: Mesh, usable: IntArray) -> None:
        self._mesh, self._usable = mesh, usable
        self._made: list[MappedMesh | None] = []
        self._manifolds: dict[tuple[int, int], Manifold] = {}  # by method and component
        self._whole: dict[int, SurfaceDesigner] = {}  # for components without a copy

    @property
    def first(self) -> MappedMesh:
        """The manifold in which the straightest pairs of faces are joined at non-manifold edges."""
        first = self._repair(0)
        assert first is not None  # only later methods may return None
        return first

    @property
    def most_connected(self) -> MappedMesh:
        """The manifold on which most of the surface is connected."""
        made = [self._repair(number) for number in range(REPAIRS)]
        return [one for one in made if one is not None][-1]

    def find(self, request: Request) -> tuple[Manifold, Request] | None:
        """Find a manifold on which the points of a request are connected.

        Returns the manifold and the request mapped to it, or None if the points are connected on no
        manifold.

        Raises
        ------
        ControlPointError, UnreachableError
            If via points coincide with control points or lie on another component.
        """
        for number in range(REPAIRS):
            found = self._repair(number)
            there = None if found is None else request_on(found, request)
            if found is not None and there is not None:
                if there.via_points:
                    with_via_points(
                        found.mesh, there.points, there.via_points, there.order, there.closed
                    )
                manifold = self._manifold(found, number, there)
                copy = manifold.copy
                return manifold, there if copy is None else renumbered_request(copy, there)
        return None

    def _repair(self, number: int) -> MappedMesh | None:
        """The manifold made by one method; None if `repaired` returns None."""
        while len(self._made) <= number:
            self._made.append(repaired(self._mesh, len(self._made), self._usable))
        return self._made[number]

    def _manifold(self, mapped: MappedMesh, number: int, request: Request) -> Manifold:
        """The component of a request on the manifold made by one method."""
        component = int(mapped.mesh.face_component[request.points.faces[0]])
        if (number, component) not in self._manifolds:
            if np.count_nonzero(mapped.mesh.face_component == component) > LARGEST_COPY:
                whole = self._whole.setdefault(number, SurfaceDesigner(mapped.mesh))
                made = Manifold(mapped, None, whole)
            else:
                copy = renumbered(mapped.mesh, component, exact=mapped.differs)
                made = Manifold(mapped, copy, SurfaceDesigner(copy.mesh))
            self._manifolds[number, component] = made
        return self._manifolds[number, component]


def request_on(mapped: MappedMesh, request: Request) -> Request | None:
    """Map a request to a mapped mesh; None if its points are not connected there."""
    if not mapped.differs:
        components = mapped.mesh.face_component[request.points.faces]
        return request if (components == components[0]).all() else None
    sets = [request.points, *request.via_points.values()]
    representations = [mapped.representations(points) for points in sets]
    component = mapped.common_component([point for of_set in representations for point in of_set])
    if component is None:
        return None
    points, *via_points = (mapped.points(of_set, component) for of_set in representations)
    return replace(
        request,
        points=points,
        via_points=dict(zip(request.via_points, via_points, strict=True)),
        obstacles=mapped.weights(request.obstacles),
        alignment=mapped.weights(request.alignment),
    )


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
        if len(start.curves) != 1:
            raise CurveError(
                f"start has {len(start.curves)} curves ({start.status.name}); pass a design with "
                "exactly one curve"
            )
        start = start.curves[0]
    original = manifold.repaired.original
    curve, segment_faces = checked_curve(original, start)
    index = curve.control_index
    first = int(index.argmin()) if curve.closed and len(index) else 0
    if len(index) < 2 or (index < 0).any() or (np.diff(np.roll(index, -first)) <= 0).any():
        raise CurveError(
            f"start has the control_index {index.tolist()}; pass a curve with at least two "
            "control points that visits each of them once and in order"
        )
    points = SurfacePoints(curve.faces, curve.barycentric)
    away = np.abs(points.positions(original) - curve.points).max(initial=0.0)
    if not away <= tolerances.SAME_CURVE * original.diagonal:
        raise CurveError(
            f"start lies on another mesh: its points differ by up to {away:g} from the positions "
            "that their faces and barycentric coordinates give on this mesh; pass the mesh that it "
            "was designed on"
        )
    if not curve.closed:
        segment_faces[-1] = curve.faces[-1]
    points = in_faces(original, points, segment_faces)
    curve = replace(curve, faces=points.faces, barycentric=points.barycentric)
    if not curve.closed:
        curve = _between_ends(original, curve)
    mapped_curve = manifold.repaired.curve_from_original(curve)
    if mapped_curve is None:
        raise CurveError(
            "start enters an obstacle of weight 1 or its clearance, or cannot be mapped at a "
            f"non-manifold edge{WITHOUT_START}"
        )
    if manifold.copy is None:
        return mapped_curve
    on_copy = manifold.copy.curve_to_copy(mapped_curve)
    if on_copy is None:
        raise CurveError(
            f"start and control_points lie on different components of the mesh{WITHOUT_START}"
        )
    return on_copy


def _between_ends(mesh: Mesh, curve: SurfaceCurve) -> SurfaceCurve:
    """The part of an open curve between its first and its last control point."""
    index = curve.control_index
    kept = slice(index[0], index[-1] + 1)
    return curve_on_mesh(mesh, False, curve.faces[kept], curve.barycentric[kept], index - index[0])


def design_on_original(manifold: Manifold, design: Design) -> Design:
    """Map a design from a manifold to the given mesh."""
    mapped, copy = manifold.repaired, manifold.copy
    if copy is not None:
        design = _mapped(design, copy.curve_to_original, copy.field_to_original)
    if mapped.differs:
        design = _mapped(design, mapped.curve_to_original, mapped.field_to_original)
    return _given_on(mapped.original, design)


def _given_on(mesh: Mesh, design: Design) -> Design:
    """The design, which continues only on a mesh that equals the mesh of the caller."""
    resumable = design.resumable
    return replace(
        design,
        resumable=None if resumable is None else replace(resumable, given=mesh),
        alternatives=[_given_on(mesh, other) for other in design.alternatives],
    )


def _mapped(
    design: Design,
    curve: Callable[[SurfaceCurve], SurfaceCurve],
    field: Callable[[FloatArray], FloatArray],
) -> Design:
    """A design whose curves and level set are mapped to another mesh by two functions."""
    return replace(
        design,
        curves=[curve(each) for each in design.curves],
        alternatives=[_mapped(other, curve, field) for other in design.alternatives],
        find_field=partial(_mapped_field, design, field),
    )


def _mapped_field(design: Design, field: Callable[[FloatArray], FloatArray]) -> FloatArray:
    return field(design.field)
