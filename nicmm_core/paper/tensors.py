"""Conversion of problems and networks to torch tensors in single precision, for pretraining."""

from __future__ import annotations

import warnings
from collections.abc import Callable

import torch
from scipy import sparse
from torch import Tensor

from ..geometry.array_types import FloatArray
from .losses import EnergySurface, energy_surface
from .network import Network, NetworkInput
from .problem import Problem


def surface_tensors(problem: Problem, device: torch.device) -> EnergySurface:
    """The operators of the energy as tensors on a device, see `losses.energy_surface`."""
    arrays = energy_surface(problem)
    elements = problem.elements
    phi_fea = arrays.feature_map
    return EnergySurface(
        face_areas=_tensor(arrays.face_areas, device),
        gradient=sparse_operator(elements.gradient, device),
        divergence=sparse_operator(elements.divergence, device),
        centroid=sparse_operator(elements.centroid, device),
        control_vertices=torch.as_tensor(arrays.control_vertices, device=device),
        delta_width=arrays.delta_width,
        feature_map=None if phi_fea is None else _tensor(phi_fea, device),
    )


def input_tensors(inputs: NetworkInput, device: torch.device) -> NetworkInput:
    """The input of the network as tensors on a device."""
    return NetworkInput(*(torch.as_tensor(array, device=device) for array in inputs))


def trainable(network: Network, device: torch.device) -> Network:
    """A copy of a network, with tensors on a device that have gradients."""
    parameters = {
        name: torch.tensor(array, device=device, requires_grad=True)
        for name, array in network.parameters.items()
    }
    return Network(network.config, parameters)


def trained(network: Network) -> Network:
    """A copy of a network of tensors, with NumPy arrays."""
    arrays = {name: t.detach().cpu().numpy().copy() for name, t in network.parameters.items()}
    return Network(network.config, arrays)


def sparse_operator(matrix: sparse.sparray, device: torch.device) -> Callable[[Tensor], Tensor]:
    """A function that multiplies a sparse matrix (m, n) by a vector (n,), with derivatives.

    The operator has copies of the arrays: SciPy may sort those of the matrix in place later.
    """
    csr = sparse.csr_array(matrix)
    with warnings.catch_warnings():
        # torch warns once per process that compressed sparse tensors are in beta.
        warnings.filterwarnings("ignore", message="Sparse")
        tensor = torch.sparse_csr_tensor(
            torch.tensor(csr.indptr, dtype=torch.int32),
            torch.tensor(csr.indices, dtype=torch.int32),
            torch.tensor(csr.data, dtype=torch.float32),
            size=csr.shape,
            device=device,
        )
    return lambda vector: tensor @ vector


def _tensor(array: FloatArray, device: torch.device) -> Tensor:
    return torch.as_tensor(array, dtype=torch.float32, device=device)
