"""The scales at which a measurement can run."""

from __future__ import annotations

import enum


class Scale(enum.Enum):
    """Extent of a measurement.

    FULL is the scale of RESULTS.md, QUICK runs all measurements within minutes, and SMOKE only
    tests that they run.
    """

    FULL = "full"
    QUICK = "quick"
    SMOKE = "smoke"

    def choose(self, full: int, quick: int, smoke: int = 1) -> int:
        """The argument that belongs to this scale."""
        return {Scale.FULL: full, Scale.QUICK: quick, Scale.SMOKE: smoke}[self]
