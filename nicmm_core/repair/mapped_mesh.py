"""A repaired mesh on which curves are computed, and the map between it and the original.

Each face of the repaired mesh is a face of the original or a part of one. So its points and curves
are points and curves on the original, which is not changed. `nonmanifold` creates such meshes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry import tolerances
from ..geometry.array_types import FloatArray, IntArray
from ..geometry.curve import SurfaceCurve, points_of, with_points
from ..geometry.mesh import Mesh
from ..geometry.surface_points import SurfacePoints, in_faces, joined
from ..progress import checkpoint
from .clean_surface import CleanSurface
from .face_parts import FaceParts
from .removed_faces import points_at
from .strand_separation import separated


@dataclass(frozen=True, eq=False)
class MappedMesh:
    """A mesh made from the clean surface of a given mesh, and the map between both.

    The surface is made a manifold, each face of which is a part of a given face. Each is also a
    part of a face of the mesh, which lacks vertices that divide straight edges.

    Attributes
    ----------
    clean : CleanSurface
        The clean surface of the given mesh.
    manifold : Mesh
        The manifold; the same object as the given mesh if nothing differs.
    in_given : FaceParts
        The faces of the manifold as parts of the given ones.
    mesh : Mesh
        The mesh, with the same vertices; the manifold if no edge becomes whole again.
    in_mesh : FaceParts
        The faces of the manifold as parts of those of the mesh.
    place : (v,) int array
        Index of the place of each vertex, equal for vertices that are one point of the given mesh.
    origin : (3,) float array
        Origin of the mesh's coordinates, in the space of the given mesh.
    moved : bool
        Whether vertices were moved to give faces an area, or to keep copies of a vertex apart.
    repairs : dict of str to int
        How often each repair was made, without those that were not.
    component : int
        The component of the mesh to which points are mapped.
    """

    clean: CleanSurface
    manifold: Mesh
    in_given: FaceParts
    mesh: Mesh
    in_mesh: FaceParts
    place: IntArray
    origin: FloatArray
    moved: bool
    repairs: dict[str, int]
    component: int = 0

    @property
    def original(self) -> Mesh:
        """The given mesh."""
        return self.clean.original

    @property
    def differs(self) -> bool:
        """Whether the mesh is not the original itself."""
        return self.mesh is not self.original

    def in_original(self, positions: FloatArray) -> FloatArray:
        """Map positions on the mesh, (n, 3), to the given mesh."""
        return positions + self.origin

    def from_original(self, positions: FloatArray) -> FloatArray:
        """Map positions in the space of the given mesh, (n, 3), to that of the mesh."""
        return positions - self.origin

    def representations(self, points: SurfacePoints) -> list[SurfacePoints]:
        """For each point of the given mesh, the same point in all faces of the mesh that hold it.

        Those in parts of its given face come first.
        """
        given, removed = self.original, self.clean.removed
        around = []
        for face, weights in zip(points.faces, points.barycentric, strict=True):
            faces = given.faces_with(given.faces[face][weights > 0.0])
            around.append(np.append(face, faces[faces != face]))
        counts = np.array([len(faces) for faces in around], dtype=np.int64)
        point = np.repeat(np.arange(len(points)), counts)
        held = in_faces(given, points[point], np.concatenate([points.faces[:0], *around]))
        there, which = self.in_given.in_parts(held)
        there, point = self.in_mesh.in_parents(there), point[which]
        found = [there[point == number] for number in range(len(points))]
        for number in np.flatnonzero([removed[faces].any() for faces in around]):
            position = points[number : number + 1].positions(given)
            found[number] = joined([found[number], self._at_position(position)])
        return found

    def _at_position(self, position: FloatArray) -> SurfacePoints:
        """A point of a removed face, given by its position, (1, 3), in every face that holds it."""
        farthest = tolerances.ON_SURFACE * self.original.diagonal
        return points_at(self.mesh, position - self.origin, farthest)

    def common_component(self, points: SurfacePoints) -> int | None:
        """The component of largest area that contains all points, or None if there is none."""
        component = self.mesh.face_component
        if not self.differs:
            first, *others = np.unique(component[points.faces]).tolist()
            return None if others else first
        common = set.intersection(
            *(set(component[point.faces].tolist()) for point in self.representations(points))
        )
        areas = np.bincount(component, weights=self.mesh.face_areas)
        return max(common, key=lambda label: float(areas[label]), default=None)

    def points_to(self, points: SurfacePoints) -> SurfacePoints:
        """Map points of the given mesh to the component, each to its first representation."""
        found = []
        for point in self.representations(points):
            here = self.mesh.face_component[point.faces] == self.component
            found.append(point[np.flatnonzero(here)[:1]])
        return joined(found)

    def weights_to(self, weights: FloatArray) -> FloatArray:
        """Map weights at vertices of the given mesh, (V,), to the mesh.

        Where vertices are joined, the greatest weight counts.
        """
        checkpoint()
        place = self.clean.place
        at_place = np.zeros(place.max() + 1)
        np.maximum.at(at_place, place, weights)
        at_corners = at_place[place[self.original.faces[self.in_given.parent]]]
        at_corners = np.einsum("fcd,fd->fc", self.in_given.corners, at_corners)
        result = np.zeros(len(self.mesh.vertices))
        np.maximum.at(result, self.manifold.faces, at_corners)
        return result

    def field_back(self, values: FloatArray) -> FloatArray:
        """Map level-set values at the vertices of the mesh, (v,), to the given mesh.

        Of several copies of a vertex, the one nearest to the curve counts. Vertices that the mesh
        lacks get the greatest value.
        """
        at_corners = values[self.mesh.faces[self.in_mesh.parent]]
        values = values.copy()
        values[self.manifold.faces] = np.einsum("fcd,fd->fc", self.in_mesh.corners, at_corners)
        used = np.flatnonzero(self.manifold.referenced)
        order = used[np.argsort(-np.abs(values[used]), kind="stable")]
        at_place = np.full(max(self.place.max(), self.clean.place.max()) + 1, values.max())
        at_place[self.place[order]] = values[order]
        return at_place[self.clean.place]

    def curve_to(self, curve: SurfaceCurve) -> SurfaceCurve | None:
        """Map a curve on the given mesh to the mesh; None if that lacks a part of the curve."""
        points, segment = self.in_given.through(self.original, curve)
        pieces = [self.in_mesh.in_parents(points)]
        # A segment in a face without area has no length, or almost; any face at its start serves.
        flat = self.clean.removed[curve.faces] | np.isin(curve.faces, self.in_given.parent)
        flat[segment] = False
        for point in np.flatnonzero(flat):
            pieces.append(self._at_position(curve.points[[point]])[:1])
            segment = np.append(segment, np.full(len(pieces[-1]), point))
        order = np.argsort(segment, kind="stable")
        found, number = np.unique(segment[order], return_index=True)
        if len(found) < len(curve.faces):
            return None
        return with_points(self.mesh, curve, joined(pieces)[order], number)

    def curve_back(self, curve: SurfaceCurve) -> SurfaceCurve:
        """Map a simple curve on the mesh to the given mesh, without the faces that were removed.

        Strands that pass different copies of a vertex, or of a point on an edge, are separated
        there.
        """
        if self.mesh is not self.manifold:
            points, segment = self.in_mesh.through(self.mesh, curve)
            number = np.searchsorted(segment, np.arange(len(curve.faces)))
            curve = with_points(self.manifold, curve, points, number)
        if (self.place != np.arange(len(self.place))).any():
            passed = curve.control_index[curve.control_index >= 0]
            apart = separated(self.manifold, self.place, points_of(curve), curve.closed, passed)
            curve = with_points(self.manifold, curve, *apart)
        return with_points(self.original, curve, self.in_given.in_parents(points_of(curve)))
