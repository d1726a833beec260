"""How much a measurement does."""

from __future__ import annotations

import enum


class Scale(enum.Enum):
    """FULL fills RESULTS.md; QUICK takes minutes for all; SMOKE only shows that it runs."""

    FULL = "full"
    QUICK = "quick"
    SMOKE = "smoke"

    def choose(self, full: int, quick: int, smoke: int = 1) -> int:
        """The number that belongs to this scale."""
        return {Scale.FULL: full, Scale.QUICK: quick, Scale.SMOKE: smoke}[self]
