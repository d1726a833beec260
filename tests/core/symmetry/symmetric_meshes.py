"""Meshes that are symmetric about the plane x = 0, and measures of symmetric curves."""

import igl
import numpy as np
from scipy.spatial import cKDTree

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.mirror import Plane
from nicmm_core.symmetry.half_mesh import half_mesh

MIRROR = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
FLIP = np.array([-1.0, 1.0, 1.0])

NEAR_PLANE = 0.4
"""Distance from the plane, in mean edge lengths, up to which vertices are moved to the plane.

Otherwise there would be needles next to it."""


def symmetric_creature(seed, subdivisions=2):
    """The largest part of a creature with x > 0 and its mirror image, smooth at the plane."""
    mesh = shapes.creature(seed, subdivisions=0)
    vertices = mesh.vertices - mesh.vertices.mean(axis=0)
    vertices[np.abs(vertices[:, 0]) < NEAR_PLANE * mesh.mean_edge_length, 0] = 0.0
    half = half_mesh(nicmm.Mesh(vertices, mesh.faces), Plane(np.zeros(3), np.array(MIRROR[1])))
    component = half.mesh.face_component
    largest = np.bincount(component, weights=half.mesh.face_areas).argmax()
    right = half.mesh.vertices.copy()
    right[half.on_plane, 0] = 0.0
    faces = half.mesh.faces[component == largest]
    image = np.where(half.on_plane, 0, len(right)) + np.arange(len(right))
    every = np.concatenate([faces, image[faces][:, ::-1]])
    used, every = np.unique(every, return_inverse=True)
    both = np.concatenate([right, FLIP * right])[used]
    both_faces = every.reshape(-1, 3)
    # Where both faces of an edge in the plane bend to one side, the edge would have four faces.
    assert igl.is_edge_manifold(both_faces)[0]
    return nicmm.Mesh(*igl.loop(both, both_faces, subdivisions))


def is_symmetric(mesh):
    """Whether every vertex has a mirror image among the vertices."""
    distance, _ = cKDTree(mesh.vertices).query(FLIP * mesh.vertices)
    return distance.max() < 1e-12 * mesh.diagonal


def points_on_right(mesh, count, seed, margin=0.02):
    """Random vertices with x > 0."""
    right = np.flatnonzero(mesh.vertices[:, 0] > margin * mesh.diagonal)
    return np.random.default_rng(seed).choice(right, count, replace=False)


def crossing_angles(mesh, curve, reach=2e-4):
    """Angles along the surface between a curve and the normal of x = 0, where it crosses.

    The direction is that of the chord from a point before the plane. The angle is measured in the
    face there.
    """
    points, n, angles = curve.points, len(curve.points), []
    side = np.where(np.abs(points[:, 0]) < 1e-9 * mesh.diagonal, 0.0, np.sign(points[:, 0]))
    for start in range(n if curve.closed else n - 1):
        end = (start + 1) % n
        if side[start] == 0.0 or side[end] == side[start]:
            continue
        share = points[start, 0] / (points[start, 0] - points[end, 0])
        at_plane = points[start] + share * (points[end] - points[start])
        while np.linalg.norm(points[start] - at_plane) < reach * curve.length:
            start = (start - 1) % n
        normal = mesh.face_normals[curve.faces[start]] * [0.0, 1.0, 1.0]
        along = np.cross(normal / np.linalg.norm(normal), MIRROR[1])
        chord = at_plane - points[start]
        angles.append(abs(np.arctan2(chord @ along, abs(chord[0]))))
    return angles
