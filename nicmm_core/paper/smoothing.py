"""Smoothing of a field that keeps it zero at the control points.

The initial loop zigzags along edges and has corners at the control points, and so do the level sets
of the distance to it. A network that sees one vertex at a time cannot remove them, so φ₀ is
smoothed before it becomes an input. The same operator gives the smoothest correction that makes the
network's φ exactly zero at the control points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from ..geometry.array_types import FloatArray, IntArray
from ..progress import checkpoint
from .finite_elements import FiniteElements
from .sparse_solver import Solve, factorised

BLOCK_COLUMNS = 8
"""Number of right-hand sides solved together; with more, a cancellation would take longer."""


@dataclass(frozen=True)
class Smoother:
    """Factorised operator ``A = M + ℓ⁴ L M⁻¹ L`` and its response to the control points.

    M is the diagonal matrix of vertex areas and L the cotangent stiffness.

    Attributes
    ----------
    solve : callable
        Solver for the matrix A.
    vertex_areas : (n,) float array
    control_vertices : (k,) int array
    response : (n, k) float array
        Smooth fields, one per control vertex. Column j is the field c of least ``cᵀ A c`` that is 1
        at control vertex j and 0 at all other control vertices.
    """

    solve: Solve
    vertex_areas: FloatArray
    control_vertices: IntArray
    response: FloatArray

    def smoothed(self, field: FloatArray) -> FloatArray:
        """The minimiser of ``∫ (φ - field)² + ℓ⁴ (Δφ)²`` that is zero at the control points."""
        return self.interpolating(self.solve(self.vertex_areas * field))

    def interpolating(self, field: FloatArray) -> FloatArray:
        """Add the correction of least ``cᵀ A c`` that makes a field zero at the control points."""
        corrected = field - self.response @ field[self.control_vertices]
        corrected[self.control_vertices] = 0.0
        return corrected


def build_smoother(
    elements: FiniteElements,
    control_vertices: IntArray,
    length: float,
    plain: FiniteElements | None = None,
) -> Smoother:
    """Factorise the smoothing operator and compute its response to the control points.

    Parameters
    ----------
    elements : FiniteElements
        Operators for n vertices.
    control_vertices : (k,) int array
    length : float
        Smoothing length ℓ in the unit of the elements. Detail shorter than about 2 π ℓ is removed.
    plain : FiniteElements, optional
        Operators for ordinary functions, if ``elements`` are those of a sign bundle. The responses
        are computed with them.
    """
    solve = _factorised(elements, length)
    solve_response = solve if plain is None else _factorised(plain, length)
    loads = np.zeros((len(elements.vertex_areas), len(control_vertices)))
    loads[control_vertices, np.arange(len(control_vertices))] = 1.0
    fields = np.empty_like(loads)
    for first in range(0, len(control_vertices), BLOCK_COLUMNS):
        checkpoint()
        columns = slice(first, first + BLOCK_COLUMNS)
        fields[:, columns] = solve_response(loads[:, columns])
    # On extremely thin surfaces, control points may have the same response to the last digit.
    response = np.linalg.lstsq(fields[control_vertices].T, fields.T, rcond=None)[0].T
    return Smoother(solve, elements.vertex_areas, control_vertices, response)


def _factorised(elements: FiniteElements, length: float) -> Solve:
    """Factorise A, or the mixed system if vertices of high valence would make A too dense."""
    valence = np.diff(elements.stiffness.indptr)
    # The number of products of entries of L per vertex is usually about 50.
    if (valence**2).sum() <= 150 * len(valence):
        return factorised(_bending_operator(elements, length))
    return mixed_factorised(elements, length)


def mixed_factorised(elements: FiniteElements, length: float) -> Solve:
    """Factorise A as an equivalent system of twice the size, without products of L.

    With ψ = ℓ² M⁻¹ L φ, the equation A φ = f becomes ``M φ + ℓ² L ψ = f`` and
    ``ℓ² L φ - M ψ = 0``. This system is symmetric and quasi-definite, so no elimination order needs
    pivoting (Vanderbei 1995).
    """
    mass, coupling = sparse.diags_array(elements.vertex_areas), length**2 * elements.stiffness
    system = sparse.block_array([[mass, coupling], [coupling, -mass]], format="csr")
    solve = factorised(system)
    return lambda right: solve(np.concatenate([right, np.zeros_like(right)]))[: len(right)]


def _bending_operator(elements: FiniteElements, length: float) -> sparse.sparray:
    """A = M + ℓ⁴ L M⁻¹ L."""
    mass = sparse.diags_array(elements.vertex_areas)
    bending = elements.stiffness @ sparse.diags_array(1.0 / elements.vertex_areas)
    return mass + length**4 * (bending @ elements.stiffness)
