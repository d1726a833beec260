"""Narrow strips along avoided curves, which are removed from the surface.

Faces are cut along the curve, and a strip, narrow relative to the edges there, is taken off. Strips
run along the parts of the curves from which no clearance is kept.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..errors import CurveError
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.curve import SurfaceCurve, curve_on_mesh
from ..geometry.mesh import Mesh, edge_keys, edge_lengths
from ..outputs.cut import cut_mesh
from ..repair.divided_faces import edges_of, with_divided_edges
from ..repair.face_parts import FaceParts
from ..repair.mapped_mesh import MappedMesh
from .avoided_curve import FADE, Avoided, gap_width

STRIP = 0.004
"""Width of a barrier on either side of the curve, as a fraction of the edges there."""

SNAP = 1e-5
"""Barycentric coordinate up to which points of a barrier are moved to an edge or a vertex.

Moved points lead the barrier off the curve. With 1e-3, one barrier in twenty does not cover its
curve.
"""

DEVIATION = 1e-6
"""Greatest distance of a barrier from the curve where points are omitted, in mean edge lengths.

Close to an edge, the strip on that side is hardly wider.
"""

STRIP_OF_CLEARANCE = 0.1
"""Greatest such width, in clearances."""


def barriers_of(mapped: MappedMesh, avoided: Avoided, clearance: float) -> list[SurfaceCurve]:
    """The parts of a curve on the mesh along which a strip is removed, without their gaps.

    With a clearance, these are the parts near junctions from which it is not kept.
    """
    given, junctions = mapped.original, avoided.junctions
    if clearance > 0.0 and not len(junctions):
        return []
    gap = np.array([gap_width(given, avoided, arc, clearance) for arc in junctions])
    breaks = avoided.ends(gap)
    if clearance > 0.0:
        breaks = np.append(breaks, avoided.ends(FADE * clearance))
    segments, arc = avoided.pieces(given, breaks)
    used = np.ones(len(arc), dtype=bool)
    for junction, width in zip(junctions, gap, strict=True):
        used &= replace(avoided, junctions=np.array([junction])).from_junctions(arc) >= width
    if clearance > 0.0:
        used &= avoided.from_junctions(arc) <= FADE * clearance
    found = []
    for run, closed in _runs(used, avoided.curve.closed):
        faces, weights = segments.faces[run], segments.start[run]
        if not closed:
            faces = np.append(faces, faces[-1])
            weights = np.concatenate([weights, segments.end[run[-1:]]])
        piece = curve_on_mesh(given, closed, faces, weights, np.zeros(0, np.int64))
        there = mapped.curve_to(piece) if mapped.differs else piece
        if there is None:
            raise CurveError(
                "a curve of avoid enters an obstacle of weight 1 or cannot be mapped at a "
                "non-manifold edge; leave it out, or lower the weights there"
            )
        found.append(there)
    return found


def _runs(used: BoolArray, closed: bool) -> list[tuple[IntArray, bool]]:
    """Runs of consecutive segments that are used, and whether each of them is a closed curve."""
    segment = np.arange(len(used))
    if used.all():
        return [(segment, closed)]
    if closed:
        segment = np.roll(segment, -int((~used).argmax()))
    runs = np.split(segment, np.flatnonzero(~used[segment]))
    runs = [run[used[run]] for run in runs]
    return [(run, False) for run in runs if len(run)]


def without_strips(
    mesh: Mesh, barriers: list[SurfaceCurve], clearance: float
) -> tuple[FaceParts, FloatArray]:
    """The faces without a narrow strip along each of some curves, and the vertices of the parts."""
    cut = cut_mesh(mesh, barriers, snap=SNAP, deviation=DEVIATION * mesh.mean_edge_length)
    parts, vertices, chain = cut.parts(mesh), cut.vertices, cut.chain_edges
    size = len(vertices)
    on_chain = np.zeros(size, dtype=bool)
    on_chain[chain] = True
    near = on_chain[parts.faces].sum(axis=1) >= 2
    sides = edges_of(parts.faces[near], size)
    both = sides[on_chain[sides].all(axis=1)]
    both = both[
        ~np.isin(edge_keys(both[:, 0], both[:, 1], size), edge_keys(chain[:, 0], chain[:, 1], size))
    ]
    middle = size + np.arange(len(both))
    parts, vertices = with_divided_edges(parts, vertices, both, middle, np.full(len(both), 0.5))
    on_chain = np.append(on_chain, np.zeros(len(both), dtype=bool))

    touched = on_chain[parts.faces].any(axis=1)
    sides = edges_of(parts.faces[touched], len(vertices))
    ends = sides[on_chain[sides].sum(axis=1) == 1]
    ends = np.where(on_chain[ends[:, :1]], ends, ends[:, ::-1])
    share = np.full(len(ends), STRIP)
    if clearance > 0.0:
        share = np.minimum(share, STRIP_OF_CLEARANCE * clearance / edge_lengths(vertices, ends))
    middle = len(vertices) + np.arange(len(ends))
    parts, vertices = with_divided_edges(parts, vertices, ends, middle, share)
    on_chain = np.append(on_chain, np.zeros(len(ends), dtype=bool))
    return parts.taken(~on_chain[parts.faces].any(axis=1)), vertices
