"""Polygons of a cut mesh, for meshes whose triangles come from quads and other polygons.

The triangles of a cut polygon are merged into polygons on each side of the curve, as after a knife
cut. Polygons that the curve does not cross are unchanged.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from ..geometry.array_types import FloatArray, IntArray
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
    is_cut = np.zeros(len(source_polygon), dtype=bool)
    is_cut[cut.source_face[np.flatnonzero(np.diff(cut.source_face, append=-1) == 0)]] = True
    pairs, on_chain = cut.adjacent_faces
    one, other = pairs.T
    # The curve may also cut a polygon along a diagonal without cutting a triangle.
    along = polygon[one][on_chain & (polygon[one] == polygon[other])]
    touched = np.isin(polygon, np.concatenate([source_polygon[is_cut], along]))
    joins = (
        ~on_chain & touched[one] & touched[other] & (polygon[one] == polygon[other])
        if joined
        else np.zeros(len(one), dtype=bool)
    )
    group = np.arange(len(cut.faces))
    members = {face: [face] for face in np.flatnonzero(touched).tolist()}
    for a, b in zip(one[joins].tolist(), other[joins].tolist(), strict=True):
        a, b = int(group[a]), int(group[b])
        if a != b:
            group[members[b]] = a
            members[a] += members.pop(b)

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
    after: dict[int, list[tuple[int, int]]] = defaultdict(list)
    sides = {(a, b) for f in faces for a, b in _sides_of(cut, f)}
    for face in faces:
        for a, b in _sides_of(cut, face):
            if (b, a) not in sides or (a, b) in cut.directed_chain_edges:
                after[a].append((b, face))
    if len(after) != len(np.unique(cut.faces[faces])) or any(len(n) > 1 for n in after.values()):
        return None
    start = min(after)
    outline, here = [], start
    while True:
        following, face = after[here][0]
        outline.append((here, face))
        here = following
        if here == start:
            break
        if len(outline) > len(after) or here not in after:
            return None
    return outline if len(outline) == len(after) else None


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
