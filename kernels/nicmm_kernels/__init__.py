# SPDX-License-Identifier: GPL-3.0-or-later
"""Compiled kernels of NICMM Curves: the loops over nodes and faces that NumPy would make slow.

All functions take NumPy arrays, check them, and call a library written in C. That library is part
of the installed package; there is one for every platform, and it does not depend on the version of
Python. While it computes, other threads of Python run.
"""

from .library import (
    ContactRules,
    EnergyRules,
    KernelError,
    MeshArrays,
    RelaxationRules,
    SpacingRules,
    StepRules,
    SurfaceArrays,
    TraceLimits,
    even_arcs,
    relax_curves,
    trace_between,
    trace_from,
)

__all__ = [
    "ContactRules",
    "EnergyRules",
    "KernelError",
    "MeshArrays",
    "RelaxationRules",
    "SpacingRules",
    "StepRules",
    "SurfaceArrays",
    "TraceLimits",
    "even_arcs",
    "relax_curves",
    "trace_between",
    "trace_from",
]
