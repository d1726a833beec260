"""The link of a vertex, and whether the vertex is simple for a field's signs.

A vertex is simple when the signs round it form one positive and one negative run. Then the zero set
passes its star in one strand, whatever the sign of the vertex itself.
"""

from __future__ import annotations

import numpy as np

from .array_types import IntArray
from .virtual_splits import WorkingMesh


class VertexLinks:
    """Vertices round each vertex in order, found when first asked for."""

    def __init__(self, working: WorkingMesh) -> None:
        corners = working.faces.ravel()
        self._by_vertex = np.argsort(corners, kind="stable") // 3
        self._start = np.searchsorted(np.sort(corners), np.arange(len(working.vertices) + 1))
        self._faces = working.faces
        self._link: dict[int, tuple[list[int], bool] | None] = {}

    def neighbours(self, vertex: int) -> list[int]:
        """Vertices joined to a vertex by an edge."""
        faces = self._faces[self._by_vertex[self._start[vertex] : self._start[vertex + 1]]]
        return [v for v in np.unique(faces).tolist() if v != vertex]

    def is_simple(self, vertex: int, sign: IntArray) -> bool:
        """Whether one positive and one negative run make up the link."""
        link = self._ordered(vertex)
        return link is not None and self.sign_changes(vertex, sign) == (2 if link[1] else 1)

    def sign_changes(self, vertex: int, sign: IntArray) -> int:
        """Changes of sign round the link, zeros passed over; -1 where the link is no simple path.

        A control vertex in the link is a zero, where the curve passes the link itself.
        """
        link = self._ordered(vertex)
        if link is None:
            return -1
        ring, closed = link
        signs = [int(sign[v]) for v in ring if sign[v] != 0]
        if closed:
            signs += signs[:1]
        return sum(a != b for a, b in zip(signs, signs[1:], strict=False))

    def _ordered(self, vertex: int) -> tuple[list[int], bool] | None:
        """The link as a path and whether it closes; None when the surface branches here."""
        if vertex not in self._link:
            self._link[vertex] = self._trace(vertex)
        return self._link[vertex]

    def _trace(self, vertex: int) -> tuple[list[int], bool] | None:
        joined: dict[int, list[int]] = {}
        faces = self._faces[self._by_vertex[self._start[vertex] : self._start[vertex + 1]]]
        for face in faces.tolist():
            a, b = (v for v in face if v != vertex)
            joined.setdefault(a, []).append(b)
            joined.setdefault(b, []).append(a)
        if max(map(len, joined.values())) > 2:
            return None
        ends = [v for v, others in joined.items() if len(others) == 1]
        ring = [ends[0] if ends else next(iter(joined))]
        before = -1
        while True:
            onward = [v for v in joined[ring[-1]] if v != before and v != ring[0]]
            if not onward:
                break
            before = ring[-1]
            ring.append(onward[0])
        return (ring, not ends) if len(ring) == len(joined) else None
