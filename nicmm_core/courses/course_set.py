"""Courses that are relaxed and compared together.

They are compared by the energy that relaxation minimises, but with one length scale for all of
them, the length of the shortest course (`elastic_energy.comparable_energies`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import nicmm_kernels
import numpy as np

from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.surface_points import joined
from ..progress import checkpoint, subrange
from ..relaxation.batch_relaxation import BatchConfig, curves_of, relax_batch
from ..relaxation.curve_nodes import CurveSurface, Nodes, nodes_at
from ..relaxation.elastic_energy import comparable_energies
from ..relaxation.even_nodes import resampled
from .uncrossing import remove_crossings


@dataclass(frozen=True)
class CourseSet:
    """Courses through the same control points, with the same number of nodes each.

    Attributes
    ----------
    nodes : Nodes
        c courses.
    visit : (n,) int array
        Index of the control point at each node, -1 at all other nodes.
    simple : (c,) bool array
        Which courses did not cross themselves when crossings were last removed.
    doublings : int
        Number of times that the nodes of the candidates have been doubled.
    """

    nodes: Nodes
    visit: IntArray
    simple: BoolArray
    doublings: int = 0

    def only(self, which: IntArray) -> CourseSet:
        """Some of the courses, by their indices."""
        visit = self.nodes.by_curve(self.visit)[which].ravel()
        nodes = curves_of(self.nodes, which)
        return replace(self, nodes=nodes, visit=visit, simple=self.simple[which])


def with_corners(nodes: Nodes, visit: IntArray, corners: BoolArray) -> Nodes:
    """The same courses, which may turn freely at some of the k control points, (k,)."""
    return replace(nodes, corners=(visit >= 0) & corners[visit]) if corners.any() else nodes


def uncrossed(surface: CurveSurface, courses: CourseSet, any_order: bool) -> CourseSet:
    """The courses without crossings, where these can be removed (`remove_crossings`)."""
    nodes, visit, simple = remove_crossings(surface, courses.nodes, courses.visit, any_order)
    return replace(courses, nodes=nodes, visit=visit, simple=simple)


def relaxed(
    surface: CurveSurface,
    courses: CourseSet,
    smoothness: float,
    passes: tuple[BatchConfig, ...],
) -> CourseSet:
    """The courses relaxed in one or more passes.

    Before each pass but the first, nodes are placed evenly along the traces. While nodes move, only
    their distances count, which are too short around the edges of thin parts.
    """
    for number, config in enumerate(passes):
        if number:
            courses = with_nodes(surface, courses, 1)
        with subrange(number / len(passes), (number + 1) / len(passes)):
            fixed = courses.visit >= 0
            nodes = relax_batch(surface, courses.nodes, fixed, smoothness, config)
        courses = replace(courses, nodes=nodes)
    return courses


def with_nodes(surface: CurveSurface, courses: CourseSet, times: int) -> CourseSet:
    """The courses with once or twice as many nodes, evenly spaced."""
    nodes, former = resampled(surface, courses.nodes, courses.visit >= 0, times)
    visit = np.where(former < 0, -1, courses.visit[former])
    doublings = courses.doublings + times - 1
    return replace(courses, nodes=nodes, visit=visit, doublings=doublings)


def together(surface: CurveSurface, sets: list[CourseSet], corners: BoolArray) -> CourseSet:
    """The courses of several sets, each with as many nodes as those of the finest set.

    The courses may turn freely at some of the k control points, (k,).
    """
    doublings = max(each.doublings for each in sets)
    finest = []
    for each in sets:
        while each.doublings < doublings:
            each = with_nodes(surface, each, 2)
        finest.append(each)
    places = joined([each.nodes.places for each in finest])
    count = sum(each.nodes.curves for each in finest)
    nodes = nodes_at(surface, places, finest[0].nodes.closed, count)
    visit = np.concatenate([each.visit for each in finest])
    simple = np.concatenate([each.simple for each in finest])
    return CourseSet(with_corners(nodes, visit, corners), visit, simple, doublings)


def energies_of_courses(surface: CurveSurface, nodes: Nodes, smoothness: float) -> FloatArray:
    """E of each course, (c,), with the length of the shortest course as the length scale."""
    shortest = float(nodes.by_curve(nodes.step_lengths).sum(axis=1).min())
    return comparable_energies(surface, nodes, smoothness, shortest)


def distinct_courses(
    surface: CurveSurface, courses: CourseSet, smoothness: float, apart: float
) -> IntArray:
    """Indices of distinct courses by ascending energy: the simple ones, then the other ones.

    On a thin part, a course that crosses itself may run beside a simple one.

    Parameters
    ----------
    surface : CurveSurface
    courses : CourseSet
    smoothness : float
    apart : float
        Distance, in bounding-box diagonals, up to which two courses count as the same.
    """
    nodes = courses.nodes
    energy = energies_of_courses(surface, nodes, smoothness)
    positions = np.ascontiguousarray(nodes.positions).reshape(nodes.curves, -1, 3)

    def distinct(among: IntArray) -> IntArray:
        by_energy = among[np.argsort(energy[among], kind="stable")]
        chosen = nicmm_kernels.distinct_curves(
            positions[by_energy],
            np.arange(len(by_energy)),
            apart * surface.mesh.diagonal,
            checkpoint,
        )
        found: IntArray = by_energy[chosen]
        return found

    simple = courses.simple
    return np.concatenate([distinct(np.flatnonzero(simple)), distinct(np.flatnonzero(~simple))])
