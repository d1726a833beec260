"""The network's input (section 3.1): x = [P, N, φ_p, φ₀] or [P, N, φ_p, φ₀, φ_fea] per vertex."""

from __future__ import annotations

import numpy as np

from ..geometry.array_types import FloatArray, IntArray
from ..geometry.numbering import principal_frame

BASE_CHANNELS = 8
"""Position 3, normal 3, φ_p, φ₀."""


def control_indicator(response: FloatArray) -> FloatArray:
    """φ_p: 1 at the control points and falling to 0 around them (Eq. 1), shape (n,).

    Eq. 1 has 1 at single vertices and 0 at their neighbours: a spike whose size depends on the
    mesh. The network sees one vertex at a time, so a smooth field replaces each spike.

    Parameters
    ----------
    response : (n, k) float array
        A smooth field for each control point, 1 there and 0 at the others.
    """
    return response.sum(axis=1)


def in_principal_frame(vertices: FloatArray, faces: IntArray, face_areas: FloatArray) -> FloatArray:
    """Positions about the surface's centroid, along its principal axes, shape (n, 3).

    In this frame the input, and so the curve, does not depend on rotation or translation of the
    model, unless the axes are undetermined, as those of a ball.
    """
    frame = principal_frame(vertices, faces, face_areas)
    axes = frame.signed_axes()
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    return (vertices - frame.centre) @ axes


def input_features(
    vertices: FloatArray,
    normals: FloatArray,
    indicator: FloatArray,
    initial_distance: FloatArray,
    features: FloatArray | None,
) -> FloatArray:
    """Stack the channels: (n, 8), or (n, 9) with a feature map."""
    channels = [vertices, normals, indicator[:, None], initial_distance[:, None]]
    if features is not None:
        channels.append(features[:, None])
    return np.concatenate(channels, axis=1)
