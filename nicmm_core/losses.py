"""The energy of a curve (Eq. 2–8), a named function for each term, on the working mesh.

Every length is in units of the square root of the surface's area, so that no term depends on the
unit or the size of the model. The integrals are sums over faces: with the Voronoi area of vertex
i in triangle t taken as |t|/3 (Eq. 8), the three corners of a face add up to its area, and every
integrand is taken at the centroid.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from .array_types import FloatArray
from .problem import Problem
from .sparse_operator import SparseOperator

DELTA_WIDTH = 1.0
"""σ of the Gaussian for the Dirac delta, in mean edge lengths.

The least that the centroids of a mesh still sample: the delta then covers the band of three edge
lengths in which the paper judges convergence.
"""


MOST_BENDING = 0.25
"""Most that the smoothness term may weigh in the energy at φ₀."""


@dataclass(frozen=True)
class LossWeights:
    """The λ of Eq. 2.

    The paper's λ_int = 5000, λ_smooth = 500 and λ_fea carry no unit. Lengths here are in square
    roots of the surface's area, where 500 would shrink φ to nothing, since a smaller slope lowers
    (Δφ)² and widens the Gaussian. λ_smooth, a length, is 500 for a unit 50,000 times smaller; 0.01
    is about the largest value that leaves |∇φ| near 1 beside the curve. λ_fea, an inverse length,
    acts as a tension too; at 0.3 alignment holds the curve against its bending and at 0.1 not.
    """

    sdf: float = 1.0
    interpolation: float = 5000.0
    smooth: float = 0.01
    feature: float = 0.3


@dataclass(frozen=True)
class SurfaceTensors:
    """What the energy needs of a surface, as tensors: n vertices, m faces.

    Attributes
    ----------
    face_areas : (m,) tensor
    gradient : operator (3 m, n)
    laplacian : operator (n, n)
    centroid : operator (m, n)
    control_vertices : (k,) tensor
    delta_width : float
        σ of the Gaussian that stands for the Dirac delta, in the unit of length.
    feature_map : (m,) tensor or None
        φ_fea at centroids.
    """

    face_areas: Tensor
    gradient: SparseOperator
    laplacian: SparseOperator
    centroid: SparseOperator
    control_vertices: Tensor
    delta_width: float
    feature_map: Tensor | None


def surface_tensors(problem: Problem, device: torch.device) -> SurfaceTensors:
    """Move the operators of a problem to a device in single precision."""

    def tensor(array: FloatArray) -> Tensor:
        return torch.as_tensor(array, dtype=torch.float32, device=device)

    elements = problem.elements
    importance = problem.feature_map
    return SurfaceTensors(
        face_areas=tensor(elements.face_areas),
        gradient=SparseOperator(elements.gradient, device),
        laplacian=SparseOperator(elements.laplacian, device),
        centroid=SparseOperator(elements.centroid, device),
        control_vertices=torch.as_tensor(problem.loop.control_vertices, device=device),
        delta_width=DELTA_WIDTH * problem.edge_length,
        feature_map=None if importance is None else tensor(elements.centroid @ importance),
    )


def gaussian_delta(value: Tensor, width: float) -> Tensor:
    """G_σ(φ): a Gaussian of unit integral for the Dirac delta of Eq. 5."""
    return torch.exp(-0.5 * (value / width) ** 2) / (width * math.sqrt(2.0 * math.pi))


def squared_slope(surface: SurfaceTensors, phi: Tensor) -> Tensor:
    """|∇φ|² in every face, shape (m,)."""
    return (surface.gradient(phi).reshape(3, -1) ** 2).sum(dim=0)


def sdf_density(surface: SurfaceTensors, phi: Tensor) -> Tensor:
    """Integrand of the level-set constraint in every face, shape (m,)."""
    return 0.5 * (squared_slope(surface, phi) - 1.0) ** 2


def sdf_loss(surface: SurfaceTensors, phi: Tensor) -> Tensor:
    """Level-set constraint, Eq. 3 and 8: ∫ ½ (|∇φ|² - 1)²."""
    return (sdf_density(surface, phi) * surface.face_areas).sum()


def interpolation_loss(surface: SurfaceTensors, phi: Tensor) -> Tensor:
    """Interpolation constraint, Eq. 4: Σ φ(pᵢ)²."""
    return (phi[surface.control_vertices] ** 2).sum()


def smoothness_density(surface: SurfaceTensors, phi: Tensor) -> Tensor:
    """Integrand of the smoothness constraint in every face, shape (m,)."""
    bending = surface.centroid(surface.laplacian(phi)) ** 2  # (m,)
    return 0.5 * bending * gaussian_delta(surface.centroid(phi), surface.delta_width)


def smoothness_loss(surface: SurfaceTensors, phi: Tensor) -> Tensor:
    """Smoothness constraint, Eq. 6 and 8: ∫ ½ (Δφ)² G_σ(φ), for ∫ ½ κ_g² dl while |∇φ| ≈ 1."""
    return (smoothness_density(surface, phi) * surface.face_areas).sum()


def feature_loss(surface: SurfaceTensors, phi: Tensor) -> Tensor:
    """Feature constraint, Eq. 7 and 8: ∫ ½ φ_fea² G_σ(φ)."""
    if surface.feature_map is None:
        return phi.new_zeros(())
    delta = gaussian_delta(surface.centroid(phi), surface.delta_width)  # (m,)
    return (0.5 * surface.feature_map**2 * delta * surface.face_areas).sum()


def loss_terms(surface: SurfaceTensors, phi: Tensor) -> dict[str, Tensor]:
    """The four terms of Eq. 2, unweighted."""
    return {
        "sdf": sdf_loss(surface, phi),
        "int": interpolation_loss(surface, phi),
        "smooth": smoothness_loss(surface, phi),
        "fea": feature_loss(surface, phi),
    }


def balanced(weights: LossWeights, problem: Problem) -> LossWeights:
    """Lower λ_smooth where the bending of φ₀ would outweigh its slope.

    A flat φ costs ½ in Eq. 3 and nothing in Eq. 6. Where bending costs about as much, as with many
    points or a large smoothness, the least energy would be no curve at all.
    """
    surface = surface_tensors(problem, torch.device("cpu"))
    phi = torch.as_tensor(problem.initial_distance, dtype=torch.float32)
    bending = smoothness_loss(surface, phi).item()
    if weights.smooth * bending <= MOST_BENDING:
        return weights
    return replace(weights, smooth=MOST_BENDING / bending)


def total_loss(terms: dict[str, Tensor], weights: LossWeights) -> Tensor:
    """L_total, Eq. 2."""
    return (
        weights.sdf * terms["sdf"]
        + weights.interpolation * terms["int"]
        + weights.smooth * terms["smooth"]
        + weights.feature * terms["fea"]
    )
