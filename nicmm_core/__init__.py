"""NICMM: smooth curves on triangle meshes by a physics-informed network.

The main path is `design.design_curve`; `design.py` names the stages in order.
"""

from .curve import SurfaceCurve
from .design import Designer, design_curve
from .design_result import Design, Status
from .errors import (
    ArgumentError,
    ControlPointError,
    MeshError,
    MissingPackageError,
    NicmmError,
    UnreachableError,
)
from .mesh import Mesh
from .surface_points import SurfacePoints

__all__ = [
    "ArgumentError",
    "ControlPointError",
    "Design",
    "Designer",
    "Mesh",
    "MeshError",
    "MissingPackageError",
    "NicmmError",
    "Status",
    "SurfaceCurve",
    "SurfacePoints",
    "UnreachableError",
    "design_curve",
]
