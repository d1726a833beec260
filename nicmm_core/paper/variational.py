"""The variational method: the same energy, with φ at the vertices of a narrow band as unknowns.

The paper compares itself with Zhang et al. ("Versatile curve design by level set with quadratic
convergence", 2024), whose code is not public. This module is the strongest method of that kind
known to us.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import sparse

from ..geometry.array_types import BoolArray, FloatArray
from .level_set_solver import SolverConfig, minimise
from .losses import LossWeights
from .narrow_band import NarrowBand
from .problem import Problem
from .solution import Solution
from .sparse_solver import factorised

CONVERGENCE = SolverConfig()
"""The solver has converged if the loss falls by less than 1e-5 in ten iterations (section 4.5)."""


def solve(
    problem: Problem,
    weights: LossWeights,
    config: SolverConfig = CONVERGENCE,
    watch: Callable[[float, FloatArray], bool] | None = None,
) -> Solution:
    """Minimise the energy from φ₀, see `level_set_solver.minimise`."""
    return minimise(problem, problem.initial_distance, VertexSteps(), weights, config, watch)


class VertexSteps:
    """Steps of the values of φ at the vertices, see `level_set_solver.Steps`."""

    def linearise(
        self,
        band: NarrowBand,
        hessian: sparse.csr_array,
        gradient: FloatArray,
        beside: BoolArray,
    ) -> None:
        """Keep the system of the band."""
        self._band, self._hessian, self._gradient = band, hessian, gradient

    def solve(self, damping: float, held: BoolArray) -> FloatArray:
        """Solve the damped system for the vertices that are not held; others do not change."""
        system = self._hessian + damping * self._band.damping
        self._step = np.zeros(len(self._gradient))
        self._step[~held] = factorised(system[~held][:, ~held])(-self._gradient[~held])
        return self._step.copy()

    def take(self, scale: float) -> FloatArray:
        """A multiple of the step; φ is linear in it."""
        return scale * self._step

    def keep(self) -> None:
        """Nothing depends on the steps taken."""
