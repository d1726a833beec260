"""Smoothing of a field that keeps it zero at the control points.

The initial loop zigzags along edges and has corners at the control points, and so has the
distance to it. A network that sees one vertex at a time cannot undo that, so φ₀ is smoothed
before it becomes a feature. The same factorisation later makes the network's φ exactly zero at
the control points by the least bending.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse import linalg

from ..array_types import FloatArray, IntArray
from ..progress import checkpoint
from .finite_elements import FiniteElements
from .sparse_solver import factorise

AT_ONCE = 8
"""Systems that are solved together; many at once would be one long call."""


@dataclass(frozen=True)
class Smoother:
    """Factorised ``A = M + ℓ⁴ L M⁻¹ L`` and its response to the control points.

    Attributes
    ----------
    factor : SuperLU
        Of A, with M the vertex areas and L the cotangent stiffness.
    vertex_areas : (n,) float array
    control_vertices : (k,) int array
    response : (n, k) float array
        Column j is the field of least ``cᵀ A c`` that is 1 at control vertex j and 0 at the others.
    """

    factor: linalg.SuperLU
    vertex_areas: FloatArray
    control_vertices: IntArray
    response: FloatArray

    def smoothed(self, field: FloatArray) -> FloatArray:
        """The minimiser of ``∫ (φ - field)² + ℓ⁴ (Δφ)²`` that is zero at the control points."""
        return self.interpolating(self.factor.solve(self.vertex_areas * field))

    def interpolating(self, field: FloatArray) -> FloatArray:
        """The field made exactly zero at the control points by the least change."""
        corrected = field - self.response @ field[self.control_vertices]
        corrected[self.control_vertices] = 0.0
        return corrected


def build_smoother(
    elements: FiniteElements,
    control_vertices: IntArray,
    length: float,
    plain: FiniteElements | None = None,
) -> Smoother:
    """Factorise the smoothing operator for a length ℓ in the unit of the elements.

    Detail shorter than about 2 π ℓ disappears. Where the elements read φ with signs, ``plain`` are
    those of ordinary functions, which the responses to the control points are.
    """
    factor = factorise(_bending_operator(elements, length))
    response_factor = factor if plain is None else factorise(_bending_operator(plain, length))
    loads = np.zeros((len(elements.vertex_areas), len(control_vertices)))
    loads[control_vertices, np.arange(len(control_vertices))] = 1.0
    fields = np.empty_like(loads)
    for first in range(0, len(control_vertices), AT_ONCE):
        checkpoint()
        columns = slice(first, first + AT_ONCE)
        fields[:, columns] = response_factor.solve(loads[:, columns])
    response = np.linalg.solve(fields[control_vertices].T, fields.T).T
    return Smoother(factor, elements.vertex_areas, control_vertices, response)


def _bending_operator(elements: FiniteElements, length: float) -> sparse.sparray:
    """A = M + ℓ⁴ L M⁻¹ L."""
    mass = sparse.diags_array(elements.vertex_areas)
    bending = elements.stiffness @ sparse.diags_array(1.0 / elements.vertex_areas)
    return mass + length**4 * (bending @ elements.stiffness)
