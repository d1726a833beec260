# SPDX-License-Identifier: GPL-3.0-or-later
"""Compiled kernels of NICMM Curves: the loops over nodes and faces that NumPy would make slow.

All functions take NumPy arrays, check them, and call a library written in C. That library is part
of the installed package; there is one for every platform, and it does not depend on the version of
Python. While it computes, other threads of Python run.
"""

from .crossings import meeting_segments
from .energy import (
    ContactRules,
    EnergyRules,
    Weights,
    balance,
    close_pairs,
    conormal_derivatives,
    damped_step,
    elastic_energy,
    elastic_system,
    find_contacts,
    predicted_decrease,
)
from .library import KernelError, MissingLibraryError
from .node_traces import StepLimits, trace_polyline, trace_steps
from .nodes import NodeArrays, SpacingRules, SurfaceArrays, even_arcs, place_nodes
from .relaxation import RelaxationRules, StepRules, relax_curves
from .traces import MeshArrays, TraceLimits, trace_between, trace_from

__all__ = [
    "ContactRules",
    "EnergyRules",
    "KernelError",
    "MeshArrays",
    "MissingLibraryError",
    "NodeArrays",
    "RelaxationRules",
    "SpacingRules",
    "StepLimits",
    "StepRules",
    "SurfaceArrays",
    "TraceLimits",
    "Weights",
    "balance",
    "close_pairs",
    "conormal_derivatives",
    "damped_step",
    "elastic_energy",
    "elastic_system",
    "even_arcs",
    "find_contacts",
    "meeting_segments",
    "place_nodes",
    "predicted_decrease",
    "relax_curves",
    "trace_between",
    "trace_from",
    "trace_polyline",
    "trace_steps",
]
