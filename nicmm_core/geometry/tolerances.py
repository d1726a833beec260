"""The tolerances of the package, each relative to a length of the mesh or a pure number.

Lengths are never absolute, so a mesh has the same curve in micrometres and in kilometres.
"""

import numpy as np

from .array_types import FloatArray

ON_SURFACE = 1e-4
"""Greatest distance of a control point from the surface, in bounding-box diagonals."""

SNAP = 1e-6
"""Barycentric coordinates below this value count as zero: the point is on an edge or a vertex."""

BARYCENTRIC_UNIT = 2.0**-40
"""Barycentric coordinates of given points are multiples of it, about 1e-12. So a point is the same
whether it is given by its coordinates or by its position, which has rounding errors."""

COINCIDENT = 1e-9
"""Two control points closer than this, in bounding-box diagonals, are the same point."""

BARYCENTRIC_SUM = 1e-6
"""Greatest deviation from 1 of the sum of barycentric coordinates that a caller passes."""

INSIDE = 1e-6
"""Least barycentric coordinate of a point strictly inside its face."""

FLAT = 1e-6
"""Curvature up to which a surface counts as a plane, times the bounding-box diagonal."""

DEGENERATE_SINE = 1e-4
"""Sine of the angle between the longest and the shortest edge up to which a face is degenerate.

Cotangents are computed from edge lengths, which cannot resolve sines below 1e-8. Moreover, a
bending energy with the cotangents of such small angles does not describe the surface.
"""

SAME_CURVE = 1e-6
"""Greatest distance between a point of a curve and the position given by its face and barycentric
coordinates, in bounding-box diagonals; beyond it, the curve belongs to another mesh."""

SAME_POSITION = 1e-12
"""Distance, in bounding-box diagonals, up to which two points coincide, such as the two ends of an
edge."""

GAP = 1e-6
"""Width, in bounding-box diagonals, up to which a gap between open edges is closed.

Positions in single precision differ by up to a ten-millionth of the largest coordinate."""

GAP_SHARE = 0.1
"""The same bound relative to the shortest open edge at the gap."""

PERTURBATION = 1e-3
"""Greatest move of a vertex of a degenerate face along each axis, relative to its shortest edge."""

ROUNDED = 1e-12
"""Barycentric coordinates and other pure numbers below this value are zero up to rounding."""

SAME_COST = 1e-9
"""Differences between path costs up to this, relative to the least cost, are rounding errors."""

CLEAN_CURVE = 1e-4
"""Greatest distance between a clean version of a curve and the curve, in bounding-box diagonals."""

CLEAN_TUBE = 0.1
"""The same bound in radii of the tube, if the curve is shown as a tube."""

TINY = float(np.finfo(np.float64).tiny)
"""Least divisor, for quotients whose dividend is zero whenever the divisor is."""


def of_clean_curve(diagonal: float, radius: float = 0.0) -> float:
    """Greatest distance between a clean version of a curve and the curve, in mesh units.

    Parameters
    ----------
    diagonal : float
        Diagonal of the bounding box of the mesh.
    radius : float, default 0
        Radius of the tube that is shown around the curve, in mesh units; 0 for none.
    """
    of_mesh = CLEAN_CURVE * diagonal
    return min(of_mesh, CLEAN_TUBE * radius) if radius > 0.0 else of_mesh


def rounding(positions: FloatArray) -> float:
    """Greatest error of a position that is interpolated between some positions, in their unit.

    It exceeds the tolerances that are relative to the mesh only if the mesh is far from the origin.
    """
    return 16.0 * float(np.finfo(np.float64).eps) * float(np.abs(positions).max(initial=0.0))
