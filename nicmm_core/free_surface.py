"""What obstacles of weight 1 leave of a surface: there no curve has any length inside them.

Faces whose three corners have weight 1 are taken away, and with a clearance all faces near them.
The rest is a mesh with boundaries, along which every stage knows its way: paths keep off it, coarse
cells end there, and nodes that come to it stay. So avoiding obstacles needs no terms and no weights
of its own, and a curve that cannot avoid them is found out before anything is solved.
"""

from __future__ import annotations

import numpy as np

from .array_types import BoolArray, FloatArray
from .errors import UnreachableError
from .level_set.redistancing import build_distance_surface, spread
from .mesh import Mesh
from .mesh_copy import MeshCopy
from .path.leg_graph import fans
from .request import Request

HARD = 1.0
"""Weight from which an obstacle is not to be entered; below, it costs in proportion."""


def free_surface(mesh: Mesh, obstacles: FloatArray, clearance: float) -> MeshCopy | None:
    """The surface without its obstacles; None where they do not take a face away.

    Parameters
    ----------
    mesh : Mesh
    obstacles : (V,) float array
    clearance : float
        Distance along the surface, in mesh units, that curves keep from obstacles of weight 1.

    Raises
    ------
    UnreachableError
        If nothing is left.
    """
    blocked = _blocked_faces(mesh, obstacles >= HARD, clearance)
    if not blocked.any():
        return None
    face = np.flatnonzero(~blocked)
    if not len(face):
        raise UnreachableError(
            "obstacles leave nothing of the surface; paint less with weight 1, or use a smaller "
            "clearance"
        )
    # Parts that meet in nothing but a vertex come apart there: no curve passes between them.
    corners, vertex = fans(Mesh(mesh.vertices, mesh.faces[face]))
    return MeshCopy(mesh, Mesh(mesh.vertices[vertex], corners), face, vertex)


def check_reachable(free: MeshCopy, request: Request) -> None:
    """Raise UnreachableError where obstacles enclose control points, or lie between them."""
    sets = {"control_points": request.points}
    sets |= {f"via_points[{key}]": points for key, points in request.via_points.items()}
    component: dict[str, set[int]] = {}
    for name, points in sets.items():
        for index, faces in enumerate(free.candidates(points)):
            if not len(faces):
                raise UnreachableError(
                    f"{name}[{index}] lies inside an obstacle of weight 1, or closer to one than "
                    "the clearance; move it, or paint less"
                )
            component[f"{name}[{index}]"] = set(free.mesh.face_component[faces].tolist())
    first, common = next(iter(component.items()))
    for name, own in component.items():
        if not own & common:
            raise UnreachableError(
                f"obstacles of weight 1 separate {name} from {first}; leave a way between them, or "
                "lower the weights there"
            )


def _blocked_faces(mesh: Mesh, hard: BoolArray, clearance: float) -> BoolArray:
    """Faces that no curve may enter, shape (F,)."""
    inside = hard[mesh.faces].all(axis=1)
    if clearance <= 0.0 or not hard.any():
        return inside
    distance = np.where(hard, 0.0, np.inf)
    surface = build_distance_surface(mesh.vertices, mesh.faces, mesh.mean_edge_length)
    spread(surface, distance, clearance)
    return inside | (distance[mesh.faces] < clearance).any(axis=1)
