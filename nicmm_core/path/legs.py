"""The legs of the initial path, found one after another without crossings.

Disjoint arcs never separate a connected surface without boundary. So on such a surface the legs can
be found in any sequence, each going around the legs found before it. A leg between two boundary
points does separate the surface. Such legs are found last, and each is kept only if all remaining
legs are still possible.
"""

from __future__ import annotations

from collections import Counter
from itertools import chain, pairwise

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
    split : SplitMesh
    waypoints : list of int
    count : int
        Number of legs.
    """

    def __init__(
        self, split: SplitMesh, search: LegSearch, waypoints: list[int], closed: bool
    ) -> None:
        self.split = split
        self.waypoints = waypoints
        self.count = len(waypoints) - (not closed)
        self._search = search
        self._on_boundary = {v for v in waypoints if split.is_on_boundary(v)}
        self._paths: dict[int, list[int]] = {}
        self._lengths: dict[int, float] = {}
        self._splits_before = split.n_vertices

    @property
    def length(self) -> float:
        """Total length of the legs found so far, weighted by φ_fea."""
        return sum(self._lengths.values())

    @property
    def vertices(self) -> list[int]:
        """Vertices of the whole path; the first vertex of a closed path is not repeated."""
        path = [vertex for leg in range(self.count) for vertex in self._paths[leg][:-1]]
        closed = self.count == len(self.waypoints)
        return path if closed else [*path, self.waypoints[-1]]

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
        lengths = np.array([self._lengths.get(leg, np.inf) for leg in range(self.count)])
        for leg in range(self.count):
            start, end = map(self.split.position, self._ends(leg))
            if lengths[leg] > ratio * np.linalg.norm(end - start):
                lengths[leg] = self._shortest(leg, BlockedElements()).length
        return lengths

    def find_all(self, sequence: IntArray, most_length: float) -> bool:
        """Find every leg, unless the path gets too long.

        Parameters
        ----------
        sequence : (count,) int array
            Sequence in which legs are found. Legs found earlier are more direct.
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
        safe, separating = self._by_separation(sequence.tolist())
        while safe or separating:
            if safe:
                self._find(safe.pop(0))
            else:
                separating.remove(self._find_one_of(separating))
            if self.length > most_length:
                return False
        return True

    def _ends(self, leg: int) -> tuple[int, int]:
        """The first and last vertex of a leg."""
        return self.waypoints[leg], self.waypoints[(leg + 1) % len(self.waypoints)]

    def _by_separation(self, sequence: list[int]) -> tuple[list[int], list[int]]:
        """Legs that join different groups of waypoints, and legs that close a cycle.

        All waypoints on boundaries are one group. Without such waypoints, only the last leg of a
        closed path closes a cycle.
        """
        group = {vertex: -1 if vertex in self._on_boundary else vertex for vertex in self.waypoints}
        safe: list[int] = []
        separating: list[int] = []
        for leg in sequence:
            first, second = (group[vertex] for vertex in self._ends(leg))
            (separating if first == second else safe).append(leg)
            group = {v: first if own == second else own for v, own in group.items()}
        return safe, separating

    def _find_one_of(self, separating: list[int]) -> int:
        """Find the first leg after which all remaining legs are possible; return its index."""
        for leg in separating:
            self._find(leg)
            others = [other for other in separating if other != leg]
            for other in others:
                self._open_corners(other)
            if not others or self._search.are_joinable(
                [self._ends(other) for other in others], self._blocked()
            ):
                return leg
            # The leg is discarded, but its splits of the mesh remain.
            del self._paths[leg], self._lengths[leg]
        raise CrossingError(separating[0])

    def _find(self, leg: int) -> None:
        """Find a leg around the legs found so far, split the mesh along it and record it."""
        found = self._shortest(leg, self._blocked(*self._ends(leg)))
        self._paths[leg] = split_along(self.split, found.nodes)
        self._lengths[leg] = found.length
        if self.split.n_vertices - self._splits_before > MOST_PATH_SPLITS:
            raise UnreachableError(
                "control_points: in this order the curve winds around itself too often (its path "
                f"needs more than {MOST_PATH_SPLITS} virtual splits)"
            )

    def _shortest(self, leg: int, blocked: BlockedElements) -> Leg:
        """The shortest path for a leg; raises CrossingError without one."""
        self._open_corners(leg)
        found = self._search.shortest(*self._ends(leg), blocked)
        if found is None:
            raise CrossingError(leg)
        return found

    def _blocked(self, *free: int) -> BlockedElements:
        """All legs found so far, and all waypoints except the free ones."""
        paths = self._paths.values()
        legs_at = Counter(chain.from_iterable(map(self._ends, self._paths)))
        return BlockedElements(
            vertices={*self.waypoints, *chain.from_iterable(paths)}.difference(free),
            edges={edge for path in paths for edge in pairwise(path)},
            ends={vertex for vertex, count in legs_at.items() if count == 1},
        )

    def _open_corners(self, leg: int) -> None:
        """Split faces in which a leg could not start or end at a waypoint on the boundary.

        These are the faces whose two edges at the waypoint belong to the boundary or to legs.
        """
        paths = self._paths.values()
        of_legs = {frozenset(edge) for path in paths for edge in (path[:2], path[-2:])}
        for vertex in filter(self._on_boundary.__contains__, self._ends(leg)):
            for face in sorted(self.split.faces_around(vertex)):
                sides = [{vertex, other} for other in self.split.corners(face) if other != vertex]
                if all(
                    side in of_legs or len(self.split.faces_at_edge(*side)) == 1 for side in sides
                ):
                    self.split.split_face(face)


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
    for start, end in pairwise(path):
        if not split.join(start, end):
            raise UnreachableError(
                "control_points: the paths between the control points come too close to each other "
                "for this mesh; use a finer mesh or fewer points"
            )
    return path
