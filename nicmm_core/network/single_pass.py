"""Inference: one forward pass of the pretrained network in NumPy, without further training."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..geometry.mesh import Mesh
from ..level_set.losses import energy_of
from ..level_set.problem import Problem, requested_problem
from ..level_set.solution import Solution
from ..level_set.zero_set import ZeroSet, shortest_by_map, zero_set
from ..path.band_refinement import START_RESOLUTION
from ..progress import subrange
from ..request import Request
from ..status import Status
from .forward_pass import NetworkInput, NetworkWeights, Operations, level_set
from .weights_file import shipped_weights

SingleArray = NDArray[np.float32]


@dataclass(frozen=True)
class Inference:
    """The inferred level set of a request on a mesh.

    Attributes
    ----------
    problem : Problem
    solution : Solution
        Level set given by the network.
    zeros : ZeroSet
        Zero set of the solution or, if the request has maps, the one that `shortest_by_map`
        chooses.
    """

    problem: Problem
    solution: Solution
    zeros: ZeroSet


def infer(mesh: Mesh, request: Request) -> Inference:
    """Infer the course of a curve, from the request to the zero set.

    Parameters
    ----------
    mesh : Mesh
    request : Request

    Returns
    -------
    Inference

    Raises
    ------
    MeshError
        If the component with the control points has faces without area.
    UnreachableError
        If no simple path passes the points in this order.
    """
    with subrange(0.0, 0.8):
        problem = requested_problem(mesh, request, START_RESOLUTION)
    with subrange(0.8, 1.0):
        solution = infer_level_set(shipped_weights(problem.features.shape[1]), problem)
        zeros = zero_set(mesh, problem, solution.field)
        if request.has_maps:
            zeros = shortest_by_map(mesh, problem, zeros)
        return Inference(problem, solution, zeros)


def infer_level_set(weights: NetworkWeights, problem: Problem) -> Solution:
    """Infer the level set of a problem; φ₀ replaces it if the network's values are not finite.

    Parameters
    ----------
    weights : NetworkWeights
        Weights as NumPy arrays.
    problem : Problem

    Returns
    -------
    Solution
        φ without iterations. Its status is ``DIVERGED`` if φ₀ has replaced the network's values.
    """
    # Weights from a bad file may cause an overflow, which is checked below.
    with np.errstate(over="ignore", invalid="ignore"):
        field = level_set(weights, network_input(problem), NUMPY).astype(np.float64)
    status = Status.CONVERGED
    if not np.isfinite(field).all():
        field, status = problem.initial_distance, Status.DIVERGED
    return Solution(field, energy_of(problem, field), [], status)


def network_input(problem: Problem) -> NetworkInput:
    """The input of the network for a problem, in single precision as in training.

    φ then differs by about 1e-7, in units of the problem, from φ in double precision.
    """
    areas = problem.elements.vertex_areas
    return NetworkInput(
        features=problem.features.astype(np.float32),
        initial_distance=problem.initial_distance.astype(np.float32),
        area_share=(areas / areas.sum()).astype(np.float32),
        response=problem.smoother.response.astype(np.float32),
        control_vertices=problem.loop.control_vertices,
    )


def _linear(values: SingleArray, weight: SingleArray, bias: SingleArray | None) -> SingleArray:
    mapped = values @ weight.T
    if bias is not None:
        mapped += bias
    return mapped


def _sigmoid(values: SingleArray) -> SingleArray:
    """1 / (1 + exp(-x)), computed by tanh, which cannot overflow and is faster than exp."""
    half = np.tanh(0.5 * values)
    half += 1.0
    half *= 0.5
    return half


def _correlate(values: SingleArray, kernel: SingleArray) -> SingleArray:
    return np.correlate(np.pad(values, len(kernel) // 2), kernel, "valid")


NUMPY = Operations(
    linear=_linear,
    tanh=np.tanh,
    sigmoid=_sigmoid,
    correlate=_correlate,
    ones_like=np.ones_like,
)
"""The network's operations on NumPy arrays."""
