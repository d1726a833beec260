"""Larger faces of a cut mesh, for meshes whose triangles are those of quads and polygons.

What a curve leaves of a polygon on either side becomes one polygon again, as a knife leaves it: a
model of quads stays one of quads where the curve does not pass.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from ..geometry.array_types import FloatArray, IntArray
from .cut import CutMesh
from .shared_sides import shared_sides

BENT = 0.9
"""Least cosine between a triangle's normal and that of the polygon that it may be joined into."""


@dataclass(frozen=True)
class CutPolygons:
    """Polygons that take the place of those that were cut.

    Attributes
    ----------
    corners : list of (k,) lists of int
        Vertices of the cut mesh, turning as its faces do.
    triangles : list of (k,) lists of int
        A face of the cut mesh that has each corner and lies in the polygon.
    source : (p,) int array
        The input polygon that each is a part of.
    """

    corners: list[list[int]]
    triangles: list[list[int]]
    source: IntArray


def cut_polygons(cut: CutMesh, source_polygon: IntArray, joined: bool = True) -> CutPolygons:
    """Put the triangles of cut polygons together again, but not over the curve.

    Parameters
    ----------
    cut : CutMesh
    source_polygon : (F,) int array
        The polygon of each face of the mesh that was cut.
    joined : bool, default True
        Otherwise the cut polygons are left as triangles.

    Returns
    -------
    CutPolygons
        Without polygons in which nothing was cut.
    """
    polygon = source_polygon[cut.source_face]
    is_cut = np.zeros(len(source_polygon), dtype=bool)
    is_cut[cut.source_face[np.flatnonzero(np.diff(cut.source_face, append=-1) == 0)]] = True
    shared = shared_sides(cut.faces, cut.chain_edges)
    one, other = shared.faces.T
    # The curve may follow a diagonal and cut no triangle.
    along = polygon[one][shared.on_chain & (polygon[one] == polygon[other])]
    touched = np.isin(polygon, np.concatenate([source_polygon[is_cut], along]))
    joins = (
        ~shared.on_chain & touched[one] & touched[other] & (polygon[one] == polygon[other])
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
    """Corners round some triangles, each with one that has it; None where they stay triangles.

    They do where they are bent too much, and where they are no disc with all corners on its rim.
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
    """Whether triangles are a graph over the plane that fits them, and not too steep."""
    corner = vertices[faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    length = np.linalg.norm(normal, axis=1)
    together = normal.sum(axis=0)
    return bool((normal @ together > BENT * length * np.linalg.norm(together)).all())
