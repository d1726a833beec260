"""How a design ended."""

from __future__ import annotations

import enum


class Status(enum.Enum):
    """How a design ended; ``str()`` says what to change."""

    CONVERGED = "converged: one curve through all control points"
    ITERATION_LIMIT = (
        "stopped before the energy converged; the curve is usable; a finer mesh, a mesh without "
        "defects or other control points may give a fairer one"
    )
    DIVERGED = (
        "the energy became infinite or NaN; the best earlier curve is returned; look for faces "
        "without area, or merge vertices by distance"
    )
    UNRELAXED = (
        "strands of the curve are too close together to relax; the unrelaxed curve is returned; "
        "use a finer mesh, fewer points or another order"
    )
    CANCELLED = (
        "cancelled by the progress function; the curve, if there was one already, is the best so "
        "far, and the same request without cancelling gives the finished curve"
    )
    NOT_ONE_CURVE = (
        "the level set is not one simple curve through all control points; the mesh may be too "
        "coarse there; subdivide it, or use the method 'elastic'"
    )

    def __str__(self) -> str:
        """What happened and what to change."""
        return self.value
