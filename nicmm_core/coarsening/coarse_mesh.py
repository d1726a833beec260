"""Builds a coarse mesh of the same surface: the dual of geodesic Voronoi cells.

Some vertices of the fine mesh are chosen as seeds, spread about evenly. Every vertex belongs to the
cell of the seed that is nearest to it along edges. Three seeds whose cells meet in a face form a
coarse face. Distances are measured along the surface, so two sheets that come close stay separate.
The only requirement on the mesh is that it is connected. Dijkstra's algorithm finds the cells.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import nicmm_kernels
import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from ..errors import MeshError, UnreachableError
from ..geometry import tolerances
from ..geometry.array_types import FloatArray, IntArray
from ..geometry.mesh import Mesh, corners_differ, edge_lengths
from ..geometry.numbering import principal_frame, uniform_hash
from ..geometry.sampling import CANDIDATES, PACKING, spread_vertices
from ..geometry.surface_points import SurfacePoints
from ..progress import checkpoint
from ..repair.degenerate_faces import degenerate_faces, perturbed

TIE_BREAK = 1e-6
"""Greatest relative change of the length of an edge due to each of its ends."""


@dataclass(frozen=True)
class CoarseMesh:
    """A coarse mesh of a connected mesh, with its vertices on the fine mesh.

    Attributes
    ----------
    mesh : Mesh
        The coarse mesh, with n vertices.
    seed : (n,) int array
        The fine vertex at which each coarse vertex lies.
    cell : (V,) int array
        The coarse vertex nearest to each fine vertex along edges, -1 for vertices without faces.
    """

    mesh: Mesh
    seed: IntArray
    cell: IntArray

    @cached_property
    def _vertices_of_cells(self) -> sparse.csr_array:
        """Incidence of coarse vertices (rows) and the fine vertices in their cells (columns)."""
        inside = np.flatnonzero(self.cell >= 0)
        entries = (np.ones(len(inside), dtype=np.int8), (self.cell[inside], inside))
        return sparse.csr_array(entries, shape=(len(self.seed), len(self.cell)))

    def greatest_in_cells(self, values: FloatArray) -> FloatArray:
        """The greatest of the weights at fine vertices, (V,), in each cell, shape (n,).

        So no obstacle and no lane is lost.
        """
        greatest = np.full(len(self.seed), -np.inf)
        inside = self.cell >= 0
        np.maximum.at(greatest, self.cell[inside], values[inside])
        return greatest

    def nearest_points(self, fine: Mesh, points: SurfacePoints) -> SurfacePoints:
        """Project points of the fine mesh to the coarse mesh.

        Each point is projected to the nearest coarse face at its cell or at a neighbouring cell.

        Raises
        ------
        UnreachableError
            If a cell has no coarse face.
        """
        corner = fine.faces[points.faces, points.barycentric.argmax(axis=1)]
        cells, group = np.unique(self.cell[corner], return_inverse=True)
        around = self.mesh.faces_near(cells[:, None])
        return _nearest_in_groups(self.mesh, points.positions(fine), group, around)

    def nearest_fine_points(
        self, fine: Mesh, positions: FloatArray, cell: IntArray
    ) -> SurfacePoints:
        """Project positions, (n, 3), each to the fine faces of its cell, (n,).

        Raises
        ------
        UnreachableError
            If a cell has no fine face.
        """
        cells, group = np.unique(cell, return_inverse=True)
        inside = self._vertices_of_cells[cells] @ fine.vertex_faces
        return _nearest_in_groups(fine, positions, group, inside)


def _nearest_in_groups(
    mesh: Mesh, positions: FloatArray, group: IntArray, faces: sparse.csr_array
) -> SurfacePoints:
    """Project positions, (n, 3), each to the faces in the row of its group, (n,).

    Raises
    ------
    UnreachableError
        If a group has no face.
    """
    begins = faces.indptr.astype(np.int64)
    if not np.diff(begins).all():
        raise UnreachableError("a cell of the coarse mesh has no face")
    faces.sort_indices()
    return SurfacePoints(
        *nicmm_kernels.nearest_places(
            mesh.for_kernels,
            np.ascontiguousarray(positions),
            group.astype(np.int64),
            begins,
            faces.indices.astype(np.int64),
            checkpoint,
        )
    )


def build_coarse_mesh(mesh: Mesh, vertex_normals: FloatArray, count: int) -> CoarseMesh:
    """Build the dual of about ``count`` Voronoi cells.

    Parameters
    ----------
    mesh : Mesh
        A connected mesh.
    vertex_normals : (V, 3) float array
        Unit vectors.
    count : int
        Approximate number of cells; strongly curved regions get more.

    Raises
    ------
    MeshError
        If no three cells meet in a face.
    """
    faces, shares = mesh.faces, np.repeat(mesh.face_areas / 3.0, 3)
    areas = np.bincount(faces.ravel(), shares, len(mesh.vertices)).astype(np.float64)
    checkpoint()
    distance = PACKING * np.sqrt(areas.sum() / count)
    frame = principal_frame(mesh.vertices, faces, mesh.face_areas)
    seed = spread_vertices(mesh, frame, vertex_normals, areas, CANDIDATES * count, distance)
    # Lengths are changed slightly, so that no two paths on a grid are equally long. Hashes of
    # positions replace random numbers, so the result does not depend on the numbering.
    chance = uniform_hash(frame.rounded_coordinates(mesh.vertices))
    lengths = edge_lengths(mesh.vertices, mesh.edges)
    lengths *= 1.0 + TIE_BREAK * chance[mesh.edges].sum(axis=1)
    size = len(mesh.vertices)
    graph = sparse.csr_array((lengths, (mesh.edges[:, 0], mesh.edges[:, 1])), shape=(size, size))
    checkpoint()
    _, _, nearest = csgraph.dijkstra(
        graph, directed=False, indices=seed, min_only=True, return_predecessors=True
    )
    # Vertices without faces are not reached, and their cell is -1.
    cell = np.where(nearest < 0, -1, np.searchsorted(seed, nearest))
    corners = cell[faces]
    corners = corners[corners_differ(corners)]
    _, first = np.unique(np.sort(corners, axis=1), axis=0, return_index=True)
    if not len(first):
        raise MeshError("no three cells of the coarse mesh meet in a face")
    return CoarseMesh(_with_areas(Mesh(mesh.vertices[seed], corners[first])), seed, cell)


def _with_areas(mesh: Mesh) -> Mesh:
    """The mesh with area given to degenerate faces: on a grid, three seeds may be collinear."""
    vertices, faces = mesh.vertices, mesh.faces
    short = tolerances.SAME_POSITION * mesh.diagonal
    flat = degenerate_faces(vertices, faces, short)
    if not flat.any():
        return mesh
    origin = vertices[faces[0, 0]]
    return Mesh(origin + perturbed(vertices - origin, faces, short, flat), faces)
