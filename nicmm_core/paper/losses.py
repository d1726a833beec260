"""The energy of a level set on the working mesh (Eq. 2–8), one function per term.

Lengths are in units of the square root of the surface's area, so that no term depends on the unit
or the size of the model. The integrals are sums over faces: the Voronoi area of vertex i in
triangle t is taken as |t|/3 (Eq. 8), so the areas at the three corners of a face add up to the
face's area, and every integrand is evaluated at the centroid.

The functions accept NumPy arrays and torch tensors.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from ..geometry.array_types import Array, FloatArray
from .problem import Problem

Operator = Callable[[Array], Array]
"""A linear map from vectors to vectors."""

DELTA_WIDTH = 1.0
"""σ of the Gaussian that stands for the Dirac delta, in mean edge lengths.

It is the least width that samples at centroids resolve. The Gaussian then covers the band of three
edge lengths in which the paper tests convergence.
"""


LEAST_SLOPE = 1e-3
"""Value of |∇φ| where ∇φ vanishes; it is 1 beside the curve."""

MOST_BENDING = 0.25
"""Upper bound of the weighted smoothness term at φ₀."""


@dataclass(frozen=True)
class LossWeights:
    """The weights λ of Eq. 2.

    The paper gives λ_int = 5000, λ_smooth = 500 and λ_fea without a unit. Here lengths are in units
    of the square root of the surface's area. λ_smooth is a length; with ten times as much, the
    curves on SHREC16 bend as much within a few percent. λ_fea, an inverse length, also
    acts as a tension. At 1 alignment moves the curve noticeably against bending.

    Attributes
    ----------
    sdf : float
        Weight of the level-set constraint, Eq. 3.
    interpolation : float
        λ_int, Eq. 4.
    smooth : float
        λ_smooth, Eq. 5.
    feature : float
        λ_fea, Eq. 7.
    """

    sdf: float = 1.0
    interpolation: float = 5000.0
    smooth: float = 0.01
    feature: float = 1.0


@dataclass(frozen=True)
class EnergySurface:
    """Operators of the energy on a surface with n vertices and m faces.

    Attributes
    ----------
    face_areas : (m,) array
    gradient : operator (3 m, n)
        Gradient in every face; all x components, then y, then z.
    divergence : operator (n, 3 m)
        Pointwise divergence, at the vertices, of a vector field in the faces.
    centroid : operator (m, n)
        Values at the centroids of the faces.
    control_vertices : (k,) array
    delta_width : float
        σ of the Gaussian that stands for the Dirac delta, in units of the problem.
    feature_map : (m,) array or None
        φ_fea at the centroids of the faces.
    """

    face_areas: Array
    gradient: Operator
    divergence: Operator
    centroid: Operator
    control_vertices: Array
    delta_width: float
    feature_map: Array | None


def energy_surface(problem: Problem) -> EnergySurface:
    """The surface of a problem as NumPy arrays; `tensors.surface_tensors` returns tensors."""
    elements = problem.elements
    phi_fea = problem.feature_map
    return EnergySurface(
        face_areas=elements.face_areas,
        gradient=lambda phi: elements.gradient @ phi,
        divergence=lambda field: elements.divergence @ field,
        centroid=lambda phi: elements.centroid @ phi,
        control_vertices=problem.loop.control_vertices,
        delta_width=DELTA_WIDTH * problem.edge_length,
        feature_map=None if phi_fea is None else elements.plain_centroid @ phi_fea,
    )


def root_delta(value: Array, width: float) -> Array:
    """√G_σ(φ), computed without a square root, whose derivative is infinite if G underflows."""
    return math.e ** (-0.25 * (value / width) ** 2) / math.sqrt(width * math.sqrt(2.0 * math.pi))


def slope_residual(squared_slope: Array) -> Array:
    """Residual of Eq. 3, |∇φ|² - 1; the energy is the integral of ½ residual²."""
    return squared_slope - 1.0


def slope(squared_slope: Array) -> Array:
    """|∇φ|, kept above zero so that the direction ∇φ/|∇φ| is differentiable."""
    return (squared_slope + LEAST_SLOPE**2) ** 0.5


def bending_residual(curvature: Array, slope: Array, phi: Array, width: float) -> Array:
    """Residual of Eq. 5, div(∇φ/|∇φ|) √(|∇φ| G_σ(φ))."""
    return curvature * slope**0.5 * root_delta(phi, width)


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
    gradient = surface.gradient(phi).reshape(3, -1)  # (3, m)
    length = slope((gradient**2).sum(0))  # (m,)
    curvature = surface.centroid(surface.divergence((gradient / length).reshape(-1)))  # (m,)
    centroid = surface.centroid(phi)  # (m,)
    return 0.5 * bending_residual(curvature, length, centroid, surface.delta_width) ** 2


def smoothness_loss(surface: EnergySurface, phi: Array) -> Array:
    """Smoothness constraint, Eq. 5 and 8: ∫ ½ div(∇φ/|∇φ|)² |∇φ| G_σ(φ), for ∫ ½ κ_g² dl."""
    return (smoothness_density(surface, phi) * surface.face_areas).sum()


def feature_loss(surface: EnergySurface, phi: Array) -> Array:
    """Feature constraint, Eq. 7 and 8: ∫ ½ φ_fea² G_σ(φ)."""
    if surface.feature_map is None:
        return 0.0 * (phi**2).sum()
    residual = feature_residual(surface.feature_map, surface.centroid(phi), surface.delta_width)
    return (0.5 * residual**2 * surface.face_areas).sum()


def loss_terms(surface: EnergySurface, phi: Array) -> dict[str, Array]:
    """The four terms of Eq. 2 by name, unweighted."""
    return {
        "sdf": sdf_loss(surface, phi),
        "int": interpolation_loss(surface, phi),
        "smooth": smoothness_loss(surface, phi),
        "fea": feature_loss(surface, phi),
    }


def energy_of(problem: Problem, field: FloatArray) -> dict[str, float]:
    """The four terms of the energy of a level set by name, unweighted, as floats."""
    terms = loss_terms(energy_surface(problem), field)
    return {name: float(value) for name, value in terms.items()}


def balanced(weights: LossWeights, problem: Problem) -> LossWeights:
    """Lower λ_smooth if bending would outweigh the level-set term at φ₀.

    A flat φ costs ½ in Eq. 3 and nothing in Eq. 5. If bending costs as much, as with many points or
    a large smoothness, the minimum is a flat φ, which has no curve.
    """
    bending = float(smoothness_loss(energy_surface(problem), problem.initial_distance))
    if weights.smooth * bending <= MOST_BENDING:
        return weights
    return replace(weights, smooth=MOST_BENDING / bending)


def total_loss(terms: dict[str, Array], weights: LossWeights) -> Array:
    """L_total of Eq. 2, the weighted sum of the terms."""
    return (
        weights.sdf * terms["sdf"]
        + weights.interpolation * terms["int"]
        + weights.smooth * terms["smooth"]
        + weights.feature * terms["fea"]
    )
