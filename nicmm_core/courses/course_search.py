"""Searches for the course of a curve: candidates from the hop graph, relaxed and compared.

A search with another seed finds other courses. The legs of the best courses of all searches for a
curve can be combined at the end.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.surface_points import SurfacePoints
from ..maps.guidance import length_factor
from ..progress import checkpoint, subrange
from ..relaxation.batch_relaxation import BatchConfig
from ..relaxation.curve_nodes import CurveSurface, Nodes
from .comparison import PARTS_APART, SAME_COURSE
from .course_candidates import candidates
from .course_set import (
    CourseSet,
    distinct_courses,
    energies_of_courses,
    relaxed,
    together,
    uncrossed,
    with_corners,
    with_nodes,
)
from .hop_graph import HopGraph, with_control_points
from .leg_orders import legs_of_order
from .recombination import recombined

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
    candidates : int
        Candidates from the hop graph.
    orders : int
        Greatest number of orders of the control points of an open curve among which candidates are
        divided.
    recombined : int
        Courses combined from the legs of relaxed candidates.
    finalists : int
        The best of all, which are relaxed with twice as many nodes, unless they have had enough
        doublings.
    apart : float
        Distance, in bounding-box diagonals, up to which two of them count as the same.
    """

    candidates: int
    orders: int
    recombined: int
    finalists: int
    apart: float


WHOLE = SearchSize(64, 6, 16, 10, SAME_COURSE)
"""Size of a search for a whole curve."""

PART = SearchSize(16, 1, 6, 4, PARTS_APART)
"""Size of a search for a part of a curve, which has few legs in a given order."""

COMBINED = SearchSize(0, 1, 32, 10, PARTS_APART)
"""Size of a search without candidates of its own, which combines the courses of earlier ones."""

COMBINED_OF_A_SEARCH = 20
"""Greatest number of courses of each search that are combined with those of other searches."""


@dataclass(frozen=True)
class Search:
    """One of the searches for a curve.

    Attributes
    ----------
    size : SearchSize
    seed : int
        Seed of random factors of the lengths in the hop graph, which give other courses; 0 for no
        factors. Searches with different seeds also have different numbers of cells.
    earlier : list of CourseSet, optional
        The best courses of earlier searches for the same curve. This search appends its own.
    """

    size: SearchSize = WHOLE
    seed: int = 0
    earlier: list[CourseSet] | None = None


FIRST = Search()
"""The first search for a whole curve."""


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
recombined courses, and of the finalists."""


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
    search: Search = FIRST,
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
        Whether a course may visit the control points in another order, to avoid crossing itself or,
        if it is open, because it is cheaper.
    search : Search
    """
    legs = legs_of_order(np.arange(len(points)), closed)
    if len(legs) > MOST_LEGS:
        return
    size = len(surface.mesh.vertices)
    factor = None if surface.feature_map is None else length_factor(surface.feature_map)
    if search.seed:
        waves = random_waves(along[:, :size], graph.spacing, search.seed)
        factor = np.exp(LENGTH_NOISE * waves) * (1.0 if factor is None else factor)
    tension = TENSIONS[search.seed % len(TENSIONS)] * 4.0 * np.pi**2 / smoothness
    length = float(along[:, size:][legs[:, 0], legs[:, 1]].sum())
    in_graph = with_control_points(
        graph, points, corners, length, factor, tension, surface.normal_bending
    )
    checkpoint()
    found = candidates(
        in_graph, surface, closed, smoothness, any_order, search.size.candidates, search.size.orders
    )
    if found is None:
        return
    nodes, point = found
    # Indices of control points do not count via points.
    number = np.append(np.where(fixed, np.cumsum(fixed) - 1, -1), -1)
    corners = corners[fixed]
    visit = number[point]
    nodes = with_corners(nodes, visit, corners)
    courses = CourseSet(nodes, visit, np.zeros(nodes.curves, dtype=bool))
    courses = uncrossed(surface, courses, any_order)
    with subrange(0.4, 0.6):
        courses = relaxed(surface, courses, smoothness, OF_CANDIDATES)
        courses = _resolved(surface, courses, smoothness, search.size.finalists)
    courses = uncrossed(surface, courses, any_order)
    combined = _combined(surface, courses, corners, smoothness, any_order, search.size.recombined)
    if combined is not None:
        courses = together(surface, [courses, combined], corners)
    best = courses.only(distinct_courses(surface, courses, smoothness, search.size.apart))
    if search.earlier is not None:
        search.earlier.append(best.only(np.arange(len(best.simple))[:COMBINED_OF_A_SEARCH]))
    yield from _finalists(surface, best, smoothness, any_order, search.size)


def combine_courses(
    earlier: list[CourseSet],
    surface: CurveSurface,
    corners: BoolArray,
    smoothness: float,
    any_order: bool,
) -> Iterator[tuple[Nodes, IntArray, bool]]:
    """Yield courses made of the legs of courses of earlier searches, as `find_courses` does.

    Parameters
    ----------
    earlier : list of CourseSet
        At least one set.
    surface : CurveSurface
        Surface with the maps of the request.
    corners : (k,) bool array
        Control points at which courses may turn freely.
    smoothness : float
    any_order : bool
    """
    courses = together(surface, earlier, corners)
    most = COMBINED.recombined
    combined = _combined(surface, courses, corners, smoothness, any_order, most)
    if combined is not None:
        best = combined.only(distinct_courses(surface, combined, smoothness, COMBINED.apart))
        yield from _finalists(surface, best, smoothness, any_order, COMBINED)


def _combined(
    surface: CurveSurface,
    courses: CourseSet,
    corners: BoolArray,
    smoothness: float,
    any_order: bool,
    most: int,
) -> CourseSet | None:
    """Relaxed new courses of the legs of given ones; None if all combinations are known."""
    found = recombined(surface, courses.nodes, courses.visit, courses.simple, smoothness, most)
    if found is None:
        return None
    nodes, visit = found
    nodes = with_corners(nodes, visit, corners)
    new = CourseSet(nodes, visit, np.zeros(nodes.curves, dtype=bool), courses.doublings)
    new = uncrossed(surface, new, any_order)
    with subrange(0.6, 0.7):
        new = relaxed(surface, new, smoothness, OF_RECOMBINED)
    return uncrossed(surface, new, any_order)


def _finalists(
    surface: CurveSurface,
    courses: CourseSet,
    smoothness: float,
    any_order: bool,
    size: SearchSize,
) -> Iterator[tuple[Nodes, IntArray, bool]]:
    """Relax the first of some courses, the best ones, further and yield them (`find_courses`)."""
    finalists = courses.only(np.arange(len(courses.simple))[: size.finalists])
    times = 2 if finalists.doublings < MOST_DOUBLINGS else 1
    finalists = with_nodes(surface, finalists, times)
    with subrange(0.7, 1.0):
        finalists = relaxed(surface, finalists, smoothness, OF_FINALISTS)
    finalists = uncrossed(surface, finalists, any_order)
    for one in distinct_courses(surface, finalists, smoothness, size.apart).tolist():
        own = finalists.only(np.array([one]))
        yield own.nodes, own.visit, False
        finer = with_nodes(surface, own, 2)
        yield finer.nodes, finer.visit, True


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


def _resolved(
    surface: CurveSurface, courses: CourseSet, smoothness: float, n_best: int
) -> CourseSet:
    """Relaxed courses with as many nodes as their energies need.

    The median over the `n_best` best courses decides whether nodes are doubled. Then the worst
    courses are left out.
    """
    unpainted = replace(surface, feature_map=None)  # with lanes, energies may be negative
    for _ in range(MOST_DOUBLINGS):
        doubled = with_nodes(surface, courses, 2)
        energy = energies_of_courses(surface, courses.nodes, smoothness)
        best = np.argsort(energy, kind="stable")[:n_best]
        before, after = (
            energies_of_courses(unpainted, each.nodes, smoothness) for each in (courses, doubled)
        )
        growth = after[best] / np.maximum(before[best], tolerances.TINY)
        if np.median(growth) < UNDER_RESOLVED:
            break
        most = max(FEWEST_DOUBLED, int(KEPT_WHEN_DOUBLED * courses.nodes.curves))
        energy = energies_of_courses(surface, doubled.nodes, smoothness)
        kept = np.sort(np.argsort(energy, kind="stable")[:most])
        courses = relaxed(surface, doubled.only(kept), smoothness, OF_DOUBLED)
    return courses
