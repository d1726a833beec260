"""Finds a manifold for each request, and maps requests, starts and designs between it and the mesh.

A mesh without defects is used directly. Otherwise `repair.nonmanifold` has several methods to make
a manifold, which are tried in turn until the points of the request are connected.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from .design_result import Design
from .errors import CurveError
from .geometry import tolerances
from .geometry.array_types import FloatArray, IntArray
from .geometry.curve import SurfaceCurve, checked_curve, curve_on_mesh
from .geometry.mesh import Mesh, same_mesh
from .geometry.surface_points import SurfacePoints, in_faces
from .repair.mapped_mesh import MappedMesh
from .repair.nonmanifold import REPAIRS, repaired
from .request import Request
from .start import WITHOUT_START, Resumable
from .surface_designer import SurfaceDesigner


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
        self._made: list[tuple[MappedMesh, SurfaceDesigner] | None] = []

    @property
    def first(self) -> MappedMesh:
        """The manifold in which the straightest pairs of faces are joined at non-manifold edges."""
        first = self._repair(0)
        assert first is not None  # only later methods may return None
        return first[0]

    @property
    def most_connected(self) -> MappedMesh:
        """The manifold on which most of the surface is connected."""
        made = [self._repair(number) for number in range(REPAIRS)]
        return [one[0] for one in made if one is not None][-1]

    def find(self, request: Request) -> tuple[MappedMesh, SurfaceDesigner, Request] | None:
        """Find a manifold on which the points of a request are connected.

        Returns the manifold, its designer and the request mapped to it, or None if the points are
        connected on no manifold.
        """
        for number in range(REPAIRS):
            found = self._repair(number)
            there = None if found is None else request_on(found[0], request)
            if found is not None and there is not None:
                return *found, there
        return None

    def _repair(self, number: int) -> tuple[MappedMesh, SurfaceDesigner] | None:
        """The manifold made by one method, with its designer; None if `repaired` returns None."""
        while len(self._made) <= number:
            mapped = repaired(self._mesh, len(self._made), self._usable)
            self._made.append(None if mapped is None else (mapped, SurfaceDesigner(mapped.mesh)))
        return self._made[number]


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


def start_on(mapped: MappedMesh, start: Design | SurfaceCurve) -> Resumable | SurfaceCurve:
    """Map a start to a mapped mesh.

    Returns
    -------
    Resumable or SurfaceCurve
        The start on the mapped mesh. Each point of a SurfaceCurve is given in the face of the
        segment that begins there.

    Raises
    ------
    CurveError
        If the start is not one curve through its control points on the original, enters faces that
        curves may not enter, or cannot be mapped at a non-manifold edge.
    """
    if isinstance(start, Design):
        resumable = start.resumable
        if resumable is not None and same_mesh(resumable.mesh, mapped.mesh):
            return resumable
        if len(start.curves) != 1:
            raise CurveError(
                f"start has {len(start.curves)} curves ({start.status.name}); pass a design with "
                "exactly one curve"
            )
        start = start.curves[0]
    original = mapped.original
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
    mapped_curve = mapped.curve_from_original(curve)
    if mapped_curve is None:
        raise CurveError(
            "start enters an obstacle of weight 1 or its clearance, or cannot be mapped at a "
            f"non-manifold edge{WITHOUT_START}"
        )
    return mapped_curve


def _between_ends(mesh: Mesh, curve: SurfaceCurve) -> SurfaceCurve:
    """The part of an open curve between its first and its last control point."""
    index = curve.control_index
    kept = slice(index[0], index[-1] + 1)
    return curve_on_mesh(mesh, False, curve.faces[kept], curve.barycentric[kept], index - index[0])


def design_on_original(mapped: MappedMesh, design: Design) -> Design:
    """Map a design from a mapped mesh to the original."""
    if not mapped.differs:
        return design
    return replace(
        design,
        curves=[mapped.curve_to_original(curve) for curve in design.curves],
        alternatives=[design_on_original(mapped, other) for other in design.alternatives],
        find_field=partial(_field_on_original, mapped, design),
    )


def _field_on_original(mapped: MappedMesh, design: Design) -> FloatArray:
    return mapped.field_to_original(design.field)
