"""Tests enclosed regions, and surfaces parted along curves, against independent counts."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.surface_points import nearest_points
from nicmm_core.outputs.cut import cut_mesh
from nicmm_core.outputs.parts import part_mesh
from nicmm_core.outputs.region import enclosed_region
from tests.core.checks import euler_characteristic, grid, joined
from tests.core.outputs.checks import components_without, edges_with_counts
from tests.core.outputs.curves import designed
from tests.core.outputs.test_cut import curve_at
from tests.oracles.named_curves import named_curves

pytestmark = pytest.mark.usefixtures("one_attempt_each")


@pytest.fixture(scope="module")
def cap():
    """A curve near the parallel of the sphere at an angle of 0.5 from the pole, and its cut."""
    mesh = shapes.sphere(4)
    angles = np.arange(8) * 2 * np.pi / 8
    ring = np.stack(
        [np.sin(0.5) * np.cos(angles), np.sin(0.5) * np.sin(angles), np.full(8, np.cos(0.5))],
        axis=1,
    )
    nearest = np.linalg.norm(mesh.vertices[None] - ring[:, None], axis=2).argmin(axis=1)
    curve = nicmm.design_curve(mesh, nearest).curves[0]
    return mesh, curve, cut_mesh(mesh, curve)


def test_cap_has_its_area_and_its_vertices(cap):
    mesh, _, cut = cap
    region = enclosed_region(mesh, cut)
    assert region.area == pytest.approx(2 * np.pi * (1 - np.cos(0.5)), rel=0.05)
    assert region.area == pytest.approx(cut.mesh.face_areas[region.cut_faces].sum())
    assert region.area == pytest.approx((region.share * mesh.face_areas).sum())
    up = np.arccos(mesh.vertices[:, 2])
    assert region.vertices(mesh)[up < 0.45].all()
    assert not region.vertices(mesh)[up > 0.55].any()
    assert region.cut_vertices[cut.chain].all()
    middle = np.arccos(mesh.vertices[mesh.faces].mean(axis=1)[:, 2] / 0.999)
    assert region.faces[middle < 0.4].all() and not region.faces[middle > 0.6].any()
    assert ((region.share > 0) & (region.share < 1)).sum() < 0.1 * len(mesh.faces)


@pytest.mark.slow
def test_sides_are_those_of_the_level_set(cap):
    mesh, _, _ = cap
    design = nicmm.design_curve(mesh, [100, 700, 1500, 2000], order="shortest")
    region = enclosed_region(mesh, cut_mesh(mesh, design.curves[0]))
    clear = np.abs(design.field) > 0.01
    np.testing.assert_array_equal(region.vertices(mesh)[clear], design.field[clear] < 0.0)


@pytest.mark.slow
@settings(max_examples=6)
@given(
    kind=st.sampled_from(["sphere", "creature", "torus", "disc", "annulus", "Möbius strip"]),
    seed=st.integers(0, 4),
    closed=st.booleans(),
)
def test_random_curves_bound_where_they_separate(kind, seed, closed):
    mesh, curve = designed(kind, seed, False, closed, "elastic")
    assume(curve is not None)
    cut = cut_mesh(mesh, curve)
    parts = components_without(cut.faces, cut.chain_edges)
    parted = part_mesh(cut)
    assert parted.part.max() + 1 == parts
    if parts == 1:
        with pytest.raises(nicmm.CurveError, match="bounds no region"):
            enclosed_region(mesh, cut)
        return
    region = enclosed_region(mesh, cut)
    assert 0.0 < region.area <= 0.5 * mesh.face_areas.sum() * (1 + 1e-9)
    # A side may have several parts if the curve touches the rim.
    assert not set(parted.part[region.cut_faces]) & set(parted.part[~region.cut_faces])
    for wanted in (region.cut_faces, ~region.cut_faces):
        here = np.flatnonzero(wanted)[0]
        centre = cut.corner_weights(mesh)[here].mean(axis=0)
        point = nicmm.SurfacePoints(cut.source_face[[here]], centre[None])
        chosen = enclosed_region(mesh, cut, side_of=point)
        np.testing.assert_array_equal(chosen.cut_faces, wanted)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    ["meridian of a torus", "(1, 1) curve of a torus", "core of a Möbius strip"],
)
def test_curves_round_a_tube_bound_nothing_and_open_the_surface(name):
    found = next(entry for entry in named_curves() if entry.name == name)
    curve = nicmm.design_curve(found.mesh, found.points, order=found.order).curves[0]
    cut = cut_mesh(found.mesh, curve)
    with pytest.raises(nicmm.CurveError, match="closed, but runs around a handle"):
        enclosed_region(found.mesh, cut)
    parted = part_mesh(cut)
    assert parted.part.max() == 0
    assert euler_characteristic(parted.faces) == euler_characteristic(found.mesh.faces)
    # A cut along a one-sided curve has one rim, as long as the two rims of a two-sided one.
    two_sided = "Möbius" not in name
    assert len(parted.vertices) - len(cut.vertices) == len(cut.chain)
    rims = rim_loops(parted.faces) - rim_loops(found.mesh.faces)
    assert rims == (2 if two_sided else 1)


@pytest.mark.slow
def test_round_the_hole_of_an_annulus_is_a_region():
    found = next(entry for entry in named_curves() if "annulus" in entry.name)
    curve = nicmm.design_curve(found.mesh, found.points, order=found.order).curves[0]
    cut = cut_mesh(found.mesh, curve)
    region = enclosed_region(found.mesh, cut)
    radius = np.linalg.norm(cut.vertices[cut.faces].mean(axis=1), axis=1)
    assert radius[region.cut_faces].max() < radius[~region.cut_faces].max()


def rim_loops(faces):
    edges, count = edges_with_counts(faces)
    rim = edges[count == 1].tolist()
    parent = {v: v for edge in rim for v in edge}

    def root(v):
        while parent[v] != v:
            v = parent[v]
        return v

    for a, b in rim:
        parent[root(a)] = root(b)
    return len({root(v) for v in parent})


def test_parted_surface_keeps_faces_and_positions(cap):
    mesh, _, cut = cap
    parted = part_mesh(cut)
    np.testing.assert_array_equal(parted.source_vertex[parted.faces], cut.faces)
    np.testing.assert_array_equal(parted.vertices, cut.vertices[parted.source_vertex])
    assert set(np.flatnonzero(np.bincount(parted.source_vertex) == 2)) == set(cut.chain)
    assert not set(parted.faces[parted.part == 0].ravel()) & set(
        parted.faces[parted.part == 1].ravel()
    )
    for part in (0, 1):
        assert euler_characteristic(parted.faces[parted.part == part]) == 1


def test_open_curve_inside_makes_a_slit(small_ball):
    curve = nicmm.design_curve(small_ball, [1, 50, 90], closed=False).curves[0]
    cut = cut_mesh(small_ball, curve)
    parted = part_mesh(cut)
    assert len(parted.vertices) - len(cut.vertices) == len(cut.chain) - 2
    assert parted.part.max() == 0
    assert euler_characteristic(parted.faces) == 1


def test_open_curve_from_rim_to_rim_bounds():
    mesh = grid(4)
    curve = nicmm.design_curve(mesh, [1, 21], closed=False).curves[0]
    cut = cut_mesh(mesh, curve)
    region = enclosed_region(mesh, cut)
    assert region.area < 0.5
    assert part_mesh(cut).part.max() == 1
    other = enclosed_region(mesh, cut, side_of=[24])
    np.testing.assert_array_equal(other.cut_faces, ~region.cut_faces)


def test_region_inside_one_face_has_no_vertices():
    mesh = grid(2)
    loop = [(3, w) for w in ((0.6, 0.2, 0.2), (0.2, 0.6, 0.2), (0.2, 0.2, 0.6))]
    cut = cut_mesh(mesh, curve_at(mesh, loop, True))
    region = enclosed_region(mesh, cut)
    assert region.area == pytest.approx(0.16 * mesh.face_areas[3])
    assert region.share[3] == pytest.approx(0.16)
    assert not region.vertices(mesh).any() and not region.faces.any()


@pytest.mark.slow
def test_other_components_stay_outside(small_ball):
    mesh = joined(small_ball, nicmm.Mesh(0.01 * small_ball.vertices, small_ball.faces))
    curve = nicmm.design_curve(mesh, [1, 50, 90]).curves[0]
    cut = cut_mesh(mesh, curve)
    far = len(small_ball.vertices)
    region = enclosed_region(mesh, cut)
    assert not region.vertices(mesh)[far:].any()
    with pytest.raises(nicmm.ControlPointError, match="not connected to the curve"):
        enclosed_region(mesh, cut, side_of=[far])
    assert part_mesh(cut).part.max() == 2


def test_points_that_choose_no_side(cap):
    mesh, curve, cut = cap
    with pytest.raises(nicmm.ControlPointError, match="lies on the curve"):
        enclosed_region(
            mesh, cut, side_of=nicmm.SurfacePoints(curve.faces[:1], curve.barycentric[:1])
        )
    with pytest.raises(nicmm.ControlPointError, match="has 2 points"):
        enclosed_region(mesh, cut, side_of=[1, 2])


def test_curve_along_the_rim_bounds_the_whole_surface():
    mesh = grid(1)
    corners = [(0, (1, 0, 0)), (0, (0, 1, 0)), (0, (0, 0, 1)), (1, (0, 0, 1))]
    cut = cut_mesh(mesh, curve_at(mesh, corners, True))
    assert enclosed_region(mesh, cut).area == pytest.approx(1.0)


@pytest.mark.slow
@pytest.mark.parametrize("half_width", [0.2, 0.5])
def test_a_strip_between_two_offsets_of_a_great_circle_has_the_area_of_a_zone(half_width):
    mesh = shapes.sphere(5)
    angle = np.linspace(0.0, 2.0 * np.pi, 7)[:-1]
    places = np.stack([np.cos(angle), np.sin(angle), np.zeros(6)], axis=1)
    curve = nicmm.design_curve(mesh, nearest_points(mesh, places)[0]).curves[0]
    designer = nicmm.Designer(mesh)
    [left], [right] = designer.offset_curves(curve, [half_width, -half_width])
    cut = cut_mesh(mesh, [left, right])
    assert_surface_unchanged(mesh, cut)
    strip = enclosed_region(mesh, cut, side_of=curve.points[:1])
    assert strip.area == pytest.approx(4.0 * np.pi * np.sin(half_width), rel=1e-3)
    parted = part_mesh(cut)
    assert parted.part.max() == 2
    assert components_without(cut.faces, cut.chain_edges) == 3


def test_two_curves_around_a_tube_bound_a_region_although_one_does_not():
    mesh = shapes.torus(around=48, across=24)
    rings = []
    for at in (0, 12):
        across = mesh.vertices[[24 * at + 8 * step for step in range(3)]]
        rings.append(nicmm.design_curve(mesh, across).curves[0])
    with pytest.raises(nicmm.CurveError, match="bounds no region"):
        enclosed_region(mesh, cut_mesh(mesh, rings[0]))
    region = enclosed_region(mesh, cut_mesh(mesh, rings))
    assert region.area == pytest.approx(mesh.face_areas.sum() / 4.0, rel=0.01)


@pytest.mark.slow
def test_curves_that_cross_can_be_cut_one_after_the_other():
    mesh = grid(8)
    low, high = mesh.vertices[:, :2].min(axis=0), mesh.vertices[:, :2].max(axis=0)
    middle = 0.5 * (low + high) + 0.013

    def line(start, end):
        places = np.column_stack([np.array([start, end]), np.zeros(2)])
        return nicmm.design_curve(mesh, places, closed=False).curves[0]

    across = line((low[0], middle[1]), (high[0], middle[1]))
    along = line((middle[0], low[1]), (middle[0], high[1]))
    cut = cut_mesh(mesh, [across, along])
    assert_surface_unchanged(mesh, cut)
    assert part_mesh(cut).part.max() == 3


def assert_surface_unchanged(mesh, cut):
    """The parts cover their source faces, with the orientation of these."""
    assert euler_characteristic(cut.faces) == euler_characteristic(mesh.faces)
    weights = cut.corner_weights(mesh)
    assert np.linalg.det(weights).min() > 0.0
    np.testing.assert_allclose(
        np.bincount(cut.source_face, cut.mesh.face_areas), mesh.face_areas, rtol=1e-7
    )
    positions = cut.at_corners(mesh, mesh.vertices[mesh.faces])
    np.testing.assert_allclose(positions, cut.vertices[cut.faces], atol=1e-9 * mesh.diagonal)


def test_an_empty_list_of_curves_is_refused(cap):
    with pytest.raises(nicmm.ArgumentError, match="empty list"):
        cut_mesh(cap[0], [])
