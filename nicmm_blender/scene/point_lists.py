# SPDX-License-Identifier: GPL-3.0-or-later
"""Inserts, replaces and removes single points in lists of points of the core."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ...nicmm_core import SurfacePoints


def with_point(
    points: SurfacePoints, number: int, place: SurfacePoints, replaced: bool = False
) -> SurfacePoints:
    """Points with the single point `place` inserted at an index, or replacing the point there."""
    from ... import nicmm_core as nicmm

    rest = without_point(points, number) if replaced else points
    return nicmm.SurfacePoints(
        np.insert(rest.faces, number, place.faces[0]),
        np.insert(rest.barycentric, number, place.barycentric[0], axis=0),
    )


def without_point(points: SurfacePoints, number: int) -> SurfacePoints:
    """Points without the one at an index."""
    return points[np.delete(np.arange(len(points)), number)]
