"""Stage 2 by AdamW with early stopping, as section 4.1 of the paper describes it, for comparison.

`nicmm_core.paper.fitting` takes Gauss–Newton steps on Eq. 5 instead. Here the smoothness term is
Eq. 6, and φ does not become a signed distance between the steps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from nicmm_core.geometry.array_types import FloatArray
from nicmm_core.paper.losses import (
    EnergySurface,
    LossWeights,
    feature_loss,
    interpolation_loss,
    root_delta,
    sdf_density,
    sdf_loss,
    total_loss,
)
from nicmm_core.paper.network import Network, level_set, network_input
from nicmm_core.paper.problem import Problem
from nicmm_core.paper.solution import Solution
from nicmm_core.paper.tensors import input_tensors, surface_tensors, trainable
from nicmm_core.paper.topology import keep_topology
from nicmm_core.paper.torch_threads import single_thread
from nicmm_core.status import Status

BAND_WIDTH = 3.0
"""Width of the narrow band around the curve, in mean edge lengths (section 4.1)."""

CPU = torch.device("cpu")


@dataclass(frozen=True)
class AdamWConfig:
    """Settings of AdamW and of the early stop.

    Attributes
    ----------
    learning_rate : float
        Learning rate of AdamW, as in the paper.
    patience : int
        Number of most recent iterations over which the fluctuation is measured.
    fluctuation : float
        Maximum range of the narrow-band energy over these iterations, relative to its last value,
        at convergence. The paper requires "minimal fluctuations".
    threshold : float
        Narrow-band energy below which the curve has converged immediately. On a sphere, where the
        least energy is zero, a curve with this energy is within 6 % of the radius of the great
        circle.
    least_iterations : int
        Number of iterations before the fluctuation is considered. AdamW needs some iterations to
        adapt its step sizes, and on a plateau at the start the energy hardly changes.
    iterations : int
        Maximum number of iterations.
    """

    learning_rate: float = 0.001
    patience: int = 10
    fluctuation: float = 0.02
    threshold: float = 0.005
    least_iterations: int = 30
    iterations: int = 300


@single_thread()
def fit_by_adamw(
    network: Network,
    problem: Problem,
    weights: LossWeights,
    config: AdamWConfig | None = None,
    watch: Callable[[float, FloatArray], bool] | None = None,
) -> Solution:
    """Train a copy of a network further for one problem.

    Parameters
    ----------
    network : Network
        The pretrained network, which is not changed.
    problem : Problem
    weights : LossWeights
    config : AdamWConfig, optional
    watch : callable, optional
        Function called in every iteration with the progress, as a fraction of the maximum number of
        iterations, and the best φ of the network so far. Training stops when it returns False.

    Returns
    -------
    Solution
        The φ of least loss, or φ₀ if the first loss is not finite. It is made zero at the control
        points, and where its zero set would not be one simple curve, φ₀ replaces it; `held` is the
        number of vertices with a sign that would break the topology.
    """
    config = config or AdamWConfig()
    surface = surface_tensors(problem, CPU)
    inputs = input_tensors(network_input(problem, network.config), CPU)
    trained = trainable(network, CPU)
    optimiser = torch.optim.AdamW(trained.parameters.values(), lr=config.learning_rate)

    best_loss, best_field = np.inf, problem.initial_distance
    energies: list[float] = []
    losses: list[float] = []
    status = Status.ITERATION_LIMIT
    for iteration in range(1, config.iterations + 1):
        optimiser.zero_grad()
        phi = level_set(trained, inputs, xp=torch)  # (n,)
        loss = total_loss(loss_terms(surface, phi), weights)
        losses.append(loss.item())
        if not np.isfinite(losses[-1]):
            status = Status.DIVERGED
            break
        if losses[-1] < best_loss:
            best_loss = losses[-1]
            best_field = phi.detach().numpy().astype(np.float64)
        energies.append(narrow_band_energy(surface, phi.detach(), weights, problem.edge_length))
        if watch is not None and not watch(iteration / config.iterations, best_field):
            status = Status.CANCELLED
            break
        if _has_converged(energies, config):
            status = Status.CONVERGED
            break
        loss.backward()
        optimiser.step()
    field, n_breaking = keep_topology(
        problem.working,
        problem.loop,
        problem.initial_distance,
        problem.smoother.interpolating(best_field),
        problem.bundle,
    )
    terms = loss_terms(surface, torch.as_tensor(field, dtype=torch.float32))
    found = {name: term.item() for name, term in terms.items()}
    return Solution(field, found, losses, status, n_breaking)


def loss_terms(surface: EnergySurface, phi: Tensor) -> dict[str, Tensor]:
    """The four terms of Eq. 2 by name, unweighted, with Eq. 6 as the smoothness term."""
    return {
        "sdf": sdf_loss(surface, phi),
        "int": interpolation_loss(surface, phi),
        "smooth": (smoothness_density(surface, phi) * surface.face_areas).sum(),
        "fea": feature_loss(surface, phi),
    }


def smoothness_density(surface: EnergySurface, phi: Tensor) -> Tensor:
    """Integrand of Eq. 6, ½ (Δφ)² G_σ(φ), in every face, shape (m,)."""
    laplacian = surface.centroid(surface.divergence(surface.gradient(phi)))  # (m,)
    delta = root_delta(surface.centroid(phi), surface.delta_width)
    return 0.5 * (laplacian * delta) ** 2


@torch.no_grad()
def narrow_band_energy(
    surface: EnergySurface, phi: Tensor, weights: LossWeights, edge_length: float
) -> float:
    """Mean weighted density of the level-set and smoothness terms in a band about the zero set."""
    inside = surface.centroid(phi).abs() < 0.5 * BAND_WIDTH * edge_length  # (m,)
    density = weights.sdf * sdf_density(surface, phi)
    density = density + weights.smooth * smoothness_density(surface, phi)
    area = surface.face_areas * inside
    return ((density * area).sum() / area.sum().clamp_min(torch.finfo(area.dtype).tiny)).item()


def _has_converged(energies: list[float], config: AdamWConfig) -> bool:
    """The paper's early stop: the energy is below the threshold or hardly fluctuates."""
    if energies[-1] < config.threshold:
        return True
    if len(energies) < max(config.patience, config.least_iterations):
        return False
    recent = energies[-config.patience :]
    return max(recent) - min(recent) <= config.fluctuation * recent[-1]
