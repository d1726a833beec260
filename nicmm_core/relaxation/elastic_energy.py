"""Computes energies of curves.

The energy is that of Eq. 6 and 7 for a φ that is exactly the distance to its zero set. Then
|∇φ| = 1, the level-set term vanishes, and the integrals reduce to integrals along the curve:

    E = ∮ κ_g² ds + τ ∮ ds + τ_fea ∮ (φ_fea² - 1) ds.

Without the length term, distant points would be joined by ever larger arcs. With τ = (2π / L)² a
circle in the plane neither grows nor shrinks, so the balance does not depend on scale.

With `normal_bending`, a weight w, κ_g² becomes κ_g² + w κ_n²: the whole curvature in space for
w = 1. Then the curve also avoids ridges and valleys. κ_n ds is the change of the interpolated
vertex normals along a step, in its direction, so it does not depend on the number of nodes in a
face.

At a corner the curve turns freely: its node has no bending.

Outside all maps φ_fea = 1, so maps have no effect there. τ_fea scales with the surface but is at
least a few times τ, which matters for short curves. In an obstacle φ_fea > 1, which adds to the
tension. In a lane, a region painted for alignment, φ_fea < 1. The energy must not reward length
there, or the curve would buckle in the lane to gain length. So ds is held constant in this term,
and only the position of the curve counts. Where strands must not cross, a contact term keeps them
apart.

The kernels minimise E (`levenberg_marquardt.c`). Their unknowns are the moves of the nodes along
their conormals. The residuals of a node depend only on the node and its two neighbours, so the
Gauss–Newton matrix has two bands on each side and a step is cheap. Contact adds to the diagonal of
the matrix only.
"""

from __future__ import annotations

import numpy as np

from ..geometry import tolerances
from ..geometry.array_types import FloatArray
from .curve_nodes import CurveSurface, Nodes

OVER_TENSION = 4.0
"""Multiple of τ added to τ_fea, so that short curves follow a map too.

τ grows as the curve gets shorter, independently of the surface. For curves shorter than about
√area / 4, tension alone would exceed the pull of a map. With this term a map may bend any curve to
half the radius of a circle of the same length; long curves hardly change.
"""


def bending_energy(nodes: Nodes, normal_bending: float = 0.0) -> float:
    """∮ (κ_g² + w κ_n²) ds of one curve, in 1/length, with a weight w, `normal_bending`."""
    return float(node_bending(nodes, normal_bending).sum())


def node_bending(nodes: Nodes, normal_bending: float = 0.0) -> FloatArray:
    """κ_g² ds at each node, (n,), plus w κ_n² ds along the step after it; see `bending_energy`.

    The first term is zero at the ends of open curves and at corners.
    """
    bending: FloatArray = nodes.angles**2 / nodes.ds
    if normal_bending:
        following = nodes.normals[nodes.following]
        bending += normal_bending * normal_bending_of_steps(
            nodes.normals, following, nodes.steps, nodes.step_lengths
        )
    return bending


def normal_bending_of_steps(
    starts: FloatArray, ends: FloatArray, steps: FloatArray, lengths: FloatArray
) -> FloatArray:
    """∫ κ_n² ds along steps, (n,), in 1/length.

    Parameters
    ----------
    starts, ends : (n, 3) float array
        Unit normals at both ends of each step, of arbitrary sign.
    steps : (n, 3) float array
    lengths : (n,) float array
        Lengths of the steps along the surface.
    """
    opposite = np.einsum("nd,nd->n", starts, ends) < 0.0
    change = np.where(opposite[:, None], -ends, ends) - starts
    lengths = np.maximum(lengths, tolerances.TINY)
    result: FloatArray = (np.einsum("nd,nd->n", change, steps) / lengths) ** 2 / lengths
    return result


def feature_energy(nodes: Nodes) -> float:
    """∮ φ_fea² ds of one curve, in units of length."""
    return float((nodes.phi_fea**2 * nodes.ds).sum())


def comparable_energies(
    surface: CurveSurface, nodes: Nodes, smoothness: float, scale: float
) -> FloatArray:
    """E of all curves, (c,), with one length scale L₀, so that different courses can be compared.

        E = L₀ ∮ (κ_g² + w κ_n²) ds + 4π² L / (s L₀) + L₀ τ_fea (∮ max(φ_fea² - 1, 0) ds + L₀ a),

    where s is the smoothness, w the weight `CurveSurface.normal_bending`, and a the mean of
    min(φ_fea² - 1, 0) along the curve. For a plane circle of length L₀ and s = 1, the first two
    terms are 4π² each. With a separate length scale for each curve, a long detour would cost
    nothing. With the length of the curve as the factor of a, turning back and forth in a lane would
    lower the energy.

    Parameters
    ----------
    surface : CurveSurface
    nodes : Nodes
        Nodes of c curves.
    smoothness : float
    scale : float
        L₀, in mesh units.
    """
    at_nodes, lanes, weight = comparable_terms(surface, nodes, smoothness, scale)
    length = nodes.by_curve(nodes.step_lengths).sum(axis=1)
    return (
        nodes.by_curve(at_nodes).sum(axis=1) + weight * nodes.by_curve(lanes).sum(axis=1) / length
    )


def comparable_terms(
    surface: CurveSurface, nodes: Nodes, smoothness: float, scale: float
) -> tuple[FloatArray, FloatArray, float]:
    """The terms of `comparable_energies` at the nodes.

    Returns
    -------
    (n,) float array
        All of E but the term of a.
    (n,) float array
        min(φ_fea² - 1, 0) ds, whose sum over a curve is L a.
    float
        Factor of a in E; 0 without a map.
    """
    tension, ds = (2.0 * np.pi / scale) ** 2 / smoothness, nodes.ds
    energy = scale * (node_bending(nodes, surface.normal_bending) + tension * ds)
    if surface.feature_map is None:
        return energy, np.zeros(len(ds)), 0.0
    weight = scale * (surface.feature_weight / smoothness + OVER_TENSION * tension)
    excess = nodes.phi_fea**2 - 1.0
    energy += weight * np.maximum(excess, 0.0) * ds
    return energy, np.minimum(excess, 0.0) * ds, scale * weight
