"""Conversion of problems to torch tensors in single precision, for pretraining and fine-tuning."""

from __future__ import annotations

import torch
from torch import Tensor

from ..geometry.array_types import FloatArray
from .losses import EnergySurface, energy_surface
from .network import NetworkInput
from .problem import Problem
from .sparse_operator import sparse_operator


def surface_tensors(problem: Problem, device: torch.device) -> EnergySurface:
    """The operators of the energy as tensors on a device, see `losses.energy_surface`."""
    arrays = energy_surface(problem)
    elements = problem.elements
    phi_fea = arrays.feature_map
    return EnergySurface(
        face_areas=_tensor(arrays.face_areas, device),
        gradient=sparse_operator(elements.gradient, device),
        laplacian=sparse_operator(elements.laplacian, device),
        centroid=sparse_operator(elements.centroid, device),
        control_vertices=torch.as_tensor(arrays.control_vertices, device=device),
        delta_width=arrays.delta_width,
        feature_map=None if phi_fea is None else _tensor(phi_fea, device),
    )


def network_input(problem: Problem, device: torch.device) -> NetworkInput:
    """The input of the network as tensors on a device.

    φ then differs by about 1e-7, in units of the problem, from φ in double precision.
    """
    areas = problem.elements.vertex_areas
    return NetworkInput(
        features=_tensor(problem.features, device),
        initial_distance=_tensor(problem.initial_distance, device),
        area_share=_tensor(areas / areas.sum(), device),
        response=_tensor(problem.smoother.response, device),
        control_vertices=torch.as_tensor(problem.loop.control_vertices, device=device),
    )


def _tensor(array: FloatArray, device: torch.device) -> Tensor:
    return torch.as_tensor(array, dtype=torch.float32, device=device)
