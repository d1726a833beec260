"""Tests cuts along designed curves, and along curves in degenerate positions."""

from collections import Counter

import igl
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.curve import curve_on_mesh
from nicmm_core.io.files import read_mesh
from nicmm_core.outputs.cut import cut_mesh
from nicmm_core.outputs.polygons import cut_polygons
from tests.core.checks import flipped, grid, renumbered, scaled
from tests.core.outputs.checks import assert_valid_cut, edges_with_counts, longest_edge
from tests.core.outputs.curves import KINDS, designed
from tests.oracles.mesh_files import COLLECTIONS, mesh_files, spread

pytestmark = pytest.mark.usefixtures("one_attempt_each")

NO_CONTROLS = np.zeros(0, dtype=np.int64)


def curve_at(mesh, points, closed):
    """A curve through points, given as (face, barycentric coordinates) pairs."""
    faces, barycentric = zip(*points, strict=True)
    barycentric = np.array(barycentric, dtype=float)
    return curve_on_mesh(mesh, closed, np.array(faces), barycentric, NO_CONTROLS)


@pytest.mark.slow
@settings(max_examples=10)
@given(
    kind=st.sampled_from(KINDS),
    seed=st.integers(0, 4),
    noisy=st.booleans(),
    closed=st.booleans(),
    method=st.sampled_from(["elastic", "elastic", "variational"]),
    snap=st.sampled_from([0.0, 1e-3, 0.05, 0.25]),
    deviation=st.sampled_from([0.0, 0.02]),
)
def test_designed_curves(kind, seed, noisy, closed, method, snap, deviation):
    mesh, curve = designed(kind, seed, noisy, closed, method)
    assume(curve is not None)
    cut = cut_mesh(mesh, curve, snap, deviation * longest_edge(mesh))
    assert_valid_cut(mesh, cut, curve if snap <= 1e-3 else None)


@pytest.mark.slow
@pytest.mark.parametrize("closed", [True, False])
def test_curve_of_the_papers_method(closed):
    ball = shapes.sphere(1)
    design = nicmm.design_curve(ball, [1, 20, 35], closed=closed, method="nicmm")
    assert_valid_cut(ball, cut_mesh(ball, design.curves[0]), design.curves[0])


@pytest.mark.slow
@pytest.mark.skipif(not COLLECTIONS.exists(), reason="the meshes are not beside this folder")
def test_scans():
    for number, path in enumerate(spread(mesh_files("shrec16"), 3)):
        coarse = read_mesh(path)
        mesh = nicmm.Mesh(*igl.loop(coarse.vertices, coarse.faces))
        chosen = np.random.default_rng(number).choice(len(mesh.vertices), 4, replace=False)
        for closed in (True, False):
            curve = nicmm.design_curve(mesh, chosen, order="shortest", closed=closed).curves[0]
            assert_valid_cut(mesh, cut_mesh(mesh, curve), curve)


def test_edge_of_three_faces_is_cut_in_all_of_them():
    mesh = nicmm.Mesh(
        [[0, 0, 0], [0, 1, 0], [1, 0, 0], [-1, 0, 0], [0, 0, 1]], [[0, 1, 2], [1, 0, 3], [0, 1, 4]]
    )
    middle = (0.5, 0.5, 0.0)
    ends = (0, (0.2, 0.2, 0.6)), (1, (0.2, 0.2, 0.6))
    cut = cut_mesh(mesh, curve_at(mesh, [ends[0], (0, middle), ends[1]], False))
    assert_valid_cut(mesh, cut)
    assert edges_with_counts(cut.faces)[1].tolist().count(3) == 2
    np.testing.assert_array_equal(np.bincount(cut.source_face)[2], 2)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_turned_and_renumbered_faces(body, seed):
    for mesh in (flipped(body, seed), renumbered(body, seed)):
        curve = nicmm.design_curve(mesh, [5, 60, 120], order="shortest").curves[0]
        assert_valid_cut(mesh, cut_mesh(mesh, curve), curve)


def test_control_points_are_vertices_of_the_cut(body):
    faces = np.array([3, 90, 200, 250])
    weights = np.array([[0.2, 0.3, 0.5], [0.5, 0.5, 0.0], [1.0, 0.0, 0.0], [0.6, 0.2, 0.2]])
    design = nicmm.design_curve(body, nicmm.SurfacePoints(faces, weights), order="shortest")
    curve = design.curves[0]
    for deviation in (0.0, 0.1 * longest_edge(body)):
        cut = cut_mesh(body, curve, deviation=deviation)
        assert set(curve.control_index) <= set(cut.chain_point)
        at = np.searchsorted(np.sort(cut.chain_point), curve.control_index)
        places = cut.chain[np.argsort(cut.chain_point)][at]
        np.testing.assert_allclose(
            cut.vertices[places], curve.points[curve.control_index], atol=1e-12
        )


def test_deviation_leaves_points_out_and_keeps_to_its_bound(small_ball):
    curve = nicmm.design_curve(small_ball, [1, 50, 90]).curves[0]
    whole = cut_mesh(small_ball, curve)
    before = len(whole.chain)
    for share in (0.005, 0.05):
        deviation = share * longest_edge(small_ball)
        cut = cut_mesh(small_ball, curve, deviation=deviation)
        assert_valid_cut(small_ball, cut, curve)
        assert len(cut.chain) < before
        before = len(cut.chain)
        place = whole.vertices[whole.chain]
        start, end = cut.vertices[cut.chain_edges.T]
        along = end - start
        offset = place[:, None] - start
        part = np.clip((offset * along).sum(axis=2) / (along**2).sum(axis=1), 0.0, 1.0)
        distance = np.linalg.norm(offset - part[:, :, None] * along, axis=2).min(axis=1)
        assert distance.max() <= deviation + 2e-3 * longest_edge(small_ball)


@pytest.mark.slow
def test_size_does_not_matter(small_ball):
    curve = nicmm.design_curve(small_ball, [1, 50, 90]).curves[0]
    cut = cut_mesh(small_ball, curve)
    for factor in (1e-9, 1e9):
        other = cut_mesh(scaled(small_ball, factor), curve)
        np.testing.assert_array_equal(other.faces, cut.faces)
        np.testing.assert_allclose(other.vertices, factor * cut.vertices, rtol=1e-12)


def test_triangle_with_one_segment():
    mesh = nicmm.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    cut = cut_mesh(mesh, curve_at(mesh, [(0, (0.5, 0.5, 0)), (0, (0.5, 0, 0.5))], False))
    assert_valid_cut(mesh, cut)
    assert len(cut.faces) == 3
    np.testing.assert_array_equal(cut.source_face, 0)
    np.testing.assert_allclose(cut.vertices[3:], [[0.5, 0, 0], [0, 0.5, 0]])
    np.testing.assert_array_equal(cut.chain, [3, 4])


def test_curve_along_edges_changes_nothing_but_its_chain(ball):
    rim = ball.faces_at(np.array([0]))
    corners = ball.faces[rim]
    after = {}
    for a, b, c in corners.tolist():
        start, end = {0: (b, c)}.get(a, {0: (c, a)}.get(b, (a, b)))
        after[start] = end
    loop = [next(iter(after))]
    while after[loop[-1]] != loop[0]:
        loop.append(after[loop[-1]])
    around = [(int(ball.faces_at(np.array([v]))[0]), v) for v in loop]
    points = [(f, (ball.faces[f] == v).astype(float)) for f, v in around]
    cut = cut_mesh(ball, curve_at(ball, points, True))
    np.testing.assert_array_equal(cut.faces, ball.faces)
    np.testing.assert_array_equal(cut.chain, loop)


def test_loop_and_slit_inside_one_face():
    mesh = grid(2)
    loop = [(3, w) for w in ((0.6, 0.2, 0.2), (0.2, 0.6, 0.2), (0.2, 0.2, 0.6))]
    cut = cut_mesh(mesh, curve_at(mesh, loop, True))
    assert_valid_cut(mesh, cut)
    assert (cut.source_face == 3).sum() == 7
    slit = [(3, (0.5, 0.3, 0.2)), (3, (0.2, 0.3, 0.5))]
    cut = cut_mesh(mesh, curve_at(mesh, slit, False))
    assert_valid_cut(mesh, cut)
    assert len(cut.chain) == 2


def test_points_near_a_vertex_move_there():
    mesh = grid(2)  # vertex 4 in the middle
    near = 1e-5
    face = int((mesh.faces == 4).any(axis=1).argmax())
    close = np.where(mesh.faces[face] == 4, 1.0 - near, near / 2)
    start = np.where(mesh.faces[face] == 4, 0.5, 0.25)
    curve = curve_at(mesh, [(face, start), (face, close)], False)
    cut = cut_mesh(mesh, curve)
    assert_valid_cut(mesh, cut)
    assert cut.chain[-1] == 4
    exact = cut_mesh(mesh, curve, snap=0.0)
    assert_valid_cut(mesh, exact)
    assert exact.chain[-1] > 8


def test_strands_that_snapping_would_join_stay_apart():
    """Strands pass a vertex on opposite sides, both closer than the snapping margin."""
    mesh = grid(2)
    near = 1e-4
    around = np.flatnonzero((mesh.faces == 4).any(axis=1)).tolist()
    loop = []
    # A loop around the vertex, so small that all of its points would snap to the vertex.
    for face in around:
        corner = int((mesh.faces[face] == 4).argmax())
        here = mesh.faces[face][(corner + 1) % 3]
        weights = np.zeros(3)
        weights[corner], weights[(corner + 1) % 3] = 1.0 - near, near
        loop.append((np.arctan2(*(mesh.vertices[here] - mesh.vertices[4])[1::-1]), face, weights))
    loop.sort(key=lambda entry: entry[0])
    curve = curve_at(mesh, [(face, weights) for _, face, weights in loop], True)
    cut = cut_mesh(mesh, curve)
    assert_valid_cut(mesh, cut)
    assert len(cut.chain) == len(around)
    assert 4 not in cut.chain


@pytest.mark.slow
def test_quads_stay_whole_polygons_where_they_can():
    """A curve through a row of quads cuts each of them into two polygons."""
    mesh = grid(4)
    quad = np.tile(np.arange(16), 2)
    curve = nicmm.design_curve(mesh, [2, 22], closed=False).curves[0]
    assert np.ptp(curve.points[:, 1]) < 1.0
    cut = cut_mesh(mesh, curve)
    polygons = cut_polygons(cut, quad)
    sizes = [len(corners) for corners in polygons.corners]
    assert min(sizes) >= 3
    area = sum(polygon_area(cut.vertices[corners]) for corners in polygons.corners)
    assert area == pytest.approx(len(np.unique(polygons.source)) / 16)
    for corners, triangles in zip(polygons.corners, polygons.triangles, strict=True):
        for vertex, triangle in zip(corners, triangles, strict=True):
            assert vertex in cut.faces[triangle]
    directed = [
        (a, b)
        for corners in polygons.corners
        for a, b in zip(corners, [*corners[1:], corners[0]], strict=True)
    ]
    assert len(set(directed)) == len(directed)
    for a, b in cut.chain_edges.tolist():
        assert ((a, b) in directed) or ((b, a) in directed)
    triangles = cut_polygons(cut, quad, joined=False)
    assert {len(corners) for corners in triangles.corners} == {3}
    assert len(triangles.corners) > len(polygons.corners)


def test_curve_along_the_diagonal_of_a_quad_parts_it():
    mesh = grid(1)
    curve = curve_at(mesh, [(0, (1.0, 0, 0)), (0, (0, 0, 1.0))], False)
    assert {tuple(p) for p in curve.points.tolist()} == {(0, 0, 0), (1, 1, 0)}
    cut = cut_mesh(mesh, curve)
    polygons = cut_polygons(cut, np.zeros(2, dtype=int))
    assert sorted(len(corners) for corners in polygons.corners) == [3, 3]


@pytest.mark.slow
@settings(max_examples=6)
@given(seed=st.integers(0, 4), closed=st.booleans(), kind=st.sampled_from(["torus", "annulus"]))
def test_polygons_of_random_pairs_of_triangles(seed, closed, kind):
    mesh, curve = designed(kind, seed, False, closed, "elastic")
    assume(curve is not None)
    cut = cut_mesh(mesh, curve)
    owner = pairs_of_faces(mesh, seed)
    polygons = cut_polygons(cut, owner)
    if kind == "annulus":  # which is flat
        touched = np.isin(owner, polygons.source)
        area = sum(polygon_area(cut.vertices[corners]) for corners in polygons.corners)
        assert area == pytest.approx(mesh.face_areas[touched].sum())
    kept = np.isin(owner[cut.source_face], polygons.source, invert=True)
    rims = [
        frozenset(pair)
        for corners in polygons.corners
        for pair in zip(corners, [*corners[1:], corners[0]], strict=True)
    ]
    rims += [frozenset((row[k], row[k - 1])) for row in cut.faces[kept].tolist() for k in range(3)]
    count = Counter(rims)
    assert max(count.values()) == 2
    assert all(frozenset(edge) in count for edge in cut.chain_edges.tolist())


def pairs_of_faces(mesh, seed):
    """Quad of each face: pairs of adjacent faces, chosen greedily; some faces stay single."""
    owner = np.full(len(mesh.faces), -1)
    for face in np.random.default_rng(seed).permutation(len(mesh.faces)):
        if owner[face] < 0:
            owner[face] = face
            free = [f for f in mesh.face_neighbours[face] if f >= 0 and owner[f] < 0]
            if free:
                owner[free[0]] = face
    return owner


def polygon_area(corners):
    return 0.5 * np.linalg.norm(np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0))


def test_curves_that_cannot_be_cut():
    mesh = grid(2)
    centre = (1 / 3, 1 / 3, 1 / 3)
    with pytest.raises(nicmm.CurveError, match="point 1 has face 99"):
        cut_mesh(mesh, no_positions([0, 99], [centre, centre]))
    with pytest.raises(nicmm.CurveError, match="no face contains its points 0 and 1"):
        cut_mesh(mesh, curve_at(mesh, [(0, centre), (7, centre)], False))
    with pytest.raises(nicmm.CurveError, match="has 1 points, too few"):
        cut_mesh(mesh, curve_at(mesh, [(0, centre)], False))
    with pytest.raises(nicmm.CurveError, match="point 0 has face 0 and coordinates"):
        cut_mesh(mesh, no_positions([0, 0], [(0.9, 0.9, -0.8), centre]))
    bow = [(0, w) for w in ((0.8, 0.1, 0.1), (0.1, 0.45, 0.45), (0.1, 0.8, 0.1), (0.6, 0.2, 0.2))]
    crossing = [bow[0], bow[1], bow[2], (0, (0.3, 0.1, 0.6))]
    with pytest.raises(nicmm.CurveError, match="crosses or touches itself"):
        cut_mesh(mesh, curve_at(mesh, crossing, True))
    back = [(0, (0.8, 0.1, 0.1)), (0, (0.2, 0.4, 0.4)), (0, (0.5, 0.25, 0.25))]
    with pytest.raises(nicmm.CurveError, match="crosses or touches itself"):
        cut_mesh(mesh, curve_at(mesh, back, False))
    still = [(0, centre), (0, centre), (0, centre)]
    with pytest.raises(nicmm.CurveError, match="crosses or touches itself"):
        cut_mesh(mesh, curve_at(mesh, still, True))


def no_positions(faces, barycentric):
    return nicmm.SurfaceCurve(
        False, np.array(faces), np.array(barycentric), np.zeros((len(faces), 3)), NO_CONTROLS
    )


@pytest.mark.parametrize(
    ("name", "value"),
    [("snap", -0.1), ("snap", 0.5), ("snap", "x"), ("deviation", -1.0), ("deviation", None)],
)
def test_arguments_out_of_range(name, value):
    mesh = grid(1)
    curve = curve_at(mesh, [(0, (1.0, 0, 0)), (0, (0, 0, 1.0))], False)
    with pytest.raises(nicmm.ArgumentError, match=name):
        cut_mesh(mesh, curve, **{name: value})


@pytest.mark.slow
def test_only_crossed_faces_are_cut():
    mesh = shapes.sphere(5)
    curve = nicmm.design_curve(mesh, [12, 80, 41]).curves[0]
    cut = cut_mesh(mesh, curve)
    assert len(cut.faces) - len(mesh.faces) < 20 * len(curve.points)
