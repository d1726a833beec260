"""The tolerances of the package, each relative to a length of the mesh or a pure number.

Lengths are never absolute: a mesh in micrometres and one in kilometres get the same curve.
"""

import numpy as np

ON_SURFACE = 1e-4
"""Greatest distance of a control point from the surface, in bounding-box diagonals."""

SNAP = 1e-6
"""Barycentric coordinates below this count as zero: the point is on an edge or a vertex."""

COINCIDENT = 1e-9
"""Two control points closer than this, in bounding-box diagonals, are the same point."""

BARYCENTRIC_SUM = 1e-6
"""Greatest difference from 1 of the sum of barycentric coordinates given by a caller."""

INSIDE = 1e-6
"""Least barycentric coordinate of a point strictly inside its face."""

FLAT = 1e-6
"""Curvature up to which a surface is a plane, in one over bounding-box diagonals."""

WITHOUT_AREA = 1e-4
"""Sine between the longest and the shortest edge of a face below which it counts as without area.

Cotangents are computed from edge lengths, which cannot resolve sines below 1e-8, and a bending
energy with the cotangents of such small angles does not describe the surface.
"""

SAME_CURVE = 1e-6
"""Distance, in bounding-box diagonals, up to which points belong to the same curve."""

AT_ONE_PLACE = 1e-12
"""Length of an edge, in bounding-box diagonals, up to which its ends coincide."""

MOVED = 1e-3
"""How far vertices of faces without area are moved, in lengths of their shortest edge."""

ROUNDED = 1e-12
"""Barycentric coordinates below this are zero up to rounding, after conversion of a point to a part
of its face."""

SAME_COST = 1e-9
"""Difference of two costs of paths, relative to the least cost, that is a rounding error."""

CLEAN_CURVE = 1e-4
"""Greatest distance of a clean version of a curve from the curve, in bounding-box diagonals."""

CLEAN_TUBE = 0.1
"""That distance in radii, if a tube is shown around the curve."""

TINY = float(np.finfo(np.float64).tiny)
"""Least divisor, where the dividend is zero too."""


def of_clean_curve(diagonal: float, radius: float = 0.0) -> float:
    """Greatest distance of a clean version of a curve from the curve, in mesh units.

    Parameters
    ----------
    diagonal : float
        Diagonal of the bounding box of the mesh.
    radius : float, default 0
        Radius of the tube that is shown around the curve, in mesh units; 0 for none.
    """
    of_mesh = CLEAN_CURVE * diagonal
    return min(of_mesh, CLEAN_TUBE * radius) if radius > 0.0 else of_mesh
