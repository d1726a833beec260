"""Links of vertices, and the test whether a vertex is simple for the signs of a field.

A vertex is simple if the signs around its link form one positive and one negative run. Then the
zero set crosses the star of the vertex in one strand, whatever the sign of the vertex itself.
"""

from __future__ import annotations

import numpy as np

from ..geometry.array_types import IntArray
from ..path.virtual_splits import WorkingMesh
from .sign_bundle import SignBundle


class VertexLinks:
    """The links of the vertices of a working mesh, each computed and ordered on first use.

    Parameters
    ----------
    working : WorkingMesh
        A manifold.
    bundle : SignBundle, optional
        Signs with which faces read the values of their corners.
    """

    def __init__(self, working: WorkingMesh, bundle: SignBundle | None = None) -> None:
        corners = working.faces.ravel()
        self._by_vertex = np.argsort(corners, kind="stable") // 3
        self._start = np.searchsorted(np.sort(corners), np.arange(len(working.vertices) + 1))
        self._faces = working.faces
        self._corner_sign = None if bundle is None else bundle.corner_sign
        self._ends = frozenset() if bundle is None else frozenset(bundle.ends.tolist())
        self._link: dict[int, tuple[list[int], bool]] = {}

    def neighbours(self, vertex: int) -> list[int]:
        """Vertices joined to a vertex by an edge."""
        faces = self._faces[self._faces_at(vertex)]
        return [v for v in np.unique(faces).tolist() if v != vertex]

    def is_simple(self, vertex: int, sign: IntArray) -> bool:
        """Whether the signs around the link form one positive and one negative run."""
        return self.sign_changes(vertex, sign) == (2 if self._ordered(vertex)[1] else 1)

    def sign_changes(self, vertex: int, sign: IntArray) -> int:
        """Number of sign changes around the link, zeros left out.

        A control vertex in the link has the sign 0, because the curve crosses the link there.
        """
        if vertex in self._ends:
            return self._sign_changes_around_end(vertex, sign)
        ring, closed = self._ordered(vertex)
        relative = self._relative_signs(vertex)
        signs = [int(sign[v]) * relative.get(v, 1) for v in ring if sign[v] != 0]
        if closed:
            signs += signs[:1]
        return sum(a != b for a, b in zip(signs, signs[1:], strict=False))

    def _relative_signs(self, vertex: int) -> dict[int, int]:
        """Signs of the bundle at neighbours of a vertex, relative to its sign at the vertex."""
        if self._corner_sign is None:
            return {}
        relative: dict[int, int] = {}
        for face in self._faces_at(vertex).tolist():
            corners, signs = self._faces[face].tolist(), self._corner_sign[face].tolist()
            own = signs[corners.index(vertex)]
            relative.update((v, own * s) for v, s in zip(corners, signs, strict=True))
        return relative

    def _sign_changes_around_end(self, vertex: int, sign: IntArray) -> int:
        """Number of faces at an end of an open curve whose other two corners differ in sign."""
        around = self._faces_at(vertex)
        assert self._corner_sign is not None  # only a bundle has ends
        local = self._corner_sign[around] * sign[self._faces[around]]
        local[self._faces[around] == vertex] = 0
        return int(((local == 1).any(axis=1) & (local == -1).any(axis=1)).sum())

    def _faces_at(self, vertex: int) -> IntArray:
        """Faces around a vertex."""
        return self._by_vertex[self._start[vertex] : self._start[vertex + 1]]

    def _ordered(self, vertex: int) -> tuple[list[int], bool]:
        """Ordered vertices of the link and whether it is closed."""
        if vertex not in self._link:
            self._link[vertex] = self._trace(vertex)
        return self._link[vertex]

    def _trace(self, vertex: int) -> tuple[list[int], bool]:
        """Compute the result of `_ordered`."""
        joined: dict[int, list[int]] = {}
        faces = self._faces[self._faces_at(vertex)]
        for face in faces.tolist():
            a, b = (v for v in face if v != vertex)
            joined.setdefault(a, []).append(b)
            joined.setdefault(b, []).append(a)
        ends = [v for v, others in joined.items() if len(others) == 1]
        ring = ends[:1] or [next(iter(joined))]
        while onward := [v for v in joined[ring[-1]] if v not in (*ring[-2:-1], ring[0])]:
            ring.append(onward[0])
        return ring, not ends
