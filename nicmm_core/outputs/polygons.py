"""Polygons of a cut mesh, for meshes whose triangles come from quads and other polygons.

The triangles of a cut polygon are merged into polygons on each side of the curve, as after a knife
cut. Polygons that the curve does not cross are unchanged.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from ..geometry.array_types import FloatArray, IntArray
from ..geometry.grouping import components
from .cut import CutMesh


@dataclass(frozen=True)
class CutPolygons:
    """Polygons that replace the polygons that were cut.

    Attributes
    ----------
    corners : list of (k,) lists of int
        Vertices of the cut mesh, with the orientation of its faces.
    triangles : list of (k,) lists of int
        For each corner, a face of the cut mesh that has this corner and lies in the polygon.
    source : (p,) int array
        The input polygon of which each polygon is a part.
    """

    corners: list[list[int]]
    triangles: list[list[int]]
    source: IntArray


def cut_polygons(cut: CutMesh, source_polygon: IntArray, joined: bool = True) -> CutPolygons:
    """Merge the triangles of every cut polygon, except across the curve.

    Parameters
    ----------
    cut : CutMesh
    source_polygon : (F,) int array
        The polygon to which each face of the input mesh belongs.
    joined : bool, default True
        If False, cut polygons stay triangles.

    Returns
    -------
    CutPolygons
        The parts of polygons that were cut; other polygons are not included.
    """
    polygon = source_polygon[cut.source_face]
    is_cut = np.bincount(cut.source_face) > 1
    pairs, on_chain = cut.adjacent_faces
    one, other = pairs.T
    # The curve may also cut a polygon along a diagonal without cutting a triangle.
    along = polygon[one][on_chain & (polygon[one] == polygon[other])]
    touched = np.isin(polygon, np.concatenate([source_polygon[is_cut], along]))
    joins = joined & ~on_chain & (polygon[one] == polygon[other])
    _, group = components(len(cut.faces), one[joins], other[joins])
    members = defaultdict(list)
    for face in np.flatnonzero(touched).tolist():
        members[int(group[face])].append(face)

    corners: list[list[int]] = []
    triangles: list[list[int]] = []
    source: list[int] = []
    for faces in members.values():
        outline = _outline(cut, faces)
        pieces = [[(v, f) for v in cut.faces[f].tolist()] for f in faces]
        for piece in pieces if outline is None else [outline]:
            corners.append([v for v, _ in piece])
            triangles.append([f for _, f in piece])
            source.append(int(polygon[faces[0]]))
    return CutPolygons(corners, triangles, np.array(source, dtype=np.int64))


def _outline(cut: CutMesh, faces: list[int]) -> list[tuple[int, int]] | None:
    """Corners around the union of some triangles, each with one of the triangles at it.

    None if the triangles cannot be merged, because they are bent too much or do not form a disc
    with all corners on its rim.
    """
    if not _is_flat(cut.vertices, cut.faces[faces]):
        return None
    sides = [(a, b, face) for face in faces for a, b in _sides_of(cut, face)]
    found = {(a, b) for a, b, _ in sides}
    rim = [
        (a, b, face)
        for a, b, face in sides
        if (b, a) not in found or (a, b) in cut.directed_chain_edges
    ]
    after = {a: (b, face) for a, b, face in rim}
    if not len(rim) == len(after) == len(np.unique(cut.faces[faces])):
        return None
    start = here = min(after)
    outline = []
    while here in after:
        following, face = after.pop(here)
        outline.append((here, face))
        here = following
    return outline if here == start and not after else None


def _sides_of(cut: CutMesh, face: int) -> list[tuple[int, int]]:
    a, b, c = cut.faces[face].tolist()
    return [(a, b), (b, c), (c, a)]


def _is_flat(vertices: FloatArray, faces: IntArray) -> bool:
    """Whether triangles form a graph of limited slope over their mean plane."""
    corner = vertices[faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    length = np.linalg.norm(normal, axis=1)
    together = normal.sum(axis=0)
    # A merged polygon is nearly plane.
    return bool((normal @ together > 0.9 * length * np.linalg.norm(together)).all())
