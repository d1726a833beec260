"""NICMM Curves: smooth curves on triangle meshes that pass exactly through control points.

The entry point is `design_curve`; `design.py` lists the stages in order. The modules behind the
public names are imported on first use, so `nicmm_core.options` can be imported without loading the
libraries that the other modules need.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .design import design_curve as design_curve
    from .design import feature_loop as feature_loop
    from .design import fit_stroke as fit_stroke
    from .design import mirrored as mirrored
    from .design import offset_curve as offset_curve
    from .design_result import Design as Design
    from .designer import Designer as Designer
    from .errors import ArgumentError as ArgumentError
    from .errors import ControlPointError as ControlPointError
    from .errors import CurveError as CurveError
    from .errors import MeshError as MeshError
    from .errors import MissingPackageError as MissingPackageError
    from .errors import NicmmError as NicmmError
    from .errors import UnreachableError as UnreachableError
    from .geometry.curve import SurfaceCurve as SurfaceCurve
    from .geometry.mesh import Mesh as Mesh
    from .geometry.mesh import MeshLike as MeshLike
    from .geometry.mesh import as_mesh as as_mesh
    from .geometry.surface_points import SurfacePoints as SurfacePoints
    from .io.adapters import from_meshio as from_meshio
    from .io.adapters import from_open3d as from_open3d
    from .io.files import read_curve as read_curve
    from .io.files import read_mesh as read_mesh
    from .io.files import write_curve as write_curve
    from .io.files import write_mesh as write_mesh
    from .maps.feature_maps import curvature_map as curvature_map
    from .maps.feature_maps import edge_map as edge_map
    from .maps.feature_maps import principal_curvatures as principal_curvatures
    from .maps.feature_maps import sharp_edge_map as sharp_edge_map
    from .maps.feature_maps import sharp_edges as sharp_edges
    from .maps.feature_maps import value_map as value_map
    from .outputs.cut import CutMesh as CutMesh
    from .outputs.cut import cut_mesh as cut_mesh
    from .outputs.parts import PartedMesh as PartedMesh
    from .outputs.parts import part_mesh as part_mesh
    from .outputs.region import Region as Region
    from .outputs.region import enclosed_region as enclosed_region
    from .plotting import plot as plot
    from .projection import nearest_points as nearest_points
    from .status import Status as Status

_NAMES = {
    "design": (
        "design_curve",
        "feature_loop",
        "fit_stroke",
        "mirrored",
        "offset_curve",
    ),
    "design_result": ("Design",),
    "designer": ("Designer",),
    "errors": (
        "ArgumentError",
        "ControlPointError",
        "CurveError",
        "MeshError",
        "MissingPackageError",
        "NicmmError",
        "UnreachableError",
    ),
    "geometry.curve": ("SurfaceCurve",),
    "geometry.mesh": (
        "Mesh",
        "MeshLike",
        "as_mesh",
    ),
    "geometry.surface_points": ("SurfacePoints",),
    "io.adapters": (
        "from_meshio",
        "from_open3d",
    ),
    "io.files": (
        "read_curve",
        "read_mesh",
        "write_curve",
        "write_mesh",
    ),
    "maps.feature_maps": (
        "curvature_map",
        "edge_map",
        "principal_curvatures",
        "sharp_edge_map",
        "sharp_edges",
        "value_map",
    ),
    "outputs.cut": (
        "CutMesh",
        "cut_mesh",
    ),
    "outputs.parts": (
        "PartedMesh",
        "part_mesh",
    ),
    "outputs.region": (
        "Region",
        "enclosed_region",
    ),
    "plotting": ("plot",),
    "projection": ("nearest_points",),
    "status": ("Status",),
}
"""The public names of the package, by the module that defines them."""

_MODULE = {name: module for module, names in _NAMES.items() for name in names}

__all__ = sorted(_MODULE)


def __getattr__(name: str) -> Any:
    if name not in _MODULE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(f".{_MODULE[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
