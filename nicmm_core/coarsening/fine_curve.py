"""Maps a curve from the coarse mesh to the fine mesh.

Nodes of the coarse curve are projected to the fine faces of their cells and joined
(`relaxation.simple_curve`). Cells follow the surface, so a curve on one side of a thin limb stays
on that side.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..geometry.array_types import IntArray
from ..geometry.mesh import Mesh
from ..geometry.surface_points import SurfacePoints, nearest_points
from ..progress import checkpoint
from ..relaxation.curve_nodes import CurveSurface
from ..relaxation.noded_curve import NodedCurve
from ..relaxation.simple_curve import simple_curve
from .coarse_mesh import CoarseMesh


def nodes_on_fine_mesh(
    surface: CurveSurface, coarse: CoarseMesh, coarse_curve: NodedCurve, controls: SurfacePoints
) -> NodedCurve | None:
    """The curve on the fine mesh through the nodes of a coarse curve; None if it is not simple.

    Parameters
    ----------
    surface : CurveSurface
        Surface of the fine mesh.
    coarse : CoarseMesh
    coarse_curve : NodedCurve
        A curve on the coarse mesh, of which only the nodes are used.
    controls : SurfacePoints
        k points of the fine mesh, in the order in which the curve visits them.
    """
    fine = surface.mesh

    def cells_around(faces: IntArray) -> Iterator[IntArray]:
        cells = np.unique(coarse.cell[fine.faces[faces, 0]])
        for _ in range(3):  # rings in which a path between two nodes is searched for
            cells = coarse.cells_around(cells)
            yield coarse.faces_of_cells(fine, cells)

    return simple_curve(
        surface,
        _nearest_points(fine, coarse, coarse_curve.nodes.places),
        coarse_curve.control_nodes,
        controls,
        coarse_curve.closed,
        # Normals of the coarse mesh, since they ignore small dents that a trace has to cross.
        normals=coarse_curve.nodes.normals,
        neighbourhoods=cells_around,
    )


def _nearest_points(fine: Mesh, coarse: CoarseMesh, points: SurfacePoints) -> SurfacePoints:
    """Coarse points projected to the faces of their cells on the fine mesh."""
    positions = points.positions(coarse.mesh)
    cell = coarse.mesh.faces[points.faces, points.barycentric.argmax(axis=1)]
    faces, barycentric = np.zeros(len(points), np.int64), np.zeros((len(points), 3))
    for one in np.unique(cell).tolist():
        checkpoint()
        here = np.flatnonzero(cell == one)
        found, _ = nearest_points(
            fine, positions[here], coarse.faces_of_cells(fine, np.array([one]))
        )
        faces[here], barycentric[here] = found.faces, found.barycentric
    return SurfacePoints(faces, barycentric)
