"""A simple path through points in a given order: the shortest of several attempts.

Every leg has to go around the legs found before it, so the sequence in which legs are found
determines how often the path winds around itself. With many points in an order that jumps back and
forth, the length varies by a large factor, and no rule finds the best sequence.
"""

from __future__ import annotations

import numpy as np

from ..errors import UnreachableError
from ..geometry.array_types import FloatArray, IntArray
from ..geometry.mesh import Mesh
from ..geometry.surface_points import SurfacePoints
from .leg_search import LegSearch
from .legs import CrossingError, Legs
from .virtual_splits import SplitMesh

STRAND_CLEARANCE = 0.1
"""Distance within which a leg avoids earlier legs, in square roots of the component's area."""

FULL_CLEARANCE_POINTS = 25
"""Number of points above which `STRAND_CLEARANCE` is reduced, with the spacing of the points."""

ACCEPTABLE_LENGTH_RATIO = 1.3
"""Length of a path, relative to the sum of its legs found alone, above which attempts go on."""

MOST_TRIES = 6
"""Maximum number of attempts to find a shorter path."""

MOST_TRIES_WHILE_CROSSING = 14
"""Maximum number of attempts as long as no path has been found because legs would cross."""

MOST_SPLITS_TO_TRY = 40_000
"""Total number of virtual splits, over all attempts, above which no further attempt is made."""

SHUFFLE, SHUFFLE_WHILE_CROSSING = 0.35, 1.0
"""Standard deviations of the random change of the legs' log lengths, which reorders the legs.

The second one is used as long as no path has been found because legs would cross.
"""


def find_path(mesh: Mesh, points: SurfacePoints, phi_fea: FloatArray | None, closed: bool) -> Legs:
    """Find a simple path through points in their order, with virtual splits of the mesh.

    The first attempt finds the legs in the order of the points. If it fails, or if the path is much
    longer than the sum of its legs found alone, the second attempt finds short legs first, and
    further attempts vary this sequence at random.

    Parameters
    ----------
    mesh : Mesh
    points : SurfacePoints
        Distinct points on one component.
    phi_fea : (V,) float array or None
        φ_fea at the input vertices, which weights lengths (`guidance.length_factor`).
    closed : bool
        Whether the path returns from the last point to the first.

    Returns
    -------
    Legs
        The legs of the shortest path found.

    Raises
    ------
    CrossingError
        If every attempt has a leg that would cross other legs.
    UnreachableError
        If no attempt succeeds, and one of them fails because the path winds around itself too often
        or its strands are too close for this mesh.
    """
    component = mesh.face_component == mesh.face_component[points.faces[0]]
    clearance = STRAND_CLEARANCE * float(np.sqrt(mesh.face_areas[component].sum()))
    clearance *= min(1.0, (FULL_CLEARANCE_POINTS / len(points)) ** 0.5)
    generator = np.random.default_rng(0)
    best: Legs | None = None
    failure: UnreachableError | None = None
    sequence, splits = np.arange(len(points) - (not closed)), 0
    for attempt in range(MOST_TRIES_WHILE_CROSSING):
        split = SplitMesh(mesh)
        waypoints = split.insert_points(points)
        separate(split, waypoints)
        search = LegSearch(mesh, split, component, phi_fea, clearance)
        legs = Legs(split, search, waypoints.tolist(), closed)
        try:
            if legs.find_all(sequence, np.inf if best is None else best.length):
                best = legs
        except UnreachableError as error:
            # Too many windings are reported rather than a crossing: they show that a path exists,
            # whereas after a crossing perhaps none does.
            if failure is None or not isinstance(error, CrossingError):
                failure = error
        if attempt == 0:
            lengths_alone = legs.lengths_alone(ACCEPTABLE_LENGTH_RATIO)
        if best is not None and best.length <= ACCEPTABLE_LENGTH_RATIO * lengths_alone.sum():
            break
        crossing = best is None and isinstance(failure, CrossingError)
        splits += split.n_vertices - len(mesh.vertices)
        if splits > MOST_SPLITS_TO_TRY or (attempt + 1 >= MOST_TRIES and not crossing):
            break
        scale = SHUFFLE_WHILE_CROSSING if crossing else SHUFFLE
        shuffle = generator.normal(scale=scale, size=legs.count) if attempt > 0 else 0.0
        sequence = np.argsort(lengths_alone * np.exp(shuffle), kind="stable")
    if best is not None:
        return best
    assert failure is not None
    raise failure


def separate(split: SplitMesh, waypoints: IntArray) -> None:
    """Split every edge between two waypoints, so that no two waypoints are neighbours."""
    wanted = set(waypoints.tolist())
    for waypoint in sorted(wanted):
        for other in sorted(wanted & split.neighbours(waypoint)):
            split.split_edge(waypoint, other)
