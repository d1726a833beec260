"""Straight ways over the faces of a mesh: from point to point, and sideways by a length.

A way is a normal section: the intersection of the surface with a plane that stands on it. It is
followed from face to face by the signs of the plane at their corners, so that it cannot get lost
between two faces, and all ways of one call advance together. Two consecutive points of a way lie
in one face, the one that carries the first of them.

Costs follow the number of faces passed and not the size of the mesh.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import tolerances
from .array_types import BoolArray, FloatArray, IntArray
from .mesh import Mesh
from .surface_points import SurfacePoints

MOST_FACES = 4096
"""Faces that a way may pass; a section that goes round the surface is no short way."""


@dataclass(frozen=True)
class Joins:
    """Ways between m pairs of points, without their ends.

    Attributes
    ----------
    reached : (m,) bool array
        Whether the way arrived. Those that did not have no crossings.
    pair : (q,) int array
        The pair that each crossing of an edge belongs to, ascending.
    crossings : SurfacePoints
        Where the ways cross edges, in order, each in the face that it enters there.
    """

    reached: BoolArray
    pair: IntArray
    crossings: SurfacePoints


def join(
    mesh: Mesh, start: SurfacePoints, end: SurfacePoints, normals: FloatArray, detour: float
) -> Joins:
    """Ways from points inside faces to other points nearby.

    Parameters
    ----------
    mesh : Mesh
    start : SurfacePoints
        m points, each strictly inside its face.
    end : SurfacePoints
        m points anywhere: a vertex counts as reached in every face round it.
    normals : (m, 3) float array
        Directions that the planes contain.
    detour : float
        Longest way, relative to the straight distance in space.
    """
    origin, goal = start.positions(mesh), end.positions(mesh)
    forward = goal - origin
    walk = _Walk(mesh, start.faces, start.barycentric, origin, normals, forward)
    longest = detour * np.linalg.norm(forward, axis=1)
    support = np.where(end.barycentric > 0.0, mesh.faces[end.faces], -1)
    travelled = np.zeros(len(origin))
    reached = np.zeros(len(origin), dtype=bool)
    active = np.arange(len(origin))
    pairs: list[IntArray] = []
    faces: list[IntArray] = []
    barycentrics: list[FloatArray] = []
    for _ in range(MOST_FACES):
        corners = mesh.faces[walk.faces[active]]
        inside = (support[active][:, :, None] == corners[:, None, :]).any(axis=2)
        arrived = (inside | (support[active] < 0)).all(axis=1)
        reached[active[arrived]] = True
        active = active[~arrived]
        if not len(active):
            break
        advance = walk.cross(active)
        travelled[active] += np.where(np.isfinite(advance), advance, 0.0)
        active = active[np.isfinite(advance) & (travelled[active] <= longest[active])]
        pairs.append(active)
        faces.append(walk.faces[active])
        barycentrics.append(walk.barycentric[active])
    pair = np.concatenate([*pairs, np.zeros(0, np.int64)])
    kept = np.flatnonzero(reached[pair])
    kept = kept[np.argsort(pair[kept], kind="stable")]
    crossings = SurfacePoints(
        np.concatenate([*faces, np.zeros(0, np.int64)])[kept],
        np.concatenate([*barycentrics, np.zeros((0, 3))])[kept],
    )
    once = _last_of_each_vertex(mesh, pair[kept], crossings)
    crossings = SurfacePoints(crossings.faces[once], crossings.barycentric[once])
    return Joins(reached, pair[kept][once], crossings)


def _last_of_each_vertex(mesh: Mesh, pair: IntArray, crossings: SurfacePoints) -> BoolArray:
    """False where a way that turns about a vertex, from face to face, crosses there once more."""
    here = crossings.barycentric > 0.0
    vertex = np.where(here, mesh.faces[crossings.faces], -1).max(axis=1)
    vertex[here.sum(axis=1) > 1] = -1
    last = np.ones(len(pair), dtype=bool)
    last[:-1] = (vertex[:-1] < 0) | (vertex[:-1] != vertex[1:]) | (pair[:-1] != pair[1:])
    return last


def moved(
    mesh: Mesh, start: SurfacePoints, direction: FloatArray, length: FloatArray
) -> tuple[SurfacePoints, BoolArray]:
    """Points moved along the surface.

    Parameters
    ----------
    mesh : Mesh
    start : SurfacePoints
        m points, each strictly inside its face.
    direction : (m, 3) float array
        Unit vectors about tangent to the faces.
    length : (m,) float array
        Not negative.

    Returns
    -------
    SurfacePoints
        Strictly inside their faces.
    (m,) bool array
        Which came to a boundary, or an edge of three faces, and stayed beside it.
    """
    origin = start.positions(mesh)
    normals = mesh.face_normals[start.faces]
    walk = _Walk(mesh, start.faces, start.barycentric, origin, normals, direction)
    left = length.copy()
    faces, barycentric = start.faces.copy(), start.barycentric.copy()
    blocked = np.zeros(len(origin), dtype=bool)
    active = np.flatnonzero(left > 0.0)
    for _ in range(MOST_FACES):
        if not len(active):
            break
        before_faces, before = walk.faces[active].copy(), walk.barycentric[active].copy()
        advance = walk.cross(active)
        stuck = ~np.isfinite(advance)
        share = np.where(stuck, 1.0, np.clip(left[active] / np.maximum(advance, _TINY), 0.0, 1.0))
        stops = stuck | (left[active] <= advance)
        faces[active] = before_faces
        barycentric[active] = before + share[:, None] * (walk.exit[active] - before)
        blocked[active[stuck]] = True
        left[active] -= np.where(stuck, 0.0, advance)
        active = active[~stops]
    return SurfacePoints(faces, strictly_inside(barycentric)), blocked


def strictly_inside(barycentric: FloatArray) -> FloatArray:
    """Coordinates drawn off the sides and corners of their faces by `tolerances.INSIDE`."""
    drawn = np.maximum(barycentric, tolerances.INSIDE)
    return drawn / drawn.sum(axis=1, keepdims=True)


_TINY = float(np.finfo(np.float64).tiny)


class _Walk:
    """Positions of m walkers, each in its plane; arrays change with every crossing."""

    def __init__(
        self,
        mesh: Mesh,
        faces: IntArray,
        barycentric: FloatArray,
        origin: FloatArray,
        normals: FloatArray,
        forward: FloatArray,
    ) -> None:
        self.mesh = mesh
        self.faces = faces.copy()
        self.barycentric = barycentric.copy()
        self.exit = barycentric.copy()  # (m, 3) where each left the face before
        self._position = origin.copy()
        self._entry = np.full(len(faces), -1)
        self._origin = origin
        self._forward = forward
        self._across = np.cross(normals, forward)

    def cross(self, walkers: IntArray) -> FloatArray:
        """Take walkers over the next edge; the length of the step.

        It is inf, and the walker stays, where no face or more than one lies beyond, or the plane
        leaves the face nowhere.
        """
        faces = self.faces[walkers]
        corners = self.mesh.faces[faces]  # (w, 3)
        positions = self.mesh.vertices[corners]  # (w, 3, 3)
        offset = positions - self._origin[walkers][:, None]
        height = (offset * self._across[walkers][:, None]).sum(axis=2)  # (w, 3)
        # Side j lies opposite corner j.
        first, second = [1, 2, 0], [2, 0, 1]
        above = height >= 0.0
        crossed = above[:, first] != above[:, second]
        crossed[np.arange(len(walkers)), self._entry[walkers]] &= self._entry[walkers] < 0
        step = height[:, second] - height[:, first]
        fraction = np.where(crossed, -height[:, first] / np.where(crossed, step, 1.0), 0.0)
        points = positions[:, first] + fraction[..., None] * (
            positions[:, second] - positions[:, first]
        )
        ahead = ((points - self._origin[walkers][:, None]) * self._forward[walkers][:, None]).sum(2)
        # After the start one side is left; at the start two are, one behind and one ahead.
        side = np.where(crossed, ahead, -np.inf).argmax(axis=1)
        rows = np.arange(len(walkers))
        leaves = crossed[rows, side]
        fraction, point = fraction[rows, side], points[rows, side]

        exit_point = np.zeros((len(walkers), 3))
        exit_point[rows, (side + 1) % 3] = 1.0 - fraction
        exit_point[rows, (side + 2) % 3] = fraction
        self.exit[walkers[leaves]] = exit_point[leaves]
        beyond = self.mesh.face_neighbours[faces, side]
        goes = leaves & (beyond >= 0)
        length = np.linalg.norm(point - self._position[walkers], axis=1)

        to = walkers[goes]
        entered = beyond[goes]
        here = corners[rows, (side + 1) % 3][goes]
        self.faces[to] = entered
        at_first = self.mesh.faces[entered] == here[:, None]
        at_second = self.mesh.faces[entered] == corners[rows, (side + 2) % 3][goes][:, None]
        weight = fraction[goes][:, None]
        self.barycentric[to] = at_first * (1.0 - weight) + at_second * weight
        self._entry[to] = (~(at_first | at_second)).argmax(axis=1)
        self._position[to] = point[goes]
        return np.where(goes, length, np.inf)
