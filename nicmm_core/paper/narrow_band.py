"""The energy on a narrow band around the curve, and its Gauss–Newton system.

The unknowns are the values of φ at the vertices of the band's faces, except at control points,
where φ is zero. The level-set term acts on all faces of the band. The bending and feature terms act
only on inner faces: every face around each corner of an inner face is in the band. On other faces
the divergence would be incomplete and attract spurious curves along the rim.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from ..geometry.array_types import FloatArray, IntArray
from . import losses
from .losses import DELTA_WIDTH, LossWeights
from .problem import Problem


@dataclass(frozen=True)
class NarrowBand:
    """Operators for u unknowns on the b faces of a band, c of which are inner faces.

    Attributes
    ----------
    unknowns : (u,) int array
        Working vertices at which φ is unknown.
    face_areas : (b,) float array
        Areas of all faces of the band.
    gradient : (3 b, u) sparse array
        ∇φ in every face; all x components, then y, then z.
    inner : (c,) int array
        Positions of the inner faces among the faces of the band.
    divergence : (c, 3 b) sparse array
        Divergence, at the centroids of the inner faces, of a vector field in the faces of the band.
    centroid : (c, u) sparse array
        φ at the centroids of the inner faces.
    feature_map : (c,) float array or None
        φ_fea at the centroids of the inner faces.
    damping : (u, u) sparse array
        Matrix of the norm in which steps are damped: the stiffness plus a small mass term.
    delta_width : float
        σ of the Gaussian that stands for the Dirac delta.
    """

    unknowns: IntArray
    face_areas: FloatArray
    gradient: sparse.csr_array
    inner: IntArray
    divergence: sparse.csr_array
    centroid: sparse.csr_array
    feature_map: FloatArray | None
    damping: sparse.csr_array
    delta_width: float


@dataclass(frozen=True)
class Residuals:
    """Residuals of the energy for one φ, and values from which its derivatives are computed.

    Attributes
    ----------
    gradient : (3, b) float array
        ∇φ in every face.
    length : (b,) float array
        |∇φ| in every face, kept above zero.
    slope : (b,) float array
        Residual of Eq. 3 in every face.
    centroid : (c,) float array
        φ at the centroids of the inner faces.
    bending : (c,) float array
        Residual of Eq. 5 in the inner faces.
    feature : (c,) float array or None
        Residual of Eq. 7 in the inner faces.
    energy : float
        λ-weighted sum of ½ ∫ residual².
    """

    gradient: FloatArray
    length: FloatArray
    slope: FloatArray
    centroid: FloatArray
    bending: FloatArray
    feature: FloatArray | None
    energy: float


def build_narrow_band(problem: Problem, field: FloatArray, half_width: float) -> NarrowBand:
    """Build the operators on the faces whose centroids lie within the half width of the zero set.

    Parameters
    ----------
    problem : Problem
    field : (n,) float array
        φ, approximately a signed distance, in units of the problem.
    half_width : float
        Half width of the band, in units of the problem.
    """
    elements, faces = problem.elements, problem.working.faces
    n_faces, n_vertices = len(faces), len(field)
    in_band = np.abs(elements.centroid @ field) < half_width
    band = np.flatnonzero(in_band)
    vertices = np.zeros(n_vertices, dtype=bool)
    vertices[faces[band]] = True
    complete = vertices.copy()
    complete[faces[~in_band]] = False
    inner = np.flatnonzero(complete[faces[band]].all(axis=1))
    faces_inside = band[inner]
    vertices[problem.loop.control_vertices] = False
    unknowns = np.flatnonzero(vertices)

    components = np.concatenate([band + axis * n_faces for axis in range(3)])
    gradient = elements.gradient[components][:, unknowns]
    areas = elements.face_areas[band]
    mass = elements.vertex_areas[unknowns] / problem.edge_length**2
    stiffness = gradient.T @ _rows(np.tile(areas, 3), gradient)
    centroid = elements.centroid[faces_inside]
    divergence = (centroid @ elements.divergence)[:, components]
    phi_fea = problem.feature_map
    return NarrowBand(
        unknowns=unknowns,
        face_areas=areas,
        gradient=gradient,
        inner=inner,
        divergence=sparse.csr_array(divergence),
        centroid=centroid[:, unknowns],
        feature_map=None if phi_fea is None else elements.plain_centroid[faces_inside] @ phi_fea,
        # A share of the mass matrix makes the system definite.
        damping=stiffness + sparse.diags_array(0.01 * mass),
        delta_width=DELTA_WIDTH * problem.edge_length,
    )


def evaluate(band: NarrowBand, weights: LossWeights, values: FloatArray) -> Residuals:
    """Residuals and energy for given values of φ at the unknowns, (u,)."""
    gradient = (band.gradient @ values).reshape(3, -1)
    squared = (gradient**2).sum(axis=0)
    slope, length = losses.slope_residual(squared), losses.slope(squared)
    centroid = band.centroid @ values
    curvature = band.divergence @ (gradient / length).ravel()
    bending = losses.bending_residual(curvature, length[band.inner], centroid, band.delta_width)
    areas = band.face_areas[band.inner]
    energy = weights.sdf * (band.face_areas @ slope**2) + weights.smooth * (areas @ bending**2)
    feature = None
    if band.feature_map is not None:
        feature = losses.feature_residual(band.feature_map, centroid, band.delta_width)
        energy += weights.feature * (areas @ feature**2)
    return Residuals(gradient, length, slope, centroid, bending, feature, 0.5 * float(energy))


def gauss_newton_system(
    band: NarrowBand, weights: LossWeights, residuals: Residuals
) -> tuple[sparse.csr_array, FloatArray]:
    """Positive semidefinite Hessian (u, u) and gradient (u,) of the energy.

    The Hessian is the weighted JᵀJ of all residuals plus the second derivative of |∇φ|² in faces
    where the slope is above 1. In other faces that derivative would make it indefinite.
    """
    areas = band.face_areas[band.inner]
    along = _along_gradient(residuals) @ band.gradient
    slope = _rows(2.0 * residuals.length, along)
    # The derivative of √G is -φ / (2 σ²) √G.
    decay = _rows(-residuals.centroid / (2.0 * band.delta_width**2), band.centroid)
    terms = [
        (weights.sdf * band.face_areas, slope, residuals.slope),
        (
            weights.smooth * areas,
            _bending_jacobian(band, residuals, along, decay),
            residuals.bending,
        ),
    ]
    if residuals.feature is not None:
        terms.append((weights.feature * areas, _rows(residuals.feature, decay), residuals.feature))
    excess = 2.0 * weights.sdf * band.face_areas * np.maximum(residuals.slope, 0.0)
    hessian = band.gradient.T @ _rows(np.tile(excess, 3), band.gradient)
    gradient = np.zeros(len(band.unknowns))
    for weight, jacobian, residual in terms:
        weighted = sparse.csr_array(_rows(weight, jacobian).T)
        hessian = hessian + weighted @ jacobian
        gradient += weighted @ residual
    return sparse.csr_array(hessian), gradient


def _along_gradient(residuals: Residuals) -> sparse.csr_array:
    """Component of a vector field along ∇φ/|∇φ| in each face, shape (b, 3 b)."""
    n_faces = len(residuals.length)
    direction = (residuals.gradient / residuals.length).ravel()
    return sparse.csr_array((direction, (np.tile(np.arange(n_faces), 3), np.arange(3 * n_faces))))


def _bending_jacobian(
    band: NarrowBand, residuals: Residuals, along: sparse.csr_array, decay: sparse.csr_array
) -> sparse.csr_array:
    """Derivative of the residual of Eq. 5, div(n) √(|∇φ| G) with n = ∇φ/|∇φ|, shape (c, u).

    The derivative of n is the part of the derivative of ∇φ that is orthogonal to n, over |∇φ|.
    ``along`` is the derivative of |∇φ|, (b, u), and ``decay`` that of log √G, (c, u).
    """
    length = residuals.length[band.inner]
    delta = losses.bending_residual(1.0, length, residuals.centroid, band.delta_width)
    across = band.gradient - _along_gradient(residuals).T @ along
    turning = band.divergence @ _rows(np.tile(1.0 / residuals.length, 3), across)
    stretching = _rows(0.5 / length, along[band.inner]) + decay
    return _rows(delta, turning) + _rows(residuals.bending, stretching)


def _rows(factor: FloatArray, matrix: sparse.sparray) -> sparse.csr_array:
    """Multiply each row of a matrix by a factor."""
    return sparse.csr_array(sparse.diags_array(factor) @ matrix)
