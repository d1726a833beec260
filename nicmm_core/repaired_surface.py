"""Finds a manifold for each request, and maps requests, starts and designs between it and the mesh.

The surface is cleaned (`repair.clean_surface`) and made a manifold (`repair.nonmanifold`). If that
separates the points of the request, ways that connect more or clean less are tried in turn. Edges
that only cleaning has divided become whole again (`repair.straight_edges`). The curve is designed
on a canonical copy of the component of the points (`geometry.numbering`), which depends only on the
surface, so neither the numbering nor the position or size of the mesh affects the curve.
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
from .geometry.curve import SurfaceCurve, checked_curve, curve_on_mesh, weights_in_faces
from .geometry.mesh import Mesh, same_mesh
from .geometry.numbering import Renumbered, renumbered
from .geometry.surface_points import SurfacePoints, coincide
from .path.via_points import with_via_points
from .repair.clean_surface import Cleaning, CleanSurface, clean_surface
from .repair.mapped_mesh import MappedMesh
from .repair.nonmanifold import manifold
from .repair.straight_edges import StraightenedMesh, straightened
from .request import Request, mapped_request
from .start import WITHOUT_START, Resumable
from .surface_designer import SurfaceDesigner

LARGEST_COPY = 200_000
"""Number of faces of a connected mesh above which curves are designed on the mesh itself.

A canonical copy of it would take a large part of the time of a curve.
"""

WAYS = tuple((cleaning, connected) for cleaning in Cleaning for connected in (False, True))
"""Ways to make a manifold, in the order in which they are tried: how much is cleaned, and whether
all faces at an edge of more than two faces are connected."""


@dataclass(frozen=True)
class Manifold:
    """The surface on which the curve of a request is designed, and the copies that lead to it.

    Attributes
    ----------
    repaired : MappedMesh
        A manifold made from the faces of the given mesh.
    straight : StraightenedMesh or None
        The manifold without vertices that divide straight edges, or None if it has no such vertex.
    copy : Renumbered or None
        Canonical copy of the component of the request; None if the mesh is large and connected.
    designer : SurfaceDesigner
        Designer on the last of these meshes.
    """

    repaired: MappedMesh
    straight: StraightenedMesh | None
    copy: Renumbered | None
    designer: SurfaceDesigner

    @property
    def mesh(self) -> Mesh:
        """The mesh of the designer."""
        return self.designer.mesh

    @property
    def copies(self) -> tuple[StraightenedMesh | Renumbered, ...]:
        """The copies that lead from the manifold to the mesh of the designer."""
        return tuple(copy for copy in (self.straight, self.copy) if copy is not None)

    def in_original(self, positions: FloatArray) -> FloatArray:
        """Map positions on the mesh of the designer, (n, 3), to the given mesh."""
        if self.copy is not None:
            positions = self.copy.in_original(positions)
        return positions + self.repaired.origin

    def request(self, request: Request) -> Request:
        """Map a request from the repaired mesh to the mesh of the designer."""
        for copy in self.copies:
            request = mapped_request(request, copy.points_to, copy.weights_to)
        return request

    def curve(self, curve: SurfaceCurve) -> SurfaceCurve | None:
        """Map a curve from the given mesh to that of the designer.

        None if the curve enters faces that curves may not enter, or cannot be mapped at a
        non-manifold edge.

        Raises
        ------
        CurveError
            If the curve lies on another component.
        """
        mapped = self.repaired.curve_to(curve)
        if mapped is None:
            return None
        for copy in self.copies:
            mapped = copy.curve_to(mapped)
            if mapped is None:
                raise CurveError(
                    "start and control_points lie on different components of the mesh"
                    f"{WITHOUT_START}"
                )
        return mapped

    def design_on_original(self, design: Design, points: SurfacePoints) -> Design:
        """Map a design to the given mesh, on which its control points are given."""
        for copy in self.copies[::-1]:
            design = _mapped(design, copy.curve_back, copy.field_back)
        if self.repaired.differs:
            curve_back = partial(self.repaired.curve_back, points=points)
            design = _mapped(design, curve_back, self.repaired.field_back)
        return _given_on(self.repaired, design)


class CleanSurfaces:
    """The surface of a mesh, cleaned as much as each `Cleaning` says; each is made once."""

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        self._made: dict[Cleaning, CleanSurface | None] = {}

    def __getitem__(self, cleaning: Cleaning) -> CleanSurface | None:
        """A clean surface; None if no face would remain."""
        if cleaning not in self._made:
            self._made[cleaning] = clean_surface(self.mesh, cleaning)
        return self._made[cleaning]

    def repeats(self, cleaning: Cleaning) -> bool:
        """Whether a clean surface has the same faces as the one that is cleaned more."""
        if cleaning is Cleaning.FULL:
            return False
        one, other = self[cleaning], self[Cleaning(cleaning - 1)]
        return (
            one is not None
            and other is not None
            and np.array_equal(one.parts.faces, other.parts.faces)
        )


class RepairedSurface:
    """Manifolds made from the same faces of a mesh in different ways, with their designers.

    Each manifold is made when it is first needed, and then kept.

    Parameters
    ----------
    clean : CleanSurfaces
    usable : (u,) int array
        Faces that curves may enter, ascending.
    """

    def __init__(self, clean: CleanSurfaces, usable: IntArray) -> None:
        self._clean, self._usable = clean, usable
        self._made: dict[tuple[Cleaning, bool], MappedMesh | None] = {}
        self._manifolds: dict[tuple[Cleaning, bool, int], Manifold] = {}  # the last is a component

    @property
    def first(self) -> MappedMesh:
        """The manifold that is tried first."""
        return next(made for way in WAYS if (made := self._manifold_of(*way)) is not None)

    @property
    def most_connected(self) -> MappedMesh:
        """The manifold on which most of the surface is connected."""
        ways = [(c, connected) for c in (Cleaning.VERTICES, Cleaning.FULL) for connected in (1, 0)]
        made = (self._manifold_of(cleaning, bool(connected)) for cleaning, connected in ways)
        return next((one for one in made if one is not None), self.first)

    def find(self, request: Request) -> tuple[Manifold, Request] | None:
        """Find a manifold on which the points of a request are connected.

        Returns the manifold and the request mapped to it, or None if the points are connected on no
        manifold.

        Raises
        ------
        ControlPointError, UnreachableError
            If via points coincide with control points or lie on another component.
        """
        for way in WAYS:
            found = self._manifold_of(*way)
            there = None if found is None else request_on(found, request)
            if found is not None and there is not None:
                if there.via_points:
                    with_via_points(
                        found.mesh, there.points, there.via_points, there.order, there.closed
                    )
                made = self._component(found, way, there)
                return made, made.request(there)
        return None

    def _manifold_of(self, cleaning: Cleaning, connected: bool) -> MappedMesh | None:
        """The manifold made in one way; None if another way makes the same one."""
        way = cleaning, connected
        if way not in self._made:
            clean = None if self._clean.repeats(cleaning) else self._clean[cleaning]
            self._made[way] = None if clean is None else manifold(clean, self._usable, connected)
        return self._made[way]

    def _component(
        self, mapped: MappedMesh, way: tuple[Cleaning, bool], request: Request
    ) -> Manifold:
        """The component of a request on the manifold made in one way."""
        component = int(mapped.mesh.face_component[request.points.faces[0]])
        key = (*way, component)
        if key not in self._manifolds:
            inside = mapped.mesh.face_component == component
            if inside.all() and len(inside) > LARGEST_COPY:
                made = Manifold(mapped, None, None, SurfaceDesigner(mapped.mesh))
            else:
                straight = straightened(mapped.mesh, mapped.divisions)
                mesh = mapped.mesh
                if straight is not None:
                    mesh = straight.mesh
                    component = int(mesh.face_component[straight.parent[request.points.faces[0]]])
                copy = renumbered(mesh, component, exact=mapped.moved)
                made = Manifold(mapped, straight, copy, SurfaceDesigner(copy.mesh))
            self._manifolds[key] = made
        return self._manifolds[key]


def request_on(mapped: MappedMesh, request: Request) -> Request | None:
    """Map a request to a mapped mesh; None if its points are not connected there, or coincide."""
    if not mapped.differs:
        components = mapped.mesh.face_component[request.points.faces]
        return request if (components == components[0]).all() else None
    sets = [request.points, *request.via_points.values()]
    representations = [mapped.representations(points) for points in sets]
    component = mapped.common_component([point for of_set in representations for point in of_set])
    if component is None:
        return None
    on_component = [mapped.points(of_set, component) for of_set in representations]
    points = on_component[0]
    if coincide(mapped.mesh, points):  # on the two sides of a gap that was closed
        return None
    there = mapped_request(request, lambda given: given, mapped.weights_to)
    via_points = dict(zip(request.via_points, on_component[1:], strict=True))
    return replace(there, points=points, via_points=via_points)


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
    curve, segment_faces = checked_curve(original, start, across_gaps=True)
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
    weights = weights_in_faces(original, curve.faces, curve.barycentric, segment_faces)
    curve = replace(curve, faces=segment_faces, barycentric=weights)
    if not curve.closed:
        curve = _between_ends(original, curve)
    mapped = manifold.curve(curve)
    if mapped is None:
        raise CurveError(
            "start enters an obstacle of weight 1 or its clearance, or cannot be mapped at a "
            f"non-manifold edge{WITHOUT_START}"
        )
    return mapped


def _between_ends(mesh: Mesh, curve: SurfaceCurve) -> SurfaceCurve:
    """The part of an open curve between its first and its last control point."""
    index = curve.control_index
    kept = slice(index[0], index[-1] + 1)
    return curve_on_mesh(mesh, False, curve.faces[kept], curve.barycentric[kept], index - index[0])


def _given_on(repaired: MappedMesh, design: Design) -> Design:
    """The design with its repairs; it continues only on a mesh that equals the original."""
    resumable = design.resumable
    return replace(
        design,
        resumable=None if resumable is None else replace(resumable, given=repaired.original),
        alternatives=[_given_on(repaired, other) for other in design.alternatives],
        repairs=dict(repaired.repairs),
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
