"""A mesh that curves are computed on in place of another, and what in it belongs to what.

Its faces have the corners of faces of the original, in the same order. So a face with barycentrics
is the same point of both, a request on the original is one on the copy, and a curve on the copy is
one on the original. `sound_copy` mends a mesh so, and `free_surface` takes obstacles away.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from dataclasses import field as dataclass_field
from functools import cached_property, partial

import numpy as np

from .array_types import FloatArray, IntArray
from .crossings import crossing_segments
from .curve import SurfaceCurve, curve_on_mesh
from .design_result import Design, Status
from .mesh import Mesh
from .progress import checkpoint
from .request import Request
from .surface_points import SurfacePoints


@dataclass(frozen=True)
class MeshCopy:
    """A mesh, its copy, and what in it belongs to what.

    Attributes
    ----------
    original : Mesh
    mesh : Mesh
        The copy; the same object where nothing differs.
    face : (f,) int array
        The original of each of its faces.
    place : (v,) int array
        The same for vertices that are one and the same of the surface, as of a doubled one.
    origin : (3,) float array
        Where the copy's origin is in the space of the original.
    """

    original: Mesh
    mesh: Mesh
    face: IntArray
    place: IntArray
    origin: FloatArray = dataclass_field(default_factory=lambda: np.zeros(3))

    @property
    def differs(self) -> bool:
        """Whether the copy is another mesh."""
        return self.mesh is not self.original

    def request(self, request: Request) -> Request | None:
        """The same request on the copy; None where its points are not connected there."""
        if not self.differs:
            components = self.mesh.face_component[request.points.faces]
            return request if (components == components[0]).all() else None
        sets = [request.points, *request.via_points.values()]
        candidates = [self.candidates(points) for points in sets]
        common = self._common_component([each for of_set in candidates for each in of_set])
        if common is None:
            return None
        points, *via_points = (
            self._points(points, of_set, common)
            for points, of_set in zip(sets, candidates, strict=True)
        )
        return replace(
            request,
            points=points,
            via_points=dict(zip(request.via_points, via_points, strict=True)),
            obstacles=self._weights(request.obstacles),
            alignment=self._weights(request.alignment),
        )

    def _weights(self, weights: FloatArray | None) -> FloatArray | None:
        """Weights at the vertices; the greatest of vertices that are one in the copy."""
        if weights is None:
            return None
        checkpoint()
        result = np.zeros(len(self.mesh.vertices))
        np.maximum.at(result, self.mesh.faces, weights[self.original.faces[self.face]])
        return result

    def design(self, design: Design) -> Design:
        """A design on the copy as one on the mesh."""
        if not self.differs:
            return design
        curves = [self._curve(curve) for curve in design.curves]
        status = design.status
        # Strands that pass different copies of one vertex touch there.
        doubled = bool((np.bincount(self.place) > 1).any())
        if doubled and not all(map(self._is_simple, design.curves)):
            status = Status.NOT_ONE_CURVE
        return replace(
            design, status=status, curves=curves, find_field=partial(self._field, design)
        )

    def carried(self, curve: SurfaceCurve) -> SurfaceCurve | None:
        """A curve on the mesh as one on the copy; None where that lacks a face of it."""
        if not self.differs:
            return curve
        faces = self._copies[curve.faces]
        if (faces < 0).any():
            return None
        index = curve.control_index
        return curve_on_mesh(self.mesh, curve.closed, faces, curve.barycentric, index)

    def _is_simple(self, curve: SurfaceCurve) -> bool:
        polyline = SurfacePoints(curve.faces, curve.barycentric)
        return not len(crossing_segments(self.place[self.mesh.faces], polyline, curve.closed))

    def _curve(self, curve: SurfaceCurve) -> SurfaceCurve:
        faces = self.face[curve.faces]
        index = curve.control_index
        return curve_on_mesh(self.original, curve.closed, faces, curve.barycentric, index)

    def _field(self, design: Design) -> FloatArray:
        """φ at the vertices of the mesh; the copy of a vertex nearest to the curve counts."""
        field = np.full(len(self.original.vertices), np.inf)
        values = design.field[self.mesh.faces.ravel()]
        order = np.argsort(-np.abs(values), kind="stable")
        field[self.original.faces[self.face].ravel()[order]] = values[order]
        # What the copy does not have is outside.
        field[np.isinf(field)] = design.field.max()
        return field

    @cached_property
    def _copies(self) -> IntArray:
        """The face of the copy that each face is, (F,), or -1."""
        copies = np.full(len(self.original.faces), -1)
        copies[self.face] = np.arange(len(self.face))
        return copies

    def candidates(self, points: SurfacePoints) -> list[IntArray]:
        """Faces of the copy that each point lies in, its own first."""
        copies = [self._copies[faces] for faces in faces_holding(self.original, points)]
        return [faces[faces >= 0] for faces in copies]

    def _common_component(self, candidates: list[IntArray]) -> int | None:
        """The largest component of the copy that has all points; None where there is none."""
        component = self.mesh.face_component
        common = set(component[candidates[0]].tolist())
        for faces in candidates:
            common &= set(component[faces].tolist())
        areas = np.bincount(component, weights=self.mesh.face_areas)
        return max(common, key=lambda label: float(areas[label]), default=None)

    def _points(
        self, points: SurfacePoints, candidates: list[IntArray], component: int
    ) -> SurfacePoints:
        """Points in faces of one component of the copy."""
        faces, barycentric = [], []
        for place, of_point in enumerate(candidates):
            chosen = of_point[self.mesh.face_component[of_point] == component][0]
            corners = self.original.faces[points.faces[place]].tolist()
            weights = dict(zip(corners, points.barycentric[place], strict=True))
            own = self.original.faces[self.face[chosen]].tolist()
            faces.append(chosen)
            barycentric.append([weights.get(corner, 0.0) for corner in own])
        shape = (len(faces), 3)
        return SurfacePoints(
            np.array(faces, dtype=np.int64), np.array(barycentric, dtype=np.float64).reshape(shape)
        )


def faces_holding(mesh: Mesh, points: SurfacePoints) -> list[IntArray]:
    """The faces that each point lies in, its own first."""
    around = mesh.vertex_faces
    found = []
    checkpoint()
    for face, barycentric in zip(points.faces, points.barycentric, strict=True):
        shared = None
        for corner in mesh.faces[face][barycentric > 0.0]:
            here = around.indices[around.indptr[corner] : around.indptr[corner + 1]]
            shared = here if shared is None else np.intersect1d(shared, here)
        found.append(np.concatenate([[face], shared]).astype(np.int64))
    return found
