"""Tests that work is bounded by counts, so that equal requests always give equal results."""

import sys

import numpy as np
import pytest
from nicmm_kernels import threads

import nicmm_core as nicmm
from nicmm_core import improvement, shapes, start_search, surface_designer
from nicmm_core.courses.course_search import WHOLE
from nicmm_core.path import legs, simple_path, virtual_splits
from nicmm_core.relaxation import relaxing
from tests.oracles.checker import judge

pytestmark = pytest.mark.slow

WORK = relaxing.RelaxationConfig().work


def fan(count):
    """A cone of needles that meet at its tip, surrounded by a ring of well-shaped faces."""
    angle = 2 * np.pi * np.arange(count) / count
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    vertices = np.concatenate([[[0, 0, 0.3]], ring, 1.5 * ring])
    inner, outer = 1 + np.arange(count), 1 + count + np.arange(count)
    onward, beyond = np.roll(inner, -1), np.roll(outer, -1)
    return nicmm.Mesh(
        vertices,
        np.concatenate(
            [
                np.stack([0 * inner, inner, onward], axis=1),
                np.stack([inner, outer, onward], axis=1),
                np.stack([onward, outer, beyond], axis=1),
            ]
        ),
    )


MOST_CALLS = 45_000
"""Greatest number of calls in Python and C by one design on a mesh with 4,002 vertices."""


def calls_of(task):
    """Number of functions in Python and C that a task calls."""
    count = 0

    def seen(frame, event, argument):
        nonlocal count
        count += event in ("call", "c_call")

    sys.setprofile(seen)
    try:
        task()
    finally:
        sys.setprofile(None)
    return count


def test_a_design_makes_few_calls(monkeypatch):
    """On a small mesh the cost is the number of calls, so loops over single elements are rare."""
    monkeypatch.setattr(threads, "thread_count", lambda: 1)  # calls of others are not counted
    body = shapes.creature(0, faces=500, subdivisions=2)
    nicmm.design_curve(
        body, [12, 800, 1641, 2500], order="shortest"
    )  # loads what is loaded only once
    designer = nicmm.Designer(nicmm.Mesh(body.vertices, body.faces))
    for points in ([12, 800, 1641, 2500], [40, 1000, 1900, 3000]):
        calls = calls_of(lambda points=points: designer.design(points, order="shortest"))
        assert 0 < calls <= MOST_CALLS


def test_a_fan_of_thousands_of_needles(monkeypatch):
    """A node that moves past the tip traverses all needles, so fewer moves are made."""
    work = []
    relax = surface_designer.relax

    def counted(*given):
        result = relax(*given)
        work.append(result.work)
        return result

    monkeypatch.setattr(surface_designer, "relax", counted)
    count = 3000
    mesh = fan(count)
    faces = np.array([10, 900, 1700, 2500])
    points = nicmm.SurfacePoints(faces, np.tile([0.8, 0.1, 0.1], (4, 1)))
    design = nicmm.design_curve(mesh, points)
    assert not judge(mesh, design, points).faults
    # The last move may start just below the limit, and each node may traverse half the faces.
    assert 0.0 < max(work) <= WORK + count / 2


def test_forty_points_back_and_forth(monkeypatch):
    """Each leg of the path has to wind around the previous ones."""
    splits = []
    add = virtual_splits.SplitMesh._add_vertex
    monkeypatch.setattr(
        virtual_splits.SplitMesh, "_add_vertex", lambda *given: splits.append(1) or add(*given)
    )
    mesh = shapes.torus(around=24, across=12)
    chosen = np.random.default_rng(3).choice(len(mesh.vertices), 40, replace=False)
    try:
        design = nicmm.design_curve(mesh, chosen)
    except nicmm.UnreachableError as error:
        assert "winds around itself too often" in str(error)
        # The message may have tried three other orders.
        orders = 4
    else:
        assert not judge(mesh, design, chosen).faults
        orders = 1
    of_paths = simple_path.MOST_SPLITS_TO_TRY + 2 * legs.MOST_PATH_SPLITS
    assert len(splits) <= orders * of_paths


def test_repeated_searches_are_bounded(monkeypatch):
    """Courses are searched for again if a curve bends, unless two searches have found it."""
    searched = []
    seek = start_search.StartSearch.courses

    def counted(self, request, search, **named):
        if search.size is WHOLE:
            searched.append(search.seed)  # runs when the generator is first advanced
        yield from seek(self, request, search, **named)

    monkeypatch.setattr(start_search.StartSearch, "courses", counted)
    monkeypatch.setattr(improvement, "SEARCHES_FOR_PARTS", 0)
    monkeypatch.setattr(improvement, "SLIGHTLY_BENT", 0.0)
    monkeypatch.setattr(improvement, "STRONGLY_BENT", 1e9)
    monkeypatch.setattr(improvement, "MOST_WORK", 1e9)
    body, chosen = shapes.creature(5, resolution=32, faces=1500, subdivisions=1), [20, 250, 600]
    nicmm.design_curve(body, chosen)
    assert searched == [0, 1]
    searched.clear()
    monkeypatch.setattr(improvement, "LEAST_GAIN", 1.0)
    monkeypatch.setattr(improvement, "is_apart", lambda *curves: True)
    nicmm.design_curve(body, chosen)
    assert searched == [0, *improvement.FURTHER_SEEDS]
    searched.clear()
    monkeypatch.setattr(improvement, "is_apart", lambda *curves: False)  # searches agree
    nicmm.design_curve(body, chosen)
    assert searched == [0, 1]
    searched.clear()
    monkeypatch.setattr(improvement, "MOST_WORK", 0)
    nicmm.design_curve(body, chosen)
    assert searched == [0]
