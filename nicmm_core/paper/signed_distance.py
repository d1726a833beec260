"""The signed distance to the initial path (section 3.1), from which φ₀ is made.

The heat method gives the distance, and flood fill gives the signs.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from ..geometry.array_types import FloatArray, IntArray
from ..geometry.mesh import adjacent_sides, sides_among
from ..geometry.sides import two_sides
from ..path.virtual_splits import WorkingMesh
from .finite_elements import FiniteElements
from .initial_loop import InitialLoop
from .sparse_solver import factorised

LEAST_DISTANCE = 1e-3
"""Least distance of a vertex off the path, in mean edge lengths; the heat method may give 0."""


def signed_distance(
    elements: FiniteElements, loop: InitialLoop, edge_length: float, side: IntArray
) -> FloatArray:
    """Compute the geodesic distance to the initial path, with the sign of the side of the path.

    Parameters
    ----------
    elements : FiniteElements
        Operators of the working mesh; the distance is in their unit of length.
    loop : InitialLoop
    edge_length : float
        Mean edge length, in the same unit.
    side : (n,) int array
        Sign, ±1, of the side of each vertex; ignored on the path.

    Returns
    -------
    (n,) float array
        Signed distance, zero on the path and nowhere else.
    """
    distance = heat_distance(elements, loop.vertices, edge_length**2)
    distance = np.maximum(distance, LEAST_DISTANCE * edge_length)
    distance[loop.vertices] = 0.0
    return side * distance


def heat_distance(elements: FiniteElements, sources: IntArray, time: float) -> FloatArray:
    """Compute the distance to source vertices by the heat method (Crane et al. 2017), shape (n,).

    Heat diffuses from the sources for a short time, the gradient of the heat is normalised and
    reversed, and the distance is the function whose gradient is closest to it in the least-squares
    sense.

    Parameters
    ----------
    elements : FiniteElements
    sources : (l,) int array
        Source vertices.
    time : float
        Diffusion time; usually the square of the mean edge length.
    """
    mass = sparse.diags_array(elements.vertex_areas)
    heat = np.zeros(len(elements.vertex_areas))
    heat[sources] = 1.0
    heat = factorised(mass + time * elements.stiffness)(heat)
    gradient = (elements.gradient @ heat).reshape(3, -1)
    length = np.linalg.norm(gradient, axis=0)
    # Where the heat underflows to zero, the gradient has no direction and stays zero.
    direction = -gradient / np.where(length > 0.0, length, 1.0)
    flux = elements.gradient.T @ (elements.face_areas * direction).ravel()
    area = elements.vertex_areas.sum()
    # Without a share of the mass matrix, the Poisson system is singular.
    distance = factorised(elements.stiffness + (1e-8 / area) * mass)(flux)
    return distance - distance[sources].mean()


def bounding_side(
    working: WorkingMesh, elements: FiniteElements, loop: InitialLoop
) -> IntArray | None:
    """Signs of the two sides of a closed path: -1 inside, +1 outside and 0 on the path, shape (n,).

    The side with the smaller area is inside. The result is None if the path bounds no region, such
    as a meridian of a torus.
    """
    on_loop = np.zeros(len(working.vertices), dtype=bool)
    on_loop[loop.vertices] = True
    beside = working.edges[~on_loop[working.edges].any(axis=1)]
    sides = np.stack(adjacent_sides(working.faces), axis=1)
    on_path = sides_among(working.faces, loop.edges)[sides[:, 0]]
    # Side s is opposite corner s, so these are the vertices across the edges of the path.
    across = working.faces.ravel()[sides[on_path]]
    crossed = np.arange(len(beside) + len(across)) >= len(beside)
    _, side = two_sides(len(on_loop), np.concatenate([beside, across]), crossed)
    if not side.all():
        return None
    side[on_loop] = 0
    inside = elements.vertex_areas[side < 0].sum()
    outside = elements.vertex_areas[side > 0].sum()
    return side if inside <= outside else -side
