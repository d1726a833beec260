"""Searches for the course of a curve: candidates from the hop graph, relaxed and compared.

Courses are compared by the energy that relaxation minimises, but with one length scale for all of
them, the length of the shortest course (`elastic_energy.comparable_energies`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import nicmm_kernels
import numpy as np

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.surface_points import SurfacePoints, joined
from ..maps.guidance import length_factor
from ..progress import checkpoint, subrange
from ..relaxation.batch_relaxation import BatchConfig, curves_of, relax_batch
from ..relaxation.curve_nodes import CurveSurface, Nodes, nodes_at
from ..relaxation.elastic_energy import comparable_energies
from ..relaxation.even_nodes import resampled
from .comparison import PARTS_APART, SAME_COURSE
from .course_candidates import candidates
from .hop_graph import HopGraph, with_control_points
from .leg_orders import legs_of_order
from .recombination import recombined
from .uncrossing import remove_crossings

TENSIONS = (2.0, 1.0)
"""τ of the graph relative to (2π / L)², where L is the length of the shortest path.

Searches with different seeds take them in turn, since a low tension finds long courses that bend
little. The first one is greater than 1 because hops overestimate bending: they turn only at cells.
"""


@dataclass(frozen=True)
class SearchSize:
    """Numbers of courses of a search.

    Attributes
    ----------
    candidates : tuple of int
        Candidates by the rank of their order of the control points.
    recombined : int
        Courses combined from the legs of relaxed candidates.
    finalists : int
        The best of all, which are relaxed with twice as many nodes, unless they have had enough
        doublings.
    apart : float
        Distance, in bounding-box diagonals, up to which two of them count as the same.
    """

    candidates: tuple[int, ...]
    recombined: int
    finalists: int
    apart: float


WHOLE = SearchSize((20, 16, 16, 16, 16, 16), 16, 10, SAME_COURSE)
"""Size of a search for a whole curve."""

PART = SearchSize((16,), 6, 4, PARTS_APART)
"""Size of a search for a part of a curve, which has few legs in a given order."""

LENGTH_NOISE = 0.4
"""Standard deviation of the logarithms of the random factors of lengths."""

WAVES = 3
"""Number of random waves around each point."""

WAVELENGTHS = (0.3, 1.5)
"""Least and greatest wavelength of a random wave, relative to the spacing of the cells.

Short waves are almost independent at neighbouring cells, which gives the most different courses.
"""

MOST_LEGS = 60
"""Number of legs above which no courses are searched for; hardly any combination is simple then."""

UNDER_RESOLVED = 1.5
"""Growth of the elastic energy when nodes are doubled from which a course is under-resolved.

Straight lines between nodes that are far apart pass through thin limbs, so courses around limbs
seem to bend less than they do.
"""

MOST_DOUBLINGS = 2
"""Number of times that the nodes of courses are doubled at most."""

KEPT_WHEN_DOUBLED, FEWEST_DOUBLED = 0.45, 12
"""Share of the courses that are kept when nodes are doubled, the best ones by their energies with
twice as many nodes; and the number that is kept anyway."""

OF_CANDIDATES = (BatchConfig(iterations=8),)
OF_DOUBLED = (BatchConfig(iterations=6),)
OF_RECOMBINED = (BatchConfig(iterations=8),)
OF_FINALISTS = (BatchConfig(iterations=6), BatchConfig(iterations=8))
"""Passes of the joint relaxation of all candidates, of candidates with twice as many nodes, of
recombined courses, and of the finalists.

Before each pass but the first, nodes are placed evenly along the traces. While nodes move, only
their distances count, which are too short around the edges of thin parts."""


def find_courses(
    graph: HopGraph,
    surface: CurveSurface,
    points: SurfacePoints,
    along: FloatArray,
    fixed: BoolArray,
    corners: BoolArray,
    closed: bool,
    smoothness: float,
    any_order: bool,
    seed: int = 0,
    search_size: SearchSize = WHOLE,
) -> Iterator[tuple[Nodes, IntArray, bool]]:
    """Yield relaxed courses through points, by ascending energy, simple ones first.

    Courses that cross themselves follow, since small loops can be removed on the original mesh.

    Each course is given by its nodes and, for every node, the index of its control point, or -1 if
    it has none. It is yielded twice, the second time with twice as many nodes and True.

    Parameters
    ----------
    graph : HopGraph
        Hop graph of the surface without maps.
    surface : CurveSurface
        Surface with the maps of the request.
    points : SurfacePoints
        Control points and via points, k in total, in the order visited.
    along : (k, V + k) float array
        Distances along edges from these points to the V vertices and to the points themselves.
    fixed : (k,) bool array
        Which points are control points. Courses pass via points only until they are relaxed.
    corners : (k,) bool array
        Control points at which courses may turn freely.
    closed : bool
    smoothness : float
        Divisor of the tension.
    any_order : bool
        Whether a course may visit the control points in another order, to avoid crossing itself or
        because it is cheaper.
    seed : int
        Seed of random factors of the lengths in the graph, which give other courses; 0 for no
        factors.
    search_size : SearchSize
    """
    legs = legs_of_order(np.arange(len(points)), closed)
    if len(legs) > MOST_LEGS:
        return
    size = len(surface.mesh.vertices)
    factor = None if surface.feature_map is None else length_factor(surface.feature_map)
    if seed:
        waves = random_waves(along[:, :size], graph.spacing, seed)
        factor = np.exp(LENGTH_NOISE * waves) * (1.0 if factor is None else factor)
    tension = TENSIONS[seed % len(TENSIONS)] * 4.0 * np.pi**2 / smoothness
    length = float(along[:, size:][legs[:, 0], legs[:, 1]].sum())
    courses = with_control_points(
        graph, points, corners, length, factor, tension, surface.normal_bending
    )
    checkpoint()
    found = candidates(courses, surface, closed, smoothness, any_order, search_size.candidates)
    if found is None:
        return
    nodes, point = found
    # Indices of control points do not count via points.
    number = np.append(np.where(fixed, np.cumsum(fixed) - 1, -1), -1)
    corners = corners[fixed]
    nodes = _with_corners(nodes, number[point], corners)
    nodes, visit, _ = remove_crossings(surface, nodes, number[point], any_order)
    with subrange(0.4, 0.6):
        nodes, visit = _relaxed(surface, nodes, visit, smoothness, OF_CANDIDATES)
        nodes, visit, doublings = _resolved(
            surface, nodes, visit, smoothness, search_size.finalists
        )
    nodes, visit, simple = _with_recombined(
        surface, nodes, visit, corners, smoothness, any_order, search_size.recombined
    )
    apart = search_size.apart * surface.mesh.diagonal
    best = np.concatenate(_best(surface, nodes, simple, smoothness, apart))[: search_size.finalists]
    nodes, visit = _selected(nodes, visit, best)
    nodes, visit = _resampled(surface, nodes, visit, 2 if doublings < MOST_DOUBLINGS else 1)
    with subrange(0.7, 1.0):
        nodes, visit = _relaxed(surface, nodes, visit, smoothness, OF_FINALISTS)
    nodes, visit, simple = remove_crossings(surface, nodes, visit, any_order)
    for one in np.concatenate(_best(surface, nodes, simple, smoothness, apart)).tolist():
        own, visited = _selected(nodes, visit, np.array([one]))
        yield own, visited, False
        yield *_resampled(surface, own, visited, 2), True


def _with_recombined(
    surface: CurveSurface,
    nodes: Nodes,
    visit: IntArray,
    corners: BoolArray,
    smoothness: float,
    any_order: bool,
    most: int,
) -> tuple[Nodes, IntArray, BoolArray]:
    """Courses without crossings, and new ones of their legs.

    Also the control point at each node, and which courses are simple.
    """
    nodes, visit, simple = remove_crossings(surface, nodes, visit, any_order)
    combined = recombined(surface, nodes, visit, simple, smoothness, most)
    if combined is None:
        return nodes, visit, simple
    new, new_visit = combined
    new = _with_corners(new, new_visit, corners)
    new, new_visit, _ = remove_crossings(surface, new, new_visit, any_order)
    with subrange(0.6, 0.7):
        new, new_visit = _relaxed(surface, new, new_visit, smoothness, OF_RECOMBINED)
    new, new_visit, new_simple = remove_crossings(surface, new, new_visit, any_order)
    places = joined([nodes.places, new.places])
    nodes = nodes_at(surface, places, nodes.closed, nodes.curves + new.curves)
    visit, simple = np.append(visit, new_visit), np.append(simple, new_simple)
    return _with_corners(nodes, visit, corners), visit, simple


def _with_corners(nodes: Nodes, visit: IntArray, corners: BoolArray) -> Nodes:
    """The same courses, which may turn freely at some of the control points."""
    return replace(nodes, corners=(visit >= 0) & corners[visit]) if corners.any() else nodes


def random_waves(distances: FloatArray, spacing: float, seed: int) -> FloatArray:
    """Random waves around the points of a curve, with a standard deviation of about 1.

    They are functions of the distances to the points, so they depend on nothing but the surface and
    the points, and have the symmetries of both.

    Parameters
    ----------
    distances : (k, V) float array
        Distances from k points to the vertices.
    spacing : float
        Distance between neighbouring cells of the hop graph.
    seed : int

    Returns
    -------
    (V,) float array
    """
    generator = np.random.default_rng(seed)
    wavelengths = spacing * generator.uniform(*WAVELENGTHS, WAVES)
    phases = generator.uniform(0.0, 2.0 * np.pi, WAVES)
    angles = 2.0 * np.pi * distances / wavelengths[:, None, None] + phases[:, None, None]
    waves: FloatArray = np.cos(angles).sum(axis=(0, 1))
    return np.sqrt(2.0 / (WAVES * len(distances))) * waves


def _relaxed(
    surface: CurveSurface,
    nodes: Nodes,
    visit: IntArray,
    smoothness: float,
    passes: tuple[BatchConfig, ...],
) -> tuple[Nodes, IntArray]:
    """The curves relaxed in one or more passes, and the control point at each node."""
    for number, config in enumerate(passes):
        if number:
            nodes, visit = _resampled(surface, nodes, visit, 1)
        with subrange(number / len(passes), (number + 1) / len(passes)):
            nodes = relax_batch(surface, nodes, visit >= 0, smoothness, config)
    return nodes, visit


def _resolved(
    surface: CurveSurface, nodes: Nodes, visit: IntArray, smoothness: float, n_best: int
) -> tuple[Nodes, IntArray, int]:
    """Relaxed courses with as many nodes as their energies need, and how often these were doubled.

    The median over the `n_best` best courses decides whether nodes are doubled. Then the worst
    courses are left out.
    """
    unpainted = replace(surface, feature_map=None)  # with lanes, energies may be negative
    for doublings in range(MOST_DOUBLINGS):
        doubled, visit_doubled = _resampled(surface, nodes, visit, 2)
        best = np.argsort(_energies(surface, nodes, smoothness), kind="stable")[:n_best]
        before, after = (_energies(unpainted, each, smoothness) for each in (nodes, doubled))
        growth = after[best] / np.maximum(before[best], tolerances.TINY)
        if np.median(growth) < UNDER_RESOLVED:
            return nodes, visit, doublings
        most = max(FEWEST_DOUBLED, int(KEPT_WHEN_DOUBLED * nodes.curves))
        ascending = np.argsort(_energies(surface, doubled, smoothness), kind="stable")
        kept = np.sort(ascending[:most])
        doubled, visit_doubled = _selected(doubled, visit_doubled, kept)
        nodes, visit = _relaxed(surface, doubled, visit_doubled, smoothness, OF_DOUBLED)
    return nodes, visit, MOST_DOUBLINGS


def _resampled(
    surface: CurveSurface, nodes: Nodes, visit: IntArray, times: int
) -> tuple[Nodes, IntArray]:
    """The curves with `times` as many nodes, and the control point at each node."""
    found, former = resampled(surface, nodes, visit >= 0, times)
    return found, np.where(former < 0, -1, visit[former])


def _selected(nodes: Nodes, visit: IntArray, which: IntArray) -> tuple[Nodes, IntArray]:
    """Some of the curves, by their indices, and the control point at each node."""
    return curves_of(nodes, which), nodes.by_curve(visit)[which].ravel()


def _energies(surface: CurveSurface, nodes: Nodes, smoothness: float) -> FloatArray:
    """E of each course, (c,), with the length of the shortest course as the length scale."""
    shortest = float(nodes.by_curve(nodes.step_lengths).sum(axis=1).min())
    return comparable_energies(surface, nodes, smoothness, shortest)


def _best(
    surface: CurveSurface, nodes: Nodes, simple: BoolArray, smoothness: float, apart: float
) -> tuple[IntArray, IntArray]:
    """Distinct courses by ascending energy: the simple ones, and those that cross themselves.

    On a thin part, a course that crosses itself may run beside a simple one.
    """
    energy = _energies(surface, nodes, smoothness)
    positions = np.ascontiguousarray(nodes.positions).reshape(nodes.curves, -1, 3)

    def distinct(courses: IntArray) -> IntArray:
        by_energy = courses[np.argsort(energy[courses], kind="stable")]
        chosen = nicmm_kernels.distinct_curves(
            positions[by_energy], np.arange(len(by_energy)), apart, checkpoint
        )
        found: IntArray = by_energy[chosen]
        return found

    return distinct(np.flatnonzero(simple)), distinct(np.flatnonzero(~simple))
