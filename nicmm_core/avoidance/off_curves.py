"""The part of a surface that keeps a distance from curves and that they do not divide."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ..errors import ControlPointError, PointName, UnreachableError
from ..geometry.array_types import BoolArray
from ..geometry.segment_distances import joined_segments
from ..geometry.surface_points import SurfacePoints
from ..repair.clean_surface import CleanSurface
from ..repair.face_parts import whole_faces
from ..repair.mapped_mesh import MappedMesh
from ..repair.nonmanifold import manifold
from .avoided_curve import Avoided
from .barriers import barriers_of, without_strips
from .clearance import beyond_clearance, distances_near, segments_with_clearance


class DividedSurface(CleanSurface):
    """A surface with divided faces, some of which are left out."""

    @cached_property
    def removed(self) -> BoolArray:
        """Given faces that were removed although they are part of the surface: none, (F,)."""
        return np.zeros(len(self.original.faces), dtype=bool)


def surface_off_curves(
    mapped: MappedMesh, avoided: list[Avoided], clearance: float
) -> MappedMesh | None:
    """The part of a manifold that keeps a distance from curves and that they do not divide.

    Parameters
    ----------
    mapped : MappedMesh
        Map from the given mesh to the manifold.
    avoided : list of Avoided
        Curves on the given mesh.
    clearance : float

    Returns
    -------
    MappedMesh or None
        Map from the mesh of `mapped` to a mesh of parts of its faces; None if no face remains.
    """
    mesh = mapped.mesh
    parts, vertices = whole_faces(mesh.faces), mesh.vertices
    barriers = [piece for each in avoided for piece in barriers_of(mapped, each, clearance)]
    if barriers:
        parts, vertices = without_strips(mesh, barriers, clearance)
    if clearance > 0.0:
        near = [segments_with_clearance(mapped, each, clearance) for each in avoided]
        segments = joined_segments(near)
        if len(segments):
            distances = distances_near(mesh, segments, clearance)
            parts, vertices = beyond_clearance(distances, parts, vertices, clearance)
    if not len(parts.faces):
        return None
    place = np.arange(len(mesh.vertices))
    divided = DividedSurface(
        original=mesh,
        vertices=vertices,
        parts=parts,
        joined=place,
        place=place,
        divisions=np.zeros((0, 3), dtype=np.int64),
        repairs={},
    )
    return manifold(divided, np.arange(len(mesh.faces)), False)


def check_off_curves(
    off: MappedMesh | None, named: dict[str, SurfacePoints], clearance: float
) -> None:
    """Raise an error if points are too close to curves, or are separated by them.

    Parameters
    ----------
    off : MappedMesh or None
        Result of `surface_off_curves`.
    named : dict of str to SurfacePoints
        Points on the mesh from which it is made, by the name of their argument.
    clearance : float

    Raises
    ------
    ControlPointError
        If a point is closer to a curve than the clearance, but not on it.
    UnreachableError
        If points are separated by the curves, or nothing is left of the surface.
    """
    if off is None:
        raise UnreachableError(
            "avoid leaves no part of the surface; use a smaller clearance, or fewer curves"
        )
    component: dict[PointName, set[int]] = {}
    for argument, points in named.items():
        for index, point in enumerate(off.representations(points)):
            name = PointName(argument, index)
            if not len(point):
                raise ControlPointError(
                    f"{name} is closer to a curve of avoid than the clearance ({clearance:g}), or "
                    "right beside one, but does not lie on it; move it onto the curve or away from "
                    "it, or use a smaller clearance",
                    name,
                )
            component[name] = set(off.mesh.face_component[point.faces].tolist())
    first, common = next(iter(component.items()))
    for name, own in component.items():
        if not own & common:
            raise UnreachableError(
                f"the curves of avoid, with their clearance, separate {name} from {first}; leave "
                "out a curve, use a smaller clearance, or add a control point on a curve that may "
                "be crossed",
                name,
                first,
            )
