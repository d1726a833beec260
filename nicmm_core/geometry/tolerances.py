"""Every tolerance of the package, once; each is relative to a length of the mesh or a pure number.

Lengths are never absolute: a mesh in micrometres and one in kilometres get the same curve.
"""

import numpy as np

ON_SURFACE = 1e-4
"""Farthest that a control point may lie from the surface, in bounding-box diagonals."""

SNAP = 1e-6
"""Barycentric coordinates below this count as zero: the point is on an edge or a vertex."""

COINCIDENT = 1e-9
"""Two control points closer than this, in bounding-box diagonals, are the same point."""

BARYCENTRIC_SUM = 1e-6
"""How far the barycentric coordinates that a caller gives may be from summing to one."""

INSIDE = 1e-6
"""Least barycentric coordinate of a point that has to lie strictly inside its face."""

FLAT = 1e-6
"""Curvature up to which a surface is a plane, in one over bounding-box diagonals."""

WITHOUT_AREA = 1e-4
"""Sine between the longest and the shortest edge of a face below which it counts as without area.

Cotangents are found from lengths of edges, with which no sine below 1e-8 can be told from none, and
a bending energy with cotangents of a millionth degree is no energy of the surface any more.
"""

SAME_CURVE = 1e-6
"""Distance, in bounding-box diagonals, up to which points are those of the same curve."""

AT_ONE_PLACE = 1e-12
"""Length of an edge, in bounding-box diagonals, up to which its ends are at one place."""

MOVED = 1e-3
"""How far vertices of faces without area are moved, in lengths of their shortest edge."""

ROUNDED = 1e-12
"""Barycentric coordinates below this are zero up to rounding, where a point is seen in a part of
its face."""

TINY = float(np.finfo(np.float64).tiny)
"""Least divisor; what is divided by it is zero too."""
