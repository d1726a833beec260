"""NICMM: smooth curves on triangle meshes by a physics-informed network.

The main path is `design.design_curve`; `design.py` names the stages in order.
"""

from .design import Designer, design_curve
from .design_result import Design, Status
from .errors import (
    ArgumentError,
    ControlPointError,
    CurveError,
    MeshError,
    MissingPackageError,
    NicmmError,
    UnreachableError,
)
from .geometry.curve import SurfaceCurve
from .geometry.mesh import Mesh
from .geometry.surface_points import SurfacePoints
from .maps.feature_maps import (
    curvature_map,
    edge_map,
    principal_curvatures,
    sharp_edge_map,
    sharp_edges,
    value_map,
)
from .outputs.cut import CutMesh, cut_mesh
from .outputs.parts import PartedMesh, part_mesh
from .outputs.region import Region, enclosed_region

__all__ = [
    "ArgumentError",
    "ControlPointError",
    "CurveError",
    "CutMesh",
    "Design",
    "Designer",
    "Mesh",
    "MeshError",
    "MissingPackageError",
    "NicmmError",
    "PartedMesh",
    "Region",
    "Status",
    "SurfaceCurve",
    "SurfacePoints",
    "UnreachableError",
    "curvature_map",
    "cut_mesh",
    "design_curve",
    "edge_map",
    "enclosed_region",
    "part_mesh",
    "principal_curvatures",
    "sharp_edge_map",
    "sharp_edges",
    "value_map",
]
