"""Stage 2 (section 4.1): fine-tune the pretrained network on one problem, with early stopping."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from ..geometry.array_types import FloatArray
from ..status import Status
from .losses import (
    EnergySurface,
    LossWeights,
    loss_terms,
    sdf_density,
    smoothness_density,
    total_loss,
)
from .network import CurveNetwork
from .problem import Problem
from .solution import Solution
from .tensors import network_input, surface_tensors
from .torch_threads import single_thread

BAND_WIDTH = 3.0
"""Width of the narrow band around the curve, in mean edge lengths (section 4.1)."""


@dataclass(frozen=True)
class FinetuningConfig:
    """Settings of stage 2.

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
def finetune(
    network: CurveNetwork,
    problem: Problem,
    weights: LossWeights,
    config: FinetuningConfig,
    watch: Callable[[float, FloatArray], bool] | None = None,
) -> Solution:
    """Optimise a copy of the network for one problem.

    Parameters
    ----------
    network : CurveNetwork
        The pretrained network, which is not changed.
    problem : Problem
    weights : LossWeights
    config : FinetuningConfig
    watch : callable, optional
        Function called in every iteration with the progress, as a fraction of the maximum number of
        iterations, and the best φ so far. Fine-tuning stops when the function returns False.

    Returns
    -------
    Solution
        The φ of least loss, or φ₀ if the first loss is not finite.
    """
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    surface = surface_tensors(problem, device)
    inputs = network_input(problem, device)
    network = copy.deepcopy(network).to(device)
    optimiser = torch.optim.AdamW(network.parameters(), lr=config.learning_rate)

    best_loss, best_field = np.inf, problem.initial_distance
    best_terms = dict.fromkeys(("sdf", "int", "smooth", "fea"), np.inf)
    energies: list[float] = []
    losses: list[float] = []
    status = Status.ITERATION_LIMIT
    for iteration in range(1, config.iterations + 1):
        optimiser.zero_grad()
        phi = network(inputs)  # (n,)
        terms = loss_terms(surface, phi)
        loss = total_loss(terms, weights)
        value = loss.item()
        losses.append(value)
        if not np.isfinite(value):
            status = Status.DIVERGED
            break
        if value < best_loss:
            best_loss = value
            best_terms = {name: float(term.item()) for name, term in terms.items()}
            best_field = phi.detach().cpu().numpy().astype(np.float64)
        energies.append(narrow_band_energy(surface, phi.detach(), weights, problem.edge_length))
        if watch is not None and not watch(iteration / config.iterations, best_field):
            status = Status.CANCELLED
            break
        if _has_converged(energies, config):
            status = Status.CONVERGED
            break
        loss.backward()
        optimiser.step()
    return Solution(best_field, best_terms, losses, status)


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


def _has_converged(energies: list[float], config: FinetuningConfig) -> bool:
    """The paper's early stop: the energy is below the threshold or hardly fluctuates."""
    if energies[-1] < config.threshold:
        return True
    if len(energies) < max(config.patience, config.least_iterations):
        return False
    recent = energies[-config.patience :]
    return max(recent) - min(recent) <= config.fluctuation * recent[-1]
