"""The energy of a curve (Eq. 2–8), a named function for each term, on the working mesh.

Every length is in units of the square root of the surface's area, so that no term depends on the
unit or the size of the model. The integrals are sums over faces: with the Voronoi area of vertex
i in triangle t taken as |t|/3 (Eq. 8), the three corners of a face add up to its area, and every
integrand is taken at the centroid.

The terms are written once for NumPy arrays and for tensors: they use what both have in common.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from ..geometry.array_types import Array
from .problem import Problem

Operator = Callable[[Array], Array]
"""A linear map of vectors."""

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
class EnergySurface:
    """What the energy needs of a surface: n vertices, m faces.

    Attributes
    ----------
    face_areas : (m,) array
    gradient : operator (3 m, n)
    laplacian : operator (n, n)
    centroid : operator (m, n)
    control_vertices : (k,) array
    delta_width : float
        σ of the Gaussian that stands for the Dirac delta, in the unit of length.
    feature_map : (m,) array or None
        φ_fea at centroids.
    """

    face_areas: Array
    gradient: Operator
    laplacian: Operator
    centroid: Operator
    control_vertices: Array
    delta_width: float
    feature_map: Array | None


def energy_surface(problem: Problem) -> EnergySurface:
    """The surface of a problem as NumPy arrays; `tensors.surface_tensors` has it as tensors."""
    elements = problem.elements
    phi_fea = problem.feature_map
    return EnergySurface(
        face_areas=elements.face_areas,
        gradient=lambda phi: elements.gradient @ phi,
        laplacian=lambda phi: elements.laplacian @ phi,
        centroid=lambda phi: elements.centroid @ phi,
        control_vertices=problem.loop.control_vertices,
        delta_width=DELTA_WIDTH * problem.edge_length,
        feature_map=None if phi_fea is None else elements.plain_centroid @ phi_fea,
    )


def root_delta(value: Array, width: float) -> Array:
    """√G_σ(φ), written without a root, whose slope is infinite where G underflows to zero."""
    return math.e ** (-0.25 * (value / width) ** 2) / math.sqrt(width * math.sqrt(2.0 * math.pi))


def gaussian_delta(value: Array, width: float) -> Array:
    """G_σ(φ): a Gaussian of unit integral for the Dirac delta of Eq. 5."""
    return root_delta(value, width) ** 2


def slope_residual(squared_slope: Array) -> Array:
    """Residual of Eq. 3, |∇φ|² - 1; the energy is the integral of ½ residual²."""
    return squared_slope - 1.0


def bending_residual(laplacian: Array, phi: Array, width: float) -> Array:
    """Residual of Eq. 6, Δφ √G_σ(φ)."""
    return laplacian * root_delta(phi, width)


def feature_residual(phi_fea: Array, phi: Array, width: float) -> Array:
    """Residual of Eq. 7, φ_fea √G_σ(φ)."""
    return phi_fea * root_delta(phi, width)


def squared_slope(surface: EnergySurface, phi: Array) -> Array:
    """|∇φ|² in every face, shape (m,)."""
    return (surface.gradient(phi).reshape(3, -1) ** 2).sum(0)


def sdf_density(surface: EnergySurface, phi: Array) -> Array:
    """Integrand of the level-set constraint in every face, shape (m,)."""
    return 0.5 * slope_residual(squared_slope(surface, phi)) ** 2


def sdf_loss(surface: EnergySurface, phi: Array) -> Array:
    """Level-set constraint, Eq. 3 and 8: ∫ ½ (|∇φ|² - 1)²."""
    return (sdf_density(surface, phi) * surface.face_areas).sum()


def interpolation_loss(surface: EnergySurface, phi: Array) -> Array:
    """Interpolation constraint, Eq. 4: Σ φ(pᵢ)²."""
    return (phi[surface.control_vertices] ** 2).sum()


def smoothness_density(surface: EnergySurface, phi: Array) -> Array:
    """Integrand of the smoothness constraint in every face, shape (m,)."""
    laplacian = surface.centroid(surface.laplacian(phi))  # (m,)
    return 0.5 * bending_residual(laplacian, surface.centroid(phi), surface.delta_width) ** 2


def smoothness_loss(surface: EnergySurface, phi: Array) -> Array:
    """Smoothness constraint, Eq. 6 and 8: ∫ ½ (Δφ)² G_σ(φ), for ∫ ½ κ_g² dl while |∇φ| ≈ 1."""
    return (smoothness_density(surface, phi) * surface.face_areas).sum()


def feature_loss(surface: EnergySurface, phi: Array) -> Array:
    """Feature constraint, Eq. 7 and 8: ∫ ½ φ_fea² G_σ(φ)."""
    if surface.feature_map is None:
        return 0.0 * (phi**2).sum()
    residual = feature_residual(surface.feature_map, surface.centroid(phi), surface.delta_width)
    return (0.5 * residual**2 * surface.face_areas).sum()


def loss_terms(surface: EnergySurface, phi: Array) -> dict[str, Array]:
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
    bending = float(smoothness_loss(energy_surface(problem), problem.initial_distance))
    if weights.smooth * bending <= MOST_BENDING:
        return weights
    return replace(weights, smooth=MOST_BENDING / bending)


def total_loss(terms: dict[str, Array], weights: LossWeights) -> Array:
    """L_total, Eq. 2."""
    return (
        weights.sdf * terms["sdf"]
        + weights.interpolation * terms["int"]
        + weights.smooth * terms["smooth"]
        + weights.feature * terms["fea"]
    )
