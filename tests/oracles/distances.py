"""Distance between two curves."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from nicmm_core.geometry.curve import SurfaceCurve, resample


def distances(first: SurfaceCurve, second: SurfaceCurve) -> tuple[float, float]:
    """Mean and greatest symmetric distance between two closed curves, in the unit of the mesh."""
    here, _ = resample(first.points, 1000)
    there, _ = resample(second.points, 1000)
    both = np.concatenate([cKDTree(here).query(there)[0], cKDTree(there).query(here)[0]])
    return float(both.mean()), float(both.max())
