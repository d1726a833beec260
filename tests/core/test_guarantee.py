"""Tests the guarantee of one simple curve through all points, on random surfaces and points.

Only the public interface is used. The only exception to the guarantee is an `UnreachableError`. On
a connected surface without boundary there is no exception, because a simple curve exists for every
order of the points.
"""

import re
from functools import cache

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

import nicmm_core as nicmm
from nicmm_core import shapes
from tests.oracles.checker import judge

pytestmark = pytest.mark.slow

MOST_NOISE = 0.25
"""Standard deviation of vertex displacements, in mean edge lengths."""

WITHOUT_BOUNDARY = {
    "sphere": lambda seed: shapes.sphere(1 + seed % 2),
    "torus": lambda seed: shapes.torus(around=8 + seed, across=5 + seed % 4),
    "creature": lambda seed: shapes.creature(seed, resolution=24, faces=120, subdivisions=0),
    "double torus": lambda seed: shapes.double_torus(300 + 40 * seed, subdivisions=0),
}
WITH_BOUNDARY = {
    "disc": lambda seed: shapes.disc(3 + seed % 4),
    "Möbius strip": lambda seed: shapes.moebius_strip(12 + seed, 2 + seed % 3),
    "annulus": lambda seed: shapes.annulus(4 + seed % 4),
    "holes": lambda seed: with_holes(shapes.sphere(2), 1 + seed, seed),
}
SHAPES = WITHOUT_BOUNDARY | WITH_BOUNDARY


@cache
def surface(kind, seed, noisy):
    """One of the shapes, optionally with randomly displaced vertices."""
    mesh = SHAPES[kind](seed)
    if not noisy:
        return mesh
    corners = mesh.vertices[mesh.faces]
    edge = np.linalg.norm(corners[:, 0] - corners[:, 1], axis=1).mean()
    noise = np.random.default_rng(seed).normal(size=mesh.vertices.shape)
    return nicmm.Mesh(mesh.vertices + MOST_NOISE * edge * noise, mesh.faces)


def with_holes(mesh, count, seed):
    """A mesh without some of its faces, no two of which share a vertex."""
    removed, touched = [], set()
    for face in np.random.default_rng(seed).permutation(len(mesh.faces)):
        corners = set(mesh.faces[face].tolist())
        if len(removed) < count and not touched & corners:
            removed.append(face)
            touched |= corners
    return nicmm.Mesh(mesh.vertices, np.delete(mesh.faces, removed, axis=0))


def has_boundary(mesh):
    sides = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    return bool((np.unique(sides, axis=0, return_counts=True)[1] == 1).any())


@st.composite
def requests(draw, kinds):
    """A surface and a request on it, with points at corners, on edges and inside faces."""
    made = (draw(st.sampled_from(list(kinds))), draw(st.integers(0, 4)), draw(st.booleans()))
    mesh = surface(*made)
    closed = draw(st.booleans())
    faces = draw(
        st.lists(
            st.integers(0, len(mesh.faces) - 1),
            min_size=3 if closed else 2,
            max_size=5,
            unique=True,
        )
    )
    weights = [
        draw(st.sampled_from([(1, 0, 0), (0, 1, 0), (0, 1, 1), (1, 2, 0), (1, 1, 1), (9, 5, 1)]))
        for _ in faces
    ]
    order = draw(st.sampled_from(["given", "shortest"]))
    points = control_points(faces, weights)
    assume(distinct(mesh, points))
    return made, points, closed, order


def control_points(faces, weights):
    weights = np.array(weights, dtype=float)
    return nicmm.SurfacePoints(np.array(faces), weights / weights.sum(axis=1, keepdims=True))


def assert_promise_is_kept(made, points, closed, order, method):
    mesh = surface(*made)
    try:
        design = nicmm.design_curve(mesh, points, closed=closed, order=order, method=method)
    except nicmm.UnreachableError as error:
        assert has_boundary(mesh), error
        named = re.search(r"in the order \[([\d, ]+)\]", str(error))
        if named:
            visit = np.array([int(index) for index in named[1].split(",")])
            assert sorted(visit) == list(range(len(points)))
            other = nicmm.SurfacePoints(points.faces[visit], points.barycentric[visit])
            design = nicmm.design_curve(mesh, other, closed=closed, method=method)
            assert judge(mesh, design, other, closed).faults == []
        return
    assert judge(mesh, design, points, closed, order).faults == []
    assert design.status in (nicmm.Status.CONVERGED, nicmm.Status.ITERATION_LIMIT)


def distinct(mesh, points):
    places = points.positions(mesh)
    apart = np.linalg.norm(places[:, None] - places[None], axis=2)
    return (apart[np.triu_indices(len(places), k=1)] > 1e-6).all()


def at_vertices(made, vertices):
    """Control points at vertices of a surface."""
    corner = surface(*made).faces[:, :, None] == np.array(vertices)
    faces = corner.any(axis=1).argmax(axis=0)
    return nicmm.SurfacePoints(faces, corner[faces, :, np.arange(len(vertices))].astype(float))


ANNULUS, DISC = ("annulus", 2, False), ("disc", 2, False)
ROUND_THE_HOLE = (ANNULUS, at_vertices(ANNULUS, [67, 34, 29]), True, "given")
ALONG_THE_RIM = (DISC, at_vertices(DISC, [73, 75, 32]), False, "given")


@settings(max_examples=4)
@given(requests(WITHOUT_BOUNDARY))
def test_variational_without_boundary(request):
    assert_promise_is_kept(*request, "variational")


@settings(max_examples=7)
@given(requests(WITHOUT_BOUNDARY))
def test_elastic_without_boundary(request):
    assert_promise_is_kept(*request, "elastic")


@settings(max_examples=3)
@given(requests(WITH_BOUNDARY))
@example(ROUND_THE_HOLE)
@example(ALONG_THE_RIM)
def test_variational_with_boundary(request):
    assert_promise_is_kept(*request, "variational")


@settings(max_examples=5)
@given(requests(WITH_BOUNDARY))
@example(ROUND_THE_HOLE)
@example(ALONG_THE_RIM)
def test_elastic_with_boundary(request):
    assert_promise_is_kept(*request, "elastic")
