"""A repaired mesh on which curves are computed, and the map between it and the original.

Each face of the repaired mesh is a face of the original or a part of one. So its points and curves
are points and curves on the original, which is not changed. `nonmanifold` creates such meshes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.curve import SurfaceCurve, curve_on_mesh, weights_in_faces
from ..geometry.mesh import Mesh
from ..geometry.surface_points import SurfacePoints, in_faces, joined, nearest_points, snapped
from ..progress import checkpoint
from .backtracking import without_backtracking
from .removed_faces import RemovedFaces
from .strand_separation import separated

Representations = list[SurfacePoints]
"""For each of several points, its representations in all faces of the mesh that contain it."""


@dataclass(frozen=True)
class MappedMesh:
    """A mesh and its map to the original.

    Attributes
    ----------
    original : Mesh
        The given mesh.
    mesh : Mesh
        The repaired mesh; the same object as the original if nothing differs.
    face : (f,) int array
        Original face of each face of the mesh.
    corners : (f, 3, 3) float array or None
        Barycentric coordinates of the corners of each face in its original face. None if no face is
        divided and the corners have the same order.
    place : (v,) int array
        Index of the place of each vertex, equal for vertices that are one point of the original.
    original_place : (V,) int array
        Index of the place of each vertex of the original.
    joined : (V,) int array
        The first of the original vertices that were joined with each, since they coincide.
    removed : (F,) bool array
        Faces of the original of which no part remains, since they are doubled or have no area.
    divisions : (d, 3) int array
        Vertices at which edges were divided, and the two ends of the edge of each.
    origin : (3,) float array
        Origin of the mesh's coordinates, in the space of the original.
    moved : bool
        Whether vertices were moved to give faces an area, or to keep copies of a vertex apart.
    repairs : dict of str to int
        How often each repair was made, without those that were not.
    """

    original: Mesh
    mesh: Mesh
    face: IntArray
    corners: FloatArray | None
    place: IntArray
    original_place: IntArray
    joined: IntArray
    removed: BoolArray
    divisions: IntArray
    origin: FloatArray
    moved: bool
    repairs: dict[str, int]

    @property
    def differs(self) -> bool:
        """Whether the mesh is not the original itself."""
        return self.mesh is not self.original

    def representations(self, points: SurfacePoints) -> Representations:
        """Map points of the original to all faces of the mesh that contain them.

        Of the representations of a point, those in parts of its given face come first.
        """
        found = []
        around = _faces_holding(self.original, points)
        for face, barycentric, faces in zip(points.faces, points.barycentric, around, strict=True):
            weights = dict(zip(self.original.faces[face].tolist(), barycentric, strict=True))
            found.append(self._parts_with(faces, weights))
        if self._removed is not None:
            positions = points.positions(self.original)
            for number in np.flatnonzero([self.removed[faces].any() for faces in around]).tolist():
                there = self._at_position(positions[[number]])
                found[number] = joined([found[number], there])
        return found

    def _at_position(self, point: FloatArray) -> SurfacePoints:
        """The point of the mesh nearest to a position, (1, 3), in every face that contains it.

        The result is empty if that point is farther away than a face without area is wide.
        """
        nearest, distance = nearest_points(self.mesh, point - self.origin)
        if not distance[0] <= tolerances.ON_SURFACE * self.original.diagonal:
            return nearest[:0]
        nearest = snapped(nearest)
        corners = self.mesh.faces[nearest.faces[0]][nearest.barycentric[0] > 0.0]
        faces = self.mesh.faces_with(corners)
        return in_faces(self.mesh, nearest[np.zeros(len(faces), dtype=np.int64)], faces)

    def _parts_with(self, faces: IntArray, weights: dict[int, float]) -> SurfacePoints:
        """Map a point, given by weights at vertices, to the parts of ``faces`` that contain it."""
        parts = [self._parts_of(face) for face in faces.tolist()]
        parent = np.repeat(faces, [len(part) for part in parts])
        part = np.concatenate(parts)
        corners = self.original.faces[parent].tolist()
        local = np.array([[weights.get(corner, 0.0) for corner in row] for row in corners])
        local = local.reshape(-1, 3)
        if self.corners is not None and len(part):
            matrix = self.corners[part].transpose(0, 2, 1)
            local = np.linalg.solve(matrix, local[..., None])[..., 0]
            inside = local.min(axis=1) >= -tolerances.ROUNDED
            part, local = part[inside], local[inside]
            local = np.where(local < tolerances.ROUNDED, 0.0, local)
            local /= local.sum(axis=1, keepdims=True)
        return SurfacePoints(part, local)

    def common_component(self, representations: Representations) -> int | None:
        """The component of largest area that contains all points, or None if there is none."""
        component = self.mesh.face_component
        common = set.intersection(
            *(set(component[point.faces].tolist()) for point in representations)
        )
        areas = np.bincount(component, weights=self.mesh.face_areas)
        return max(common, key=lambda label: float(areas[label]), default=None)

    def points(self, representations: Representations, component: int) -> SurfacePoints:
        """Choose the first representation of each point in one component."""
        there = self.mesh.face_component == component
        return joined([point[np.flatnonzero(there[point.faces])[:1]] for point in representations])

    def weights_to(self, weights: FloatArray) -> FloatArray:
        """Map weights at vertices of the original, (V,), to the mesh.

        Where vertices are joined, the greatest weight counts.
        """
        if not self.differs:
            return weights
        checkpoint()
        at_place = np.zeros(self.original_place.max() + 1)
        np.maximum.at(at_place, self.original_place, weights)
        at_corners = at_place[self.original_place[self.original.faces[self.face]]]
        if self.corners is not None:
            at_corners = np.einsum("fcd,fd->fc", self.corners, at_corners)
        result = np.zeros(len(self.mesh.vertices))
        np.maximum.at(result, self.mesh.faces, at_corners)
        return result

    def curve_back(self, curve: SurfaceCurve, points: SurfacePoints) -> SurfaceCurve:
        """Map a simple curve on the mesh to a simple curve on the original.

        Strands that pass different copies of a vertex, or of a point on an edge, are separated
        there. Where faces were removed, the curve gets further points on their edges.

        Parameters
        ----------
        curve : SurfaceCurve
        points : SurfacePoints
            The control points on the original, in any order.
        """
        if not self.differs:
            return curve
        polyline = SurfacePoints(curve.faces, curve.barycentric)
        index = curve.control_index
        if self._has_copies:
            passed = index[index >= 0]
            polyline, number = separated(self.mesh, self.place, polyline, curve.closed, passed)
            index = np.where(index >= 0, number[index], -1)
        barycentric = polyline.barycentric
        if self.corners is not None:
            barycentric = np.einsum("nc,ncd->nd", barycentric, self.corners[polyline.faces])
            barycentric /= barycentric.sum(axis=1, keepdims=True)
        polyline = SurfacePoints(self.face[polyline.faces], barycentric)
        exact = self._exact_points(polyline, index, points)
        if self._removed is not None:
            polyline, number = self._removed.led_across(polyline, curve.closed, exact)
            index = np.where(index >= 0, number[index], -1)
        else:
            for place, point in exact.items():
                polyline = joined([polyline[:place], point, polyline[place + 1 :]])
        passed = index[index >= 0]
        polyline, number = without_backtracking(self.original, polyline, passed, curve.closed)
        index = np.where(index >= 0, number[index], -1)
        return curve_on_mesh(
            self.original, curve.closed, polyline.faces, polyline.barycentric, index
        )

    def _exact_points(
        self, polyline: SurfacePoints, index: IntArray, points: SurfacePoints
    ) -> dict[int, SurfacePoints]:
        """Control points at which vertices or faces were moved together, by index in a polyline."""
        passed = index[index >= 0]
        given, found = points.positions(self.original), polyline[passed].positions(self.original)
        away = np.linalg.norm(found[:, None] - given, axis=2)
        nearest = away.argmin(axis=1)
        exact = {}
        for rank in np.flatnonzero(away.min(axis=1) > tolerances.ROUNDED * self.original.diagonal):
            exact[int(passed[rank])] = points[nearest[[rank]]]
        return exact

    def curve_to(self, curve: SurfaceCurve) -> SurfaceCurve | None:
        """Map a curve on the original to the mesh; None if the mesh lacks a part of the curve."""
        if not self.differs:
            return curve
        if self.corners is None and not self.removed[curve.faces].any():
            whole = np.full(len(self.original.faces), -1)
            whole[self.face] = np.arange(len(self.face))
            faces, barycentric = whole[curve.faces], curve.barycentric
        else:
            faces, barycentric = self._parts_of_segments(curve)
        if (faces < 0).any():
            return None
        return curve_on_mesh(self.mesh, curve.closed, faces, barycentric, curve.control_index)

    def _parts_of_segments(self, curve: SurfaceCurve) -> tuple[IntArray, FloatArray]:
        """Face of the mesh that contains each segment, or -1; coordinates of its start there.

        A segment in a removed face has no length, or almost; any face at its start serves.
        """
        n = len(curve.faces)
        faces, barycentric = np.full(n, -1), np.zeros((n, 3))
        following = np.append(np.arange(1, n), 0 if curve.closed else n - 1)
        ends = weights_in_faces(
            self.original, curve.faces[following], curve.barycentric[following], curve.faces
        )
        for place, face in enumerate(curve.faces.tolist()):
            if self.removed[face]:
                there = self._at_position(curve.points[[place]])
                if len(there):
                    faces[place], barycentric[place] = there.faces[0], there.barycentric[0]
                continue
            parts = self._parts_of(face)
            both = np.stack([curve.barycentric[place], ends[place]])
            local = np.broadcast_to(both, (len(parts), 2, 3))
            if self.corners is not None:
                local = local @ np.linalg.inv(self.corners[parts])
            least = local.min(axis=(1, 2))
            if len(parts) and least.max() >= -tolerances.SNAP:
                best = int(least.argmax())
                start = np.where(local[best, 0] < tolerances.ROUNDED, 0.0, local[best, 0])
                faces[place], barycentric[place] = parts[best], start / start.sum()
        return faces, barycentric

    def field_back(self, values: FloatArray) -> FloatArray:
        """Map level-set values at the vertices of the mesh, (v,), to the original.

        Of several copies of a vertex, the one nearest to the curve counts. Vertices that the mesh
        lacks get the greatest value.
        """
        used = np.flatnonzero(self.mesh.referenced)
        order = used[np.argsort(-np.abs(values[used]), kind="stable")]
        at_place = np.full(max(self.place.max(), self.original_place.max()) + 1, np.inf)
        at_place[self.place[order]] = values[order]
        result = at_place[self.original_place]
        result[np.isinf(result)] = values.max()
        return result

    @cached_property
    def _removed(self) -> RemovedFaces | None:
        """The removed faces, which curves on the original have to cross, or None."""
        if not self.removed.any():
            return None
        return RemovedFaces(self.original, self.joined[self.original.faces], self.removed)

    @cached_property
    def _has_copies(self) -> bool:
        """Whether any point of the original corresponds to several vertices of the mesh."""
        return bool((np.bincount(self.place) > 1).any())

    def _parts_of(self, face: int) -> IntArray:
        """The faces of the mesh that make up a face of the original."""
        order, begin = self._by_original
        return order[begin[face] : begin[face + 1]]

    @cached_property
    def _by_original(self) -> tuple[IntArray, IntArray]:
        """Faces of the mesh sorted by original face, and where each original face begins."""
        order = np.argsort(self.face, kind="stable")
        counts = np.bincount(self.face, minlength=len(self.original.faces))
        return order, np.cumsum([0, *counts])


def _faces_holding(mesh: Mesh, points: SurfacePoints) -> list[IntArray]:
    """The faces that contain each point, the given face first."""
    found = []
    for face, barycentric in zip(points.faces, points.barycentric, strict=True):
        shared = mesh.faces_with(mesh.faces[face][barycentric > 0.0])
        found.append(np.append(face, shared[shared != face]))
    return found
