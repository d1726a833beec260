"""The part of the surface outside obstacles of weight 1, which curves never enter.

Faces whose three corners have weight 1 are removed, and with a clearance also all faces near them.
The remaining faces form a surface with boundaries, which every stage handles: paths avoid
boundaries, coarse cells end there, and nodes that reach a boundary stop there. So obstacles need no
additional energy terms, and obstacles that no curve can avoid are detected before anything is
solved.
"""

from __future__ import annotations

import numpy as np

from ..errors import PointName, UnreachableError
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.distances import build_distance_surface, propagate
from ..geometry.surface_points import SurfacePoints
from .mapped_mesh import MappedMesh

HARD = 1.0
"""Weight of an obstacle that curves must not enter. Lower weights add a cost in proportion."""


def free_faces(mapped: MappedMesh, obstacles: FloatArray, clearance: float) -> IntArray:
    """Faces that are neither inside obstacles of weight 1 nor closer to them than the clearance.

    Parameters
    ----------
    mapped : MappedMesh
        Map of a manifold made from all faces. Distances are measured on this manifold.
    obstacles : (V,) float array
        Weights of the obstacles at the vertices of the original.
    clearance : float
        Distance along the surface, in mesh units, that curves keep from obstacles of weight 1.

    Returns
    -------
    (u,) int array
        Free faces of the original, ascending.

    Raises
    ------
    UnreachableError
        If no face is free.
    """
    faces = mapped.original.faces
    # Of several coincident vertices, for example on a seam, the caller may have marked only one.
    place = mapped.clean.place
    hard_places = np.zeros(place.max() + 1, dtype=bool)
    hard_places[place[obstacles >= HARD]] = True
    hard = hard_places[place]
    blocked = hard[faces].all(axis=1)
    if clearance > 0.0 and hard.any():
        blocked |= (_distances(mapped, hard, clearance)[faces] < clearance).any(axis=1)
    free = np.flatnonzero(~blocked)
    if not len(free):
        raise UnreachableError(
            "obstacles cover the whole surface; paint a smaller area with weight 1, or use a "
            "smaller clearance"
        )
    return free


def _distances(mapped: MappedMesh, hard: BoolArray, farthest: float) -> FloatArray:
    """Distance of each vertex of the original from obstacles, (V,), computed up to ``farthest``."""
    mesh = mapped.mesh
    here = mapped.weights_to(hard.astype(np.float64))
    distance = np.where(here >= HARD, 0.0, np.inf)
    surface = build_distance_surface(mesh.vertices, mesh.faces, mesh.mean_edge_length)
    propagate(surface, distance, farthest)
    return mapped.field_back(np.minimum(distance, farthest))


def check_reachable(free: MappedMesh, named: dict[str, SurfacePoints]) -> None:
    """Raise UnreachableError if points lie inside obstacles or are separated by them.

    Parameters
    ----------
    free : MappedMesh
        Map of a manifold made from the faces outside obstacles.
    named : dict of str to SurfacePoints
        Points of the original by the name of their argument.
    """
    component: dict[PointName, set[int]] = {}
    for argument, points in named.items():
        for index, point in enumerate(free.representations(points)):
            name = PointName(argument, index)
            if not len(point):
                raise UnreachableError(
                    f"{name} lies inside an obstacle of weight 1, or closer to one than the "
                    "clearance; move it, or paint a smaller area",
                    name,
                )
            component[name] = set(free.mesh.face_component[point.faces].tolist())
    first, common = next(iter(component.items()))
    for name, own in component.items():
        if not own & common:
            raise UnreachableError(
                f"obstacles of weight 1 separate {name} from {first}; leave a path between them, "
                "or lower the weights there",
                name,
                first,
            )
