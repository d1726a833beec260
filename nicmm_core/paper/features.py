"""The network's input (section 3.1): x = [P, N, φ_p, φ₀] or [P, N, φ_p, φ₀, φ_fea] per vertex."""

from __future__ import annotations

import numpy as np

from ..geometry.array_types import FloatArray, IntArray
from ..geometry.numbering import principal_frame

BASE_CHANNELS = 8
"""Number of channels without φ_fea: three for the position, three for the normal, φ_p and φ₀."""


def control_indicator(response: FloatArray) -> FloatArray:
    """Compute φ_p, which is 1 at the control points and falls to 0 around them, shape (n,).

    Eq. 1 sets φ_p to 1 at single vertices and to 0 at their neighbours: a spike whose size depends
    on the mesh. The network sees one vertex at a time, so each spike is replaced by a smooth field.

    Parameters
    ----------
    response : (n, k) float array
        Smooth fields, one per control point. Column j is 1 at control point j and 0 at all other
        control points.
    """
    return response.sum(axis=1)


def in_principal_frame(vertices: FloatArray, faces: IntArray, face_areas: FloatArray) -> FloatArray:
    """Positions relative to the surface's centroid, along its principal axes, shape (n, 3).

    In this frame the input, and so the curve, does not depend on the rotation or translation of the
    model, unless the axes are undetermined, as for a sphere.
    """
    frame = principal_frame(vertices, faces, face_areas)
    axes = frame.axes.copy()
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    return (vertices - frame.centre) @ axes


def input_features(
    vertices: FloatArray,
    normals: FloatArray,
    indicator: FloatArray,
    initial_distance: FloatArray,
    features: FloatArray | None,
) -> FloatArray:
    """Stack the input channels of all vertices.

    Parameters
    ----------
    vertices, normals : (n, 3) float array
        P, from `in_principal_frame`, and N.
    indicator : (n,) float array
        φ_p, from `control_indicator`.
    initial_distance : (n,) float array
        φ₀.
    features : (n,) float array or None
        φ_fea.

    Returns
    -------
    (n, 8) float array
        The input features, or (n, 9) with φ_fea.
    """
    channels = [vertices, normals, indicator[:, None], initial_distance[:, None]]
    if features is not None:
        channels.append(features[:, None])
    return np.concatenate(channels, axis=1)
