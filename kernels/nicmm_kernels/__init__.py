# SPDX-License-Identifier: GPL-3.0-or-later
"""Compiled kernels of NICMM Curves: the loops over nodes and faces that NumPy would make slow.

All functions take NumPy arrays, check them, and call a library written in C. That library is part
of the installed package; there is one for every platform, and it does not depend on the version of
Python. While it computes, other threads of Python run.
"""

from .crossings import meeting_segments, polyline_crossings
from .delaunay_flips import flip_diagonals
from .distinct_curves import distinct_curves
from .edge_paths import (
    EdgeGraphArrays,
    distances_along_edges,
    paths_along_edges,
    points_on_edge_paths,
)
from .hops import FoundHops, HopPlaces, surface_hops
from .least_sums import least_sums
from .legs import PathArrays, best_legs, cell_sets, distinct_routes
from .level_refinement import LevelLimits, PartArrays, refine_at_level
from .levels import (
    CurveArrays,
    CurveRelaxation,
    LevelOutcome,
    LevelRules,
    LevelState,
    PlacementRules,
    place_on_polyline,
)
from .library import KernelError, MissingLibraryError
from .matrix_product import matrix_product
from .mesh_measures import area_vectors, connected_components, edge_lengths
from .nearest_places import nearest_places
from .node_traces import StepLimits, trace_polyline, trace_steps
from .nodes import NodeArrays, SpacingRules, SurfaceArrays, even_places, place_nodes
from .relaxation import BatchRules, relax_curves
from .segment_distances import SegmentPaths, TooManyWindowsError
from .steps import (
    ContactRules,
    EnergyRules,
    Linearised,
    RelaxationRules,
    StepRules,
    conormal_derivatives,
    damped_step,
    find_contacts,
)
from .traced_places import TraceArrays, places_on_traces, segment_ends
from .traces import MeshArrays, TraceLimits, trace_between, trace_from
from .turning_paths import turning_paths
from .uncrossing import UncrossingRules, remove_crossings, reordered

__all__ = [
    "BatchRules",
    "ContactRules",
    "CurveArrays",
    "CurveRelaxation",
    "EdgeGraphArrays",
    "EnergyRules",
    "FoundHops",
    "HopPlaces",
    "KernelError",
    "LevelLimits",
    "LevelOutcome",
    "LevelRules",
    "LevelState",
    "Linearised",
    "MeshArrays",
    "MissingLibraryError",
    "NodeArrays",
    "PartArrays",
    "PathArrays",
    "PlacementRules",
    "RelaxationRules",
    "SegmentPaths",
    "SpacingRules",
    "StepLimits",
    "StepRules",
    "SurfaceArrays",
    "TraceArrays",
    "TooManyWindowsError",
    "TraceLimits",
    "UncrossingRules",
    "area_vectors",
    "best_legs",
    "cell_sets",
    "connected_components",
    "conormal_derivatives",
    "damped_step",
    "distances_along_edges",
    "distinct_curves",
    "distinct_routes",
    "edge_lengths",
    "even_places",
    "find_contacts",
    "flip_diagonals",
    "least_sums",
    "matrix_product",
    "meeting_segments",
    "nearest_places",
    "paths_along_edges",
    "place_nodes",
    "place_on_polyline",
    "places_on_traces",
    "points_on_edge_paths",
    "polyline_crossings",
    "refine_at_level",
    "relax_curves",
    "remove_crossings",
    "reordered",
    "segment_ends",
    "surface_hops",
    "trace_between",
    "trace_from",
    "trace_polyline",
    "trace_steps",
    "turning_paths",
]
