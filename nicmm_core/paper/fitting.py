"""Stage 2 (section 4.1): the pretrained network is fitted to one problem, with early stopping.

The paper trains the network further with AdamW. Here each iteration takes a Gauss–Newton step of
the parameters, through the network's tangent kernel: among the changes of φ that the network can
make, the one that lowers the energy most. Only the change of φ by a step counts, so φ may become a
signed distance after each step: what this changes is added to φ₀, which the network corrects.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import linalg, sparse

from ..blas_threads import single_blas_thread
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from .level_set_solver import SolverConfig, minimise
from .losses import LossWeights
from .matrix_product import product
from .narrow_band import NarrowBand
from .network import Network, NetworkInput, corrections, held_attention, level_set, network_input
from .problem import Problem
from .solution import Solution
from .tangent_kernel import kernel, moved, tangent
from .topology import keep_topology

CONVERGENCE = SolverConfig(settling=5, patience=7, relative_tolerance=0.01)
"""The paper stops at "minimal fluctuations" of the energy in the band; here, when it falls by less
than 1 % in seven iterations after the solver has settled. The energy is then within 2 % of that
after 100 iterations on all of 60 sets that did not choose this rule."""

MARKS = 140
"""Number of vertices along whose derivatives the parameters are moved (Nyström's method). With 90
of them curves bend 7 % more; with 180, as much as with these, and the fit takes a tenth longer."""

NEAR_SHARE = 0.6
"""Least fraction of these vertices that lies beside the curve."""

ROUNDING = 1e-7
"""Added to the diagonal of the kernel at the marks, relative to its trace, against rounding. With
1e-6, further marks add nothing: the changes of φ that they allow are the first to be lost."""

STIFFNESS = 100.0
"""Weight that holds a vertex, relative to the median diagonal entry of the Hessian."""


def fit(
    network: Network,
    problem: Problem,
    weights: LossWeights,
    config: SolverConfig = CONVERGENCE,
    watch: Callable[[float, FloatArray], bool] | None = None,
) -> Solution:
    """Fit a network to a problem, see `level_set_solver.minimise`; the network is not changed.

    Single precision suffices, unless the smooth fields of the control points are so broad that
    almost all of the kernel cancels, as with a very large smoothness. Then all is repeated in
    double precision.
    """
    with single_blas_thread():
        try:
            return _fit(network, problem, weights, config, watch, np.float32)
        except linalg.LinAlgError:
            return _fit(network, problem, weights, config, watch, np.float64)


def _fit(
    network: Network,
    problem: Problem,
    weights: LossWeights,
    config: SolverConfig,
    watch: Callable[[float, FloatArray], bool] | None,
    precision: type[np.floating],
) -> Solution:
    """Fit a network in a given precision."""
    parameters = {name: array.astype(precision) for name, array in network.parameters.items()}
    network = Network(network.config, parameters)
    inputs = network_input(problem, network.config, precision)
    steps = NetworkSteps(network, inputs)
    start, _ = keep_topology(
        problem.working, problem.loop, problem.initial_distance, steps.level_set(), problem.bundle
    )
    return minimise(problem, start, steps, weights, config, watch)


class NetworkSteps:
    """Steps of the parameters of a network, see `level_set_solver.Steps`."""

    def __init__(self, network: Network, inputs: NetworkInput) -> None:
        self._network, self._inputs = network, inputs
        self._attention = held_attention(network, inputs)
        self._generator = np.random.default_rng(0)

    def level_set(self) -> FloatArray:
        """φ of the network at all vertices, (n,)."""
        return level_set(self._network, self._inputs, self._attention).astype(float)

    def linearise(
        self,
        band: NarrowBand,
        hessian: sparse.csr_array,
        gradient: FloatArray,
        beside: BoolArray,
    ) -> None:
        """Compute the changes of φ that the parameters can make, and the energy's derivatives."""
        inputs = self._inputs
        n_unknowns, n_controls = len(band.unknowns), len(inputs.control_vertices)
        rows = np.concatenate([band.unknowns, inputs.control_vertices])
        self._response = inputs.response[band.unknowns].astype(float)  # (u, k)
        self._features = inputs.features[rows]
        self._tangent = tangent(self._network, self._features, self._attention)
        marks = self._marks(beside)
        self._columns = np.concatenate([marks, n_unknowns + np.arange(n_controls)])
        of_marks = kernel(self._network, self._tangent, self._columns).astype(float)
        of_marks = of_marks[:n_unknowns] - product(self._response, of_marks[n_unknowns:])
        of_marks = of_marks[:, : len(marks)] - product(
            of_marks[:, len(marks) :], self._response[marks].T
        )
        at_marks = 0.5 * (of_marks[marks] + of_marks[marks].T)
        at_marks[np.diag_indices_from(at_marks)] += ROUNDING * np.trace(at_marks)
        self._root = linalg.cholesky(at_marks, lower=True)  # (s, s)
        self._changes = linalg.solve_triangular(self._root, of_marks.T, lower=True).T  # (u, s)
        self._hessian = product(self._changes.T, hessian @ self._changes)
        self._gradient = self._changes.T @ gradient
        self._stiffness = STIFFNESS * float(np.median(hessian.diagonal()))
        self._marked = marks

    def _marks(self, beside: BoolArray) -> IntArray:
        """Positions of the marks among the unknowns."""
        n = len(beside)
        if n <= MARKS:
            return np.arange(n)
        near = np.flatnonzero(beside)
        n_near = min(len(near), int(NEAR_SHARE * MARKS))
        chosen = self._generator.choice(near, n_near, replace=False)
        rest = np.setdiff1d(np.arange(n), chosen)
        others = self._generator.choice(rest, MARKS - n_near, replace=False)
        return np.sort(np.concatenate([chosen, others]))

    def solve(self, damping: float, held: BoolArray) -> FloatArray:
        """Solve the damped system for the parameters; vertices are held by a large weight."""
        of_held = self._changes[held]
        system = self._hessian + self._stiffness * product(of_held.T, of_held)
        system[np.diag_indices_from(system)] += damping
        self._solution = -linalg.solve(system, self._gradient, assume_a="pos")
        return self._changes @ self._solution

    def take(self, scale: float) -> FloatArray:
        """Change of the network's φ by a multiple of the step."""
        at_marks = scale * linalg.solve_triangular(self._root.T, self._solution)
        at_controls = -(self._response[self._marked].T @ at_marks)
        self._trial = moved(
            self._network, self._tangent, self._columns, np.concatenate([at_marks, at_controls])
        )
        correction = corrections(self._trial, self._features, self._attention)
        change = (correction - self._tangent.correction).astype(float)
        n_unknowns = len(self._response)
        return change[:n_unknowns] - self._response @ change[n_unknowns:]

    def keep(self) -> None:
        """Make the trial the network."""
        self._network = self._trial
