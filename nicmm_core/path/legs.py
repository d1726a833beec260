"""The legs of the initial path, found one after another without crossings.

Disjoint arcs never separate a connected surface without boundary. So on such a surface the legs can
be found in any sequence, each going around the legs found before it. A leg between two boundary
points does separate the surface. Such legs are found last, and each is kept only if all remaining
legs are still possible.
"""

from __future__ import annotations

import numpy as np

from ..errors import UnreachableError
from ..geometry.array_types import FloatArray, IntArray
from .leg_graph import Node
from .leg_search import BlockedElements, Leg, LegSearch
from .virtual_splits import SplitMesh

MOST_PATH_SPLITS = 12_000
"""Maximum number of virtual splits for a path; each winding needs more than the previous one."""


class CrossingError(UnreachableError):
    """A leg cannot be found without crossing other legs.

    Attributes
    ----------
    leg : int
        Index of the leg, which is also the index of its first waypoint.
    """

    def __init__(self, leg: int) -> None:
        super().__init__(f"control_points: leg {leg} of the path would cross other legs")
        self.leg = leg


class Legs:
    """The legs found so far of a path through waypoints.

    Parameters
    ----------
    split : SplitMesh
        Mesh to split; it is modified so that the legs run along its edges.
    search : LegSearch
        Search for legs on the same mesh.
    waypoints : list of int
        Vertices in the order of the path, no two of them neighbours.
    closed : bool
        Whether the path returns from the last waypoint to the first.

    Attributes
    ----------
    count : int
        Number of legs.
    """

    def __init__(
        self, split: SplitMesh, search: LegSearch, waypoints: list[int], closed: bool
    ) -> None:
        self._split = split
        self._search = search
        self._waypoints = waypoints
        self.count = len(waypoints) - (not closed)
        self._paths: dict[int, list[int]] = {}
        self._length: dict[int, float] = {}
        self._splits_before = split.n_vertices

    def ends(self, leg: int) -> tuple[int, int]:
        """The first and last vertex of a leg."""
        return self._waypoints[leg], self._waypoints[(leg + 1) % len(self._waypoints)]

    @property
    def length(self) -> float:
        """Total length of the legs found so far, weighted by φ_fea."""
        return sum(self._length.values())

    @property
    def vertices(self) -> list[int]:
        """Vertices of the whole path; the first vertex of a closed path is not repeated."""
        path = [vertex for leg in range(self.count) for vertex in self._paths[leg][:-1]]
        closed = self.count == len(self._waypoints)
        return path if closed else [*path, self._waypoints[-1]]

    def lengths_alone(self, ratio: float) -> FloatArray:
        """Length of each leg if no other leg had to be avoided, shape (count,).

        Parameters
        ----------
        ratio : float
            Length of a found leg, relative to the straight-line distance between its ends, up to
            which the found length itself is taken. Longer legs are searched for again, alone.

        Raises
        ------
        CrossingError
            If a leg does not exist even without the other legs.
        """
        nothing = np.zeros(0, dtype=np.int64)
        free = BlockedElements(nothing, np.zeros((0, 2), dtype=np.int64), nothing)
        lengths = np.zeros(self.count)
        for leg in range(self.count):
            start, end = (self._split.position(vertex) for vertex in self.ends(leg))
            lengths[leg] = self._length.get(leg, np.inf)
            if lengths[leg] > ratio * np.linalg.norm(end - start):
                self._open_corners(leg)
                alone = self._search.shortest(*self.ends(leg), free)
                if alone is None:
                    raise CrossingError(leg)
                lengths[leg] = alone.length
        return lengths

    def find_all(self, sequence: IntArray | None = None, most_length: float = np.inf) -> bool:
        """Find every leg, unless the path gets too long.

        Parameters
        ----------
        sequence : (count,) int array, optional
            Sequence in which legs are found, by default that of the path. Legs found earlier are
            more direct.
        most_length : float
            Length of the path, weighted by φ_fea, above which the search stops.

        Returns
        -------
        bool
            Whether all legs have been found within the length limit.

        Raises
        ------
        CrossingError
            If a leg would cross other legs.
        UnreachableError
            If the path has too many windings, or its strands are too close for this mesh.
        """
        legs = list(range(self.count)) if sequence is None else sequence.tolist()
        safe, separating = self._by_separation(legs)
        for leg in safe:
            found = self._find(leg)
            if found is None:
                raise CrossingError(leg)
            self._record(leg, found)
            if self.length > most_length:
                return False
        while separating:
            leg = self._find_one_of(separating)
            separating.remove(leg)
            if self.length > most_length:
                return False
        return True

    def _find_one_of(self, separating: list[int]) -> int:
        """Find the first leg after which all remaining legs are possible; return its index."""
        for leg in separating:
            found = self._find(leg)
            if found is None:
                raise CrossingError(leg)
            self._record(leg, found)
            if self._all_possible([other for other in separating if other != leg]):
                return leg
            # The leg is discarded, but its splits of the mesh remain.
            del self._paths[leg], self._length[leg]
        raise CrossingError(separating[0])

    def _by_separation(self, sequence: list[int]) -> tuple[list[int], list[int]]:
        """Legs that join different groups of waypoints, and legs that close a cycle.

        All waypoints on boundaries are one group. Without such waypoints, only the last leg of a
        closed path closes a cycle.
        """
        on_rim = {vertex for vertex in self._waypoints if self._is_on_rim(vertex)}
        group = {vertex: -1 if vertex in on_rim else vertex for vertex in self._waypoints}
        safe: list[int] = []
        separating: list[int] = []
        for leg in sequence:
            first, second = (group[vertex] for vertex in self.ends(leg))
            (separating if first == second else safe).append(leg)
            group = {v: first if own == second else own for v, own in group.items()}
        return safe, separating

    def _find(self, leg: int) -> Leg | None:
        """The shortest path for a leg around the legs found so far; None if it does not exist."""
        self._open_corners(leg)
        return self._search.shortest(*self.ends(leg), self._blocked(*self.ends(leg)))

    def _record(self, leg: int, found: Leg) -> None:
        """Split the mesh along a leg and record it."""
        self._paths[leg] = split_along(self._split, found.nodes)
        self._length[leg] = found.length
        if self._split.n_vertices - self._splits_before > MOST_PATH_SPLITS:
            raise UnreachableError(
                "control_points: in this order the curve winds around itself too often (its path "
                f"needs more than {MOST_PATH_SPLITS} virtual splits)"
            )

    def _all_possible(self, legs: list[int]) -> bool:
        """Whether each of the legs given, taken alone, can still be found."""
        if not legs:
            return True
        for leg in legs:
            self._open_corners(leg)
        return self._search.are_joinable([self.ends(leg) for leg in legs], self._blocked())

    def _blocked(self, *free: int) -> BlockedElements:
        """All legs found so far, and all waypoints except the free ones."""
        paths = [np.array(path, dtype=np.int64) for path in self._paths.values()]
        edges = [np.stack([path[:-1], path[1:]], axis=1) for path in paths]
        nothing = np.zeros((0, 2), dtype=np.int64)
        vertices = np.concatenate([*paths, np.array(self._waypoints, dtype=np.int64)])
        return BlockedElements(
            vertices=np.setdiff1d(vertices, free),
            edges=np.concatenate([*edges, nothing]),
            ends=self._open_ends(),
        )

    def _open_ends(self) -> IntArray:
        """Waypoints at which exactly one of the legs found so far ends."""
        reached = [vertex for leg in self._paths for vertex in self.ends(leg)]
        vertices, count = np.unique(np.array(reached, dtype=np.int64), return_counts=True)
        return vertices[count == 1]

    def _is_on_rim(self, vertex: int) -> bool:
        """Whether a vertex belongs to an edge with only one face."""
        return any(
            len(self._split.faces_around(vertex) & self._split.faces_around(other)) == 1
            for other in self._split.neighbours(vertex)
        )

    def _open_corners(self, leg: int) -> None:
        """Split faces in which a leg could not start or end at a waypoint on the boundary.

        These are the faces whose two edges at the waypoint belong to the boundary or to legs.
        """
        for vertex in filter(self._is_on_rim, self.ends(leg)):
            around = self._split.faces_around(vertex)
            closed = {
                other for path in self._paths.values() for other in _path_neighbours(path, vertex)
            }
            for face in sorted(around):
                others = [corner for corner in self._split.corners(face) if corner != vertex]
                if all(
                    other in closed or len(around & self._split.faces_around(other)) == 1
                    for other in others
                ):
                    self._split.split_face(face)


def split_along(split: SplitMesh, nodes: list[Node]) -> list[int]:
    """Split the edges whose midpoints a path uses, and return the path as vertices.

    Where a path passes all three edges of a face, an edge created by one split may cross a later
    step of the path. That edge is flipped.

    Raises
    ------
    UnreachableError
        If two consecutive vertices of the path cannot be joined by an edge.
    """
    path = [node if isinstance(node, int) else split.split_edge(*node) for node in nodes]
    for start, end in zip(path[:-1], path[1:], strict=True):
        if not split.join(start, end):
            raise UnreachableError(
                "control_points: the paths between the control points come too close to each other "
                "for this mesh; use a finer mesh or fewer points"
            )
    return path


def _path_neighbours(path: list[int], vertex: int) -> list[int]:
    """Neighbours of a vertex on a path if the vertex is an end of the path, otherwise empty."""
    return [path[1]] * (path[0] == vertex) + [path[-2]] * (path[-1] == vertex)
