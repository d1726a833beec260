"""Tests of the surfaces on which courses are searched for: edge density, and needle meshes."""

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.courses.course_surface import (
    FEWEST_VERTICES,
    MOST_CROSSED,
    CourseSurface,
    edges_crossed,
)
from nicmm_core.courses.hop_graph import SEARCH_CELLS
from nicmm_core.designer import Designer
from nicmm_core.mapped_surface import MappedSurface
from nicmm_core.maps.guidance import feature_map
from nicmm_core.relaxation import curve_nodes
from tests.core.checks import assert_valid_design


@pytest.mark.slow
def test_edges_crossed_are_counted_by_random_lines():
    """Compared with the mean number of mesh edges that random segments in the plane cross."""
    n = 40
    disc = shapes.disc(n)
    generator = np.random.default_rng(1)
    length = np.sqrt(disc.face_areas.sum() / SEARCH_CELLS[0])
    angle = generator.uniform(0.0, 2.0 * np.pi, 500)
    start = generator.uniform(-0.6, 0.6, (500, 2))
    end = start + length * np.column_stack([np.cos(angle), np.sin(angle)])
    a, b = disc.vertices[disc.edges][:, :, :2].transpose(1, 0, 2)

    def side(p, q, r):
        return (q - p)[..., 0] * (r - p)[..., 1] - (q - p)[..., 1] * (r - p)[..., 0]

    p, q = start[:, None], end[:, None]
    crossed = (side(p, q, a) * side(p, q, b) < 0.0) & (side(a, b, p) * side(a, b, q) < 0.0)
    assert edges_crossed(disc) == pytest.approx(crossed.sum(axis=1).mean(), rel=0.05)


@pytest.mark.slow
def test_no_courses_are_sought_on_needles():
    """A prism whose sides consist of thousands of slivers still gets a curve."""
    count = 2_500
    angle = 2.0 * np.pi * np.arange(count) / count
    low = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(count)])
    ring = np.arange(count)
    onward = (ring + 1) % count
    sides = [
        np.column_stack([ring, onward, onward + count]),
        np.column_stack([ring, onward + count, ring + count]),
    ]
    tube = nicmm.Mesh(np.concatenate([low, low + [0.0, 0.0, 40.0]]), np.concatenate(sides))
    assert edges_crossed(tube) > MOST_CROSSED
    designer = Designer(tube)
    points = [0, count + count // 3, 2 * count // 3]
    assert_valid_design(tube, designer.design(points, order="shortest"))
    surface = CourseSurface(MappedSurface(tube))
    request = designer.design(points, order="shortest").resumable.request
    assert not list(surface.courses(request))


@pytest.mark.slow
def test_the_feature_map_is_computed_once_for_a_request(monkeypatch):
    """All searches and relaxations of a request use the same φ_fea."""
    body = shapes.creature(3, subdivisions=1)
    computed = []

    def counted(mesh, *arguments):
        computed.append(mesh)
        return feature_map(mesh, *arguments)

    monkeypatch.setattr(curve_nodes, "feature_map", counted)
    lane = (body.vertices[:, 2] > 0.0).astype(float)
    Designer(body).design([3, 200, 650, 900], order="shortest", alignment=lane, alternatives=2)
    refined = len(body.vertices) < FEWEST_VERTICES
    assert len(computed) == 1 + refined
