"""Maps a curve from the coarse mesh to the fine mesh.

Nodes of the coarse curve are projected to the fine faces of their cells and joined
(`relaxation.simple_curve`). Cells follow the surface, so a curve on one side of a thin limb stays
on that side.
"""

from __future__ import annotations

import numpy as np

from ..geometry.surface_points import SurfacePoints
from ..relaxation.curve_nodes import CurveSurface
from ..relaxation.discrete_curve import DiscreteCurve
from ..relaxation.simple_curve import simple_curve
from .coarse_mesh import CoarseMesh


def nodes_on_fine_mesh(
    surface: CurveSurface, coarse: CoarseMesh, coarse_curve: DiscreteCurve, controls: SurfacePoints
) -> DiscreteCurve | None:
    """The curve on the fine mesh through the nodes of a coarse curve; None if it is not simple.

    Parameters
    ----------
    surface : CurveSurface
        Surface of the fine mesh.
    coarse : CoarseMesh
    coarse_curve : DiscreteCurve
        A curve on the coarse mesh, of which only the nodes are used.
    controls : SurfacePoints
        k points of the fine mesh, in the order in which the curve visits them.
    """
    fine, places = surface.mesh, coarse_curve.nodes.places
    cell = coarse.mesh.faces[places.faces, places.barycentric.argmax(axis=1)]

    return simple_curve(
        surface,
        coarse.nearest_fine_points(fine, places.positions(coarse.mesh), cell),
        coarse_curve.control_nodes,
        controls,
        coarse_curve.closed,
        # Normals of the coarse mesh, since they ignore small dents that a trace has to cross.
        normals=coarse_curve.nodes.normals,
        corners=np.isin(coarse_curve.control_nodes, coarse_curve.corner_nodes),
    )
