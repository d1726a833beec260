"""Places of a polygon that points snap to: vertices, middles of edges, edges and the centre."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .array_types import FloatArray, IntArray
from .mesh import Mesh, side_keys
from .surface_points import SurfacePoints, nearest_points
from .tolerances import TINY


@dataclass(frozen=True)
class SnapTargets:
    """Places of a polygon, which consists of triangles of a mesh.

    Attributes
    ----------
    vertices : SurfacePoints
        Its m vertices.
    midpoints : SurfacePoints
        The middles of its m edges.
    edges : (m, 2, 3) float array
        Positions of the ends of these edges.
    edge_faces : (m,) int array
        The triangle at each of them.
    edge_weights : (m, 2, 3) float array
        Barycentric coordinates of the ends of each in this triangle.
    centre : SurfacePoints
        The mean of the vertices, moved onto the polygon.
    """

    vertices: SurfacePoints
    midpoints: SurfacePoints
    edges: FloatArray
    edge_faces: IntArray
    edge_weights: FloatArray
    centre: SurfacePoints

    def on_edges(self, origin: FloatArray, direction: FloatArray) -> SurfacePoints:
        """The point of each edge nearest to a line.

        Parameters
        ----------
        origin, direction : (3,) float array
            A point of the line, such as the eye, and its direction.
        """
        along = direction / max(float(np.linalg.norm(direction)), TINY)
        start, way = self.edges[:, 0] - origin, self.edges[:, 1] - self.edges[:, 0]
        # Both are projected along the line.
        start, way = (each - (each @ along)[:, None] * along for each in (start, way))
        squared = np.maximum((way * way).sum(axis=1), TINY)
        share = (-(start * way).sum(axis=1) / squared).clip(0.0, 1.0)[:, None]
        weights = (1.0 - share) * self.edge_weights[:, 0] + share * self.edge_weights[:, 1]
        return SurfacePoints(self.edge_faces, weights)


def snap_targets(mesh: Mesh, triangles: IntArray) -> SnapTargets:
    """The targets of a polygon.

    Parameters
    ----------
    mesh : Mesh
    triangles : (t,) int array
        The triangles that it consists of. Edges between two of them are not edges of the polygon.
    """
    faces = mesh.faces[triangles]
    keys = side_keys(faces)
    _, first, count = np.unique(keys, return_index=True, return_counts=True)
    triangle, side = np.divmod(np.sort(first[count == 1]), 3)
    ends = np.stack([np.eye(3)[(side + 1) % 3], np.eye(3)[(side + 2) % 3]], axis=1)
    face = triangles[triangle]
    corners = mesh.vertices[mesh.faces[face]]
    vertex = faces[triangle, (side + 1) % 3]
    _, once = np.unique(vertex, return_index=True)
    middle = corners[once, (side[once] + 1) % 3].mean(axis=0)
    nearest, _ = nearest_points(mesh, np.repeat(middle[None], len(triangles), axis=0), triangles)
    away = np.linalg.norm(nearest.positions(mesh) - middle, axis=1)
    return SnapTargets(
        vertices=SurfacePoints(face[once], ends[once, 0]),
        midpoints=SurfacePoints(face, ends.mean(axis=1)),
        edges=np.einsum("nec,ncd->ned", ends, corners),
        edge_faces=face,
        edge_weights=ends,
        centre=nearest[np.array([away.argmin()])],
    )
