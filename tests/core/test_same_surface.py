"""Tests that a curve stays the same on meshes with defects that keep the surface."""

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import repaired_surface, shapes
from nicmm_core.geometry.curve import point_on_segment
from nicmm_core.splines.even_spacing import even_curve
from tests.core.checks import apart
from tests.oracles import same_surface
from tests.oracles.checker import judge
from tests.oracles.defects import defective_meshes

pytestmark = pytest.mark.usefixtures("one_attempt_each")

BALL = shapes.sphere(3)
BODY = nicmm.Mesh(BALL.vertices * [1.0, 0.8, 1.4] * (1.0 + 0.3 * BALL.vertices[:, 2:]), BALL.faces)
POINTS = np.array([3, 200, 400, 610])

SAME = [*same_surface.SAME_CURVE, "faces without area", "T-junctions", *same_surface.CHAINS]
SAME.remove("gaps, patch turned, a millionth as large")
SIMILAR = ["gaps", "gaps, patch turned, a millionth as large", "other diagonals"]


@pytest.fixture(scope="module")
def curves():
    """The curves on the unchanged mesh, by whether they are closed."""
    designer = nicmm.Designer(BODY)
    return {closed: designer.design(POINTS, closed=closed).curves[0] for closed in (True, False)}


def changed_curve(name, closed):
    """A curve on a changed mesh, checked, and its points on the unchanged one."""
    changed = same_surface.changed(BODY, name, 8)
    points = changed.number[POINTS]
    design = nicmm.design_curve(changed.mesh, points, closed=closed)
    assert not judge(changed.mesh, design, points, closed).faults
    return design, changed.undone(design.curves[0].points)


@pytest.mark.parametrize("closed", [True, pytest.param(False, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", SAME)
def test_the_curve_is_the_same(curves, name, closed):
    design, points = changed_curve(name, closed)
    assert apart(points, curves[closed].points) <= 1e-6 * BODY.diagonal
    assert bool(design.repairs) is (name not in ("all faces turned", "loose vertices", *SIZES))


SIZES = ("far away", "a million times as large", "a millionth as large")


@pytest.mark.parametrize("name", SIMILAR)
def test_the_curve_is_similar(curves, name):
    _, points = changed_curve(name, True)
    assert apart(points, curves[True].points) <= 0.02 * BODY.diagonal


@pytest.mark.slow
@pytest.mark.parametrize("name", ["caps", "fans without area", "collapsed edges", "caps far away"])
def test_a_curve_starts_from_a_curve_across_removed_faces(name):
    mesh = dict(defective_meshes())[name]
    points = [3, 100, 400, 500]
    designer = nicmm.Designer(mesh)
    first = designer.design(points)
    assert "faces without area removed" in first.repairs
    again = designer.design(points, start=first.curves[0])
    assert not judge(mesh, again, points).faults
    length = first.curves[0].length
    assert abs(again.curves[0].length - length) < 0.01 * length


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["soup", "gaps", "T-junctions", "faces without area", "turned, doubled soup"]
)
def test_a_curve_starts_from_a_curve_on_a_changed_mesh(name):
    """Also a curve across edges whose two faces share no vertices; and it is sampled evenly."""
    changed = same_surface.changed(BODY, name, 8)
    mesh, points = changed.mesh, changed.number[POINTS]
    designer = nicmm.Designer(mesh)
    first = designer.design(points).curves[0]
    again = designer.design(points, start=first)
    assert not judge(mesh, again, points).faults
    assert abs(again.curves[0].length - first.length) < 1e-3 * first.length
    even = even_curve(mesh, first, 1e-3 * mesh.diagonal)
    assert apart(even.points, first.points) <= 2e-3 * mesh.diagonal
    place = point_on_segment(mesh, first, 7, 0.5).positions(mesh)[0]
    np.testing.assert_allclose(place, 0.5 * (first.points[7] + first.points[8]), atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("height", [0.0, 1e-7])
def test_curves_pass_exactly_through_points_of_removed_faces(height):
    """Points inside a face without area, and on its long side, at its tip and at its ends."""
    name = f"caps of height {height:g}" if height else "caps"
    mesh = dict(defective_meshes())[name]
    cap = len(mesh.faces) - 1
    for weights in ([0.2, 0.3, 0.5], [0.4, 0.6, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]):
        points = nicmm.SurfacePoints(
            np.array([3, cap, 600]), np.array([[0.3, 0.3, 0.4], weights, [0.5, 0.25, 0.25]])
        )
        for closed in (True, False):
            design = nicmm.design_curve(mesh, points, closed=closed)
            assert not judge(mesh, design, points, closed).faults, weights


@pytest.mark.slow
def test_maps_reach_all_vertices_at_a_position():
    """It is enough to paint one of the vertices of a soup at each place."""
    changed = same_surface.changed(BODY, "turned, doubled soup", 2)
    weights = (BODY.vertices[:, 2] > 0.9).astype(float)
    on_soup = np.zeros(len(changed.vertices))
    on_soup[changed.number] = weights
    clean = nicmm.design_curve(BODY, POINTS, obstacles=weights)
    design = nicmm.design_curve(changed.mesh, changed.number[POINTS], obstacles=on_soup)
    assert apart(design.curves[0].points, clean.curves[0].points) <= 1e-6 * BODY.diagonal


@pytest.mark.slow
def test_a_cube_of_twelve_faces_has_one_energy():
    cube = shapes.cube(1)
    corners = [0, 3, 5, 6]
    energies = [
        nicmm.design_curve(one.mesh, one.number[corners], order="shortest").energy["smooth"]
        for one in (same_surface.changed(cube, name, 1) for name in same_surface.SAME_CURVE)
    ]
    np.testing.assert_allclose(energies, energies[0], rtol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("closed", [True, False])
def test_loose_vertices_of_a_mesh_that_is_not_copied(monkeypatch, closed):
    """A mesh as if it were too large for a copy, so that loose vertices stay, with maps."""
    monkeypatch.setattr(repaired_surface, "LARGEST_COPY", 0)
    body = shapes.creature(0, faces=500, subdivisions=2)
    loose = nicmm.Mesh(np.concatenate([np.zeros((3, 3)), body.vertices]), body.faces + 3)
    points = np.array([12, 800, 1641, 2500]) + 3
    weights = np.zeros(len(loose.vertices))
    weights[np.linalg.norm(loose.vertices - loose.vertices[900], axis=1) < 0.1] = 1.0
    for obstacles in (None, weights):
        design = nicmm.design_curve(
            loose, points, closed=closed, order="shortest", obstacles=obstacles
        )
        assert not judge(loose, design, points, closed, "shortest").faults
