"""The region that a curve encloses: the faces and vertices on one side of it.

The sides are determined by the rule of `geometry.sides`, like the sign of a design's level set
(`level_set.curve_field`). That sign is found for vertices; here the sides are found for faces of
the cut mesh, so a region that contains no input vertex is found as well.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..errors import ControlPointError, CurveError
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.mesh import Mesh, MeshLike, as_mesh, sides_among
from ..geometry.sides import two_sides
from ..geometry.surface_points import SurfacePoints, locate_points
from .cut import CutMesh


@dataclass(frozen=True)
class Region:
    """One side of a curve.

    Attributes
    ----------
    cut_faces : (F',) bool array
        Whether each face of the cut mesh is inside.
    cut_vertices : (V + n,) bool array
        Whether each vertex of the cut mesh is inside or on the curve.
    share : (F,) float array
        Fraction of the area of each input face that is inside, in [0, 1].
    area : float
        Area of the region, in square mesh units.
    """

    cut_faces: BoolArray
    cut_vertices: BoolArray
    share: FloatArray
    area: float

    @property
    def faces(self) -> BoolArray:
        """Whether more than half of the area of each input face is inside, (F,)."""
        return self.share > 0.5

    def complement(self, mesh: Mesh, cut: CutMesh) -> Region:
        """The other side of the curve, on the same component of the mesh.

        Parameters
        ----------
        mesh : Mesh
            The mesh that was cut.
        cut : CutMesh
            The cut mesh from which this region was computed.
        """
        return _region(mesh, cut, (_sides(cut) != 0) & ~self.cut_faces)

    def vertices(self, mesh: Mesh) -> BoolArray:
        """Whether each input vertex is inside or on the curve, (V,).

        Parameters
        ----------
        mesh : Mesh
            The mesh that was cut.
        """
        return self.cut_vertices[: len(mesh.vertices)]


def enclosed_region(
    mesh: MeshLike, cut: CutMesh, side_of: ArrayLike | SurfacePoints | None = None
) -> Region:
    """The region that a curve encloses.

    Parameters
    ----------
    mesh : Mesh
        The mesh that was cut.
    cut : CutMesh
        From `cut_mesh`.
    side_of : (1,) int array_like, (1, 3) float array_like or SurfacePoints, optional
        A point in the region: a vertex index, a point on the surface, or a face with barycentric
        coordinates. By default the region is the side with the smaller area.

    Returns
    -------
    Region
        The region, without components of the mesh that are not connected to the curve.

    Raises
    ------
    CurveError
        If the curve bounds no region.
    ControlPointError
        If ``side_of`` is not a single point, lies on the curve, or is not connected to the curve.
    """
    mesh = as_mesh(mesh)
    side = _sides(cut)
    areas = cut.mesh.face_areas
    if side_of is not None:
        inside = side == _side_at(mesh, cut, side, side_of)
    else:
        one, other = areas[side == 1].sum(), areas[side == -1].sum()
        # All faces may be on one side: the curve then follows the boundary.
        inside = side == (1 if other == 0.0 or 0.0 < one < other else -1)
    return _region(mesh, cut, inside)


def _region(mesh: Mesh, cut: CutMesh, inside: BoolArray) -> Region:
    """The region that consists of some faces of the cut mesh."""
    areas = cut.mesh.face_areas
    vertices = np.zeros(len(cut.vertices), dtype=bool)
    vertices[cut.faces[inside]] = True
    n_faces = len(mesh.faces)
    within = np.bincount(cut.source_face, areas * inside, n_faces)
    whole = np.bincount(cut.source_face, areas, n_faces)
    # For faces without area, the fraction of their parts is used instead.
    number = np.bincount(cut.source_face, inside, n_faces) / np.bincount(cut.source_face)
    share = np.where(whole > 0.0, within / np.where(whole > 0.0, whole, 1.0), number)
    return Region(inside, vertices, share, float(areas[inside].sum()))


def _sides(cut: CutMesh) -> IntArray:
    """1 or -1 for faces that are connected to the curve, 0 for other faces, (F',)."""
    part, side = two_sides(len(cut.faces), *cut.adjacent_faces)
    beside = sides_among(cut.faces, cut.chain_edges).reshape(-1, 3).any(axis=1)
    with_curve = np.isin(part, part[beside])
    if (side == 0)[with_curve].any():
        closed = "It is closed, but runs around a handle, a tube or a Möbius strip"
        reason = closed if cut.closed else "It is open"
        raise CurveError(
            f"curve bounds no region: its two sides are connected on the surface. {reason}; cut "
            "the mesh along it instead, or design a closed curve that encloses a part of the "
            "surface"
        )
    return np.where(with_curve, side, 0)


def _side_at(mesh: Mesh, cut: CutMesh, side: IntArray, side_of: ArrayLike | SurfacePoints) -> int:
    """The side on which a point lies."""
    point = locate_points(mesh, side_of, "side_of")
    if len(point) != 1:
        raise ControlPointError(f"side_of has {len(point)} points; pass one")
    parts = np.flatnonzero(cut.source_face == point.faces[0])
    weights = cut.corner_weights(mesh)[parts]
    # Coordinates in each part of the face. The point lies in the part with the greatest minimum.
    inside = np.linalg.solve(weights.transpose(0, 2, 1), point.barycentric[:, :, None])
    least = inside.min(axis=1).ravel()
    sides = np.unique(side[parts[least >= least.max() - 1e-9]])
    if len(sides) > 1:
        raise ControlPointError("side_of lies on the curve; choose a point beside it")
    if sides[0] == 0:
        raise ControlPointError(
            "side_of lies on a part of the mesh that is not connected to the curve; choose a point "
            "on the curve's own part"
        )
    return int(sides[0])
