"""The network's input (section 3.1): x = [P, N, φ_p, φ₀] or [P, N, φ_p, φ₀, φ_fea] per vertex."""

from __future__ import annotations

import igl
import numpy as np
from scipy.spatial import cKDTree

from ..array_types import FloatArray, IntArray
from ..progress import checkpoint

BASE_CHANNELS = 8
"""Position 3, normal 3, φ_p, φ₀."""

FEATURE_BASELINE = 1.0
"""Neutral value b of φ_fea where neither obstacle nor alignment is painted.

Eq. 7 squares φ_fea, so a map of both signs would make alignment regions repel as obstacles do.
Around a positive baseline, with alignment lowering it towards 0, the square keeps the order:
alignment < neutral < obstacle, which is what the text asks for.
"""

OBSTACLE_HEIGHT = 3.0
"""What an obstacle of weight 1 adds to the baseline.

The square of φ_fea, which counts in Eq. 7 and in the length of the initial loop, is then 16 times
the neutral one: a detour of that ratio is taken. Alignment can lower it to zero and no further.
"""

FEATURE_WIDTH = 2.0
"""Standard deviation of the Gaussian of a feature vertex of weight 1, in mean edge lengths."""

WEIGHT_LEVELS = 10
"""Steps into which feature weights are rounded up."""


def control_indicator(response: FloatArray) -> FloatArray:
    """φ_p: 1 at the control points and falling to 0 around them (Eq. 1), shape (n,).

    Eq. 1 has 1 at single vertices and 0 at their neighbours. To a network that sees one vertex at
    a time that is a spike, and its size on the surface shrinks with the mesh; so each point's 1
    spreads as a smooth field instead.

    Parameters
    ----------
    response : (n, k) float array
        A smooth field for each control point, 1 there and 0 at the others.
    """
    return response.sum(axis=1)


def in_principal_frame(vertices: FloatArray, faces: IntArray, face_areas: FloatArray) -> FloatArray:
    """Positions about the surface's centroid, along its principal axes, shape (n, 3).

    The network sees coordinates; in this frame a turned or moved model gives the same ones, and
    so the same curve, unless its axes are undetermined as a ball's are.
    """
    centroids = vertices[faces].mean(axis=1)
    share = face_areas / face_areas.sum()
    centre = share @ centroids
    offset = centroids - centre
    _, axes = np.linalg.eigh(offset.T @ (share[:, None] * offset))
    # An axis has no sign of its own: it points to where the surface reaches farther.
    axes = axes * np.where(share @ (offset @ axes) ** 3 < 0.0, -1.0, 1.0)
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    return (vertices - centre) @ axes


def vertex_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Unit normals weighted by corner angle, shape (n, 3); zero where they cancel."""
    checkpoint()
    normals = igl.per_vertex_normals(vertices, faces, igl.PER_VERTEX_NORMALS_WEIGHTING_TYPE_ANGLE)
    return np.nan_to_num(normals)


def feature_map(
    vertices: FloatArray,
    obstacles: FloatArray | None,
    alignment: FloatArray | None,
    edge_length: float,
) -> FloatArray:
    """φ_fea (section 3.3): Gaussians of feature vertices about a neutral baseline, shape (n,).

    Every painted vertex spreads a Gaussian whose standard deviation grows with its weight; the
    strongest response of each kind counts, so that the value does not depend on how many vertices
    a region has. Obstacles raise the map above the baseline, alignment lowers it.

    Parameters
    ----------
    vertices : (n, 3) float array
    obstacles, alignment : (n,) float array of weights in [0, 1], or None
    edge_length : float
        Mean edge length, in the unit of the vertices.
    """
    return (
        FEATURE_BASELINE
        + OBSTACLE_HEIGHT * _spread(vertices, obstacles, edge_length)
        - FEATURE_BASELINE * _spread(vertices, alignment, edge_length)
    )


def _spread(vertices: FloatArray, weights: FloatArray | None, edge_length: float) -> FloatArray:
    """Strongest Gaussian response of the painted vertices at every vertex, in [0, 1]."""
    response = np.zeros(len(vertices))
    if weights is None:
        return response
    painted = np.flatnonzero(weights > 0.0)
    if not len(painted):
        return response
    # Weights act as the Gaussian's width; a few levels of them make one tree query each.
    levels = np.linspace(0.0, 1.0, WEIGHT_LEVELS + 1)[1:]
    level_of = np.searchsorted(levels, weights[painted], side="left").clip(max=WEIGHT_LEVELS - 1)
    for index in np.unique(level_of):
        checkpoint()
        sigma = levels[index] * FEATURE_WIDTH * edge_length
        tree = cKDTree(vertices[painted[level_of == index]])
        distance, _ = tree.query(vertices, distance_upper_bound=4.0 * sigma)
        gaussian = levels[index] * np.exp(-0.5 * (distance / sigma) ** 2)
        response = np.maximum(response, gaussian)
    return response


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
