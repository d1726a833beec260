"""Measures independently how two curves on a mesh lie to each other: contacts, and least distance.

Contacts are decided by the exact predicates of `checker`. Distances along the surface are those of
libigl's exact geodesics, between the vertices of a mesh that has been cut along both curves.
"""

from __future__ import annotations

import igl
import numpy as np

import nicmm_core as nicmm
from nicmm_core.geometry.array_types import FloatArray
from nicmm_core.geometry.curve import checked_curve, curve_on_mesh, weights_in_faces
from nicmm_core.repair.face_parts import FaceParts

from . import checker

AT_JUNCTION = 1e-9
"""Distance up to which a point is a junction, in bounding-box diagonals."""

SNAP = 1e-5
"""Distance, in edges, up to which cuts move to vertices.

On thinner triangles, libigl needs far too much memory."""


def contacts(
    mesh: nicmm.Mesh,
    one: nicmm.SurfaceCurve,
    other: nicmm.SurfaceCurve,
    junctions: FloatArray | None = None,
) -> int:
    """Number of places at which two curves cross or touch, junctions excepted.

    Parameters
    ----------
    mesh : Mesh
    one, other : SurfaceCurve
    junctions : (j, 3) float array, optional
        Positions of points of the first curve, the chords at which are not tested.
    """
    faces = mesh.faces
    places = [checker._places(faces, curve) for curve in (one, other)]
    vertices, weights = (np.concatenate(both) for both in zip(*places, strict=True))
    ours, theirs = _chords(one), _chords(other)
    if junctions is not None and len(junctions):
        away = np.linalg.norm(one.points[:, None] - junctions, axis=2).min(axis=1)
        at_junction = away <= AT_JUNCTION * mesh.diagonal
        ours = ours[~at_junction[ours].any(axis=1)]
    theirs = theirs + len(one.points)

    def count(chords):
        simplices, on_face = checker._common_simplices(faces, vertices, chords)
        return sum(checker._contacts(vertices, weights, chords[on_face], simplices[on_face]))

    return count(np.concatenate([ours, theirs])) - count(ours) - count(theirs)


def least_distance(
    mesh: nicmm.Mesh,
    one: nicmm.SurfaceCurve,
    other: nicmm.SurfaceCurve,
    spacing: float,
    among: FloatArray | None = None,
) -> float:
    """Least distance along the surface of an oriented manifold between two curves.

    Parameters
    ----------
    mesh : Mesh
    one, other : SurfaceCurve
        Curves that do not meet.
    spacing : float
        Greatest distance between the points of the other curve from which distances are computed,
        in mesh units.
    among : (n,) bool array, optional
        The points of the first curve that are measured; by default all.
    """
    first = nicmm.cut_mesh(mesh, other_with_points(mesh, other, spacing), snap=SNAP)
    parts = FaceParts(first.faces, first.source_face, first.corner_weights(mesh))
    curve, segment_faces = checked_curve(mesh, one)
    inside = weights_in_faces(mesh, curve.faces, curve.barycentric, segment_faces)
    if not curve.closed:
        segment_faces[-1] = curve.faces[-1]
        inside[-1] = curve.barycentric[-1]
    held = curve_on_mesh(mesh, curve.closed, segment_faces, inside, curve.control_index)
    points, segment = parts.through(mesh, held)
    there = curve_on_mesh(
        first.mesh, curve.closed, points.faces, points.barycentric, np.zeros(0, np.int64)
    )
    second = nicmm.cut_mesh(first.mesh, there, snap=SNAP)
    measured = second.chain
    if among is not None:
        measured = measured[among[segment[second.chain_point]]]
    none = np.zeros(0, dtype=np.int64)
    distance = igl.exact_geodesic(second.vertices, second.faces, first.chain, none, measured, none)
    return float(np.min(distance))


def other_with_points(
    mesh: nicmm.Mesh, curve: nicmm.SurfaceCurve, spacing: float
) -> nicmm.SurfaceCurve:
    """The curve with more points, at most a distance apart."""
    curve, faces = checked_curve(mesh, curve)
    chords = _chords(curve)
    faces = faces[: len(chords)]
    start, end = (
        weights_in_faces(mesh, curve.faces[ends], curve.barycentric[ends], faces)
        for ends in chords.T
    )
    count = np.ceil(np.linalg.norm(curve.steps, axis=1) / spacing).astype(int).clip(1)
    which = np.repeat(np.arange(len(chords)), count)
    share = (np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)) / count[which]
    weights = (1.0 - share)[:, None] * start[which] + share[:, None] * end[which]
    faces = faces[which]
    if not curve.closed:
        faces, weights = np.append(faces, faces[-1]), np.concatenate([weights, end[-1:]])
    return curve_on_mesh(mesh, curve.closed, faces, weights, np.zeros(0, np.int64))


def _chords(curve: nicmm.SurfaceCurve):
    """Indices of the ends of each chord, (c, 2)."""
    n = len(curve.points)
    first = np.arange(n if curve.closed else n - 1)
    return np.stack([first, (first + 1) % n], axis=1)
