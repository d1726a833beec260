# SPDX-License-Identifier: GPL-3.0-or-later
"""The control points of a curve: places on the surface, and at which of them the curve may turn."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ...nicmm_core import SurfacePoints


@dataclass(frozen=True)
class ControlPoints:
    """Control points in the order in which the curve visits them.

    Attributes
    ----------
    places : SurfacePoints of the core
        Their places on the surface.
    corners : (k,) bool array
        Whether each point is a corner, at which the curve may turn freely.
    """

    places: SurfacePoints
    corners: np.ndarray

    def __len__(self) -> int:
        return len(self.corners)
