"""Tests meshes with all kinds of defects: a curve wherever one exists, on the given faces."""

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry import tolerances
from nicmm_core.geometry.mesh import (
    adjacent_sides,
    corners_differ,
    joined_corners,
    side_corners,
    unique_edges,
)
from nicmm_core.geometry.surface_points import locate_points
from nicmm_core.repair.clean_surface import clean_surfaces
from nicmm_core.repair.nonmanifold import cut, is_manifold, sides_by_edge
from nicmm_core.repaired_surface import RepairedSurface
from nicmm_core.surface_designer import SurfaceDesigner
from tests.core.checks import grid, joined
from tests.oracles import corpus
from tests.oracles.checker import judge
from tests.oracles.defects import defective_meshes

pytestmark = pytest.mark.usefixtures("one_attempt_each")

MESHES = dict(defective_meshes())

HEIGHTS = ("1e-13", "1e-10", "1e-07")

UNDONE = {
    **dict.fromkeys(("soup", "seam"), "vertices joined"),
    **dict.fromkeys(
        ("collapsed edges", "collapsed faces", "caps", "caps far away", "fans without area"),
        "faces without area removed",
    ),
    **{f"caps of height {height}": "faces without area removed" for height in HEIGHTS},
}
"""The repair that is left out of the second surface of a mesh, where cleaning changes the mesh."""


def nonmanifold_vertices(mesh):
    """Vertices whose faces form more than one fan, connected through edges at the vertex."""
    ends = side_corners(mesh.faces)
    one, other = adjacent_sides(mesh.faces)
    _, vertex_of_fan = joined_corners(mesh.faces, ends[one].ravel(), ends[other].ravel())
    return np.bincount(vertex_of_fan, minlength=len(mesh.vertices)) > 1


def repairs_of(mesh):
    """The manifolds in the order in which they are tried."""
    surface = RepairedSurface(clean_surfaces(mesh), np.arange(len(mesh.faces)))
    return list(surface.manifolds())


def first_repair(mesh):
    return repairs_of(mesh)[0]


@pytest.mark.slow
@pytest.mark.parametrize("request_number", [0, 3])
@pytest.mark.parametrize("name", MESHES)
def test_a_good_curve_unless_an_error_is_due(name, request_number):
    outcome = corpus.outcome(corpus.Item(corpus.GENERATED, name, None, request_number))
    assert outcome.verdict in (corpus.GOOD, corpus.DUE), outcome.words


@pytest.mark.parametrize(
    "mesh",
    [shapes.sphere(2), shapes.disc(4), shapes.moebius_strip(), MESHES["needles"], MESHES["hole"]],
    ids=["sphere", "disc", "Möbius strip", "needles", "hole"],
)
def test_meshes_without_defects_are_their_own_copy(mesh):
    (only,) = repairs_of(mesh)
    assert only.mesh is mesh and not only.differs
    assert not only.repairs


@pytest.mark.parametrize("seed", [None, *range(8)])
def test_a_mesh_taken_for_a_manifold_needs_no_cut(seed):
    """On all defective meshes, and on spheres with randomly welded vertices."""
    meshes = list(MESHES.values())
    if seed is not None:
        generator = np.random.default_rng(seed)
        ball = shapes.sphere(2)
        number = np.arange(len(ball.vertices))
        number[generator.choice(len(number), seed, replace=False)] = generator.integers(len(number))
        meshes = [nicmm.Mesh(ball.vertices, faces_between(number[ball.faces]))]
    for mesh in meshes:
        pairs, several = sides_by_edge(mesh.faces)
        needs_none = not several and np.array_equal(
            cut(mesh.faces, pairs, len(mesh.vertices))[0], mesh.faces
        )
        assert needs_none or not is_manifold(mesh)
    if seed in (None, 0):
        assert is_manifold(shapes.sphere(2)) and is_manifold(shapes.disc(4))


def faces_between(faces):
    """Faces with three different corners."""
    return faces[corners_differ(faces)]


@pytest.mark.parametrize("name", MESHES)
def test_repairs_are_manifolds_of_the_same_faces(name):
    mesh = MESHES[name]
    repairs = repairs_of(mesh)
    first, *others = clean_surfaces(mesh)
    assert len(others) == (name in UNDONE)
    for other in others:
        assert first.repairs[UNDONE[name]] and not other.repairs[UNDONE[name]]
    with_all_connected = mesh.has_nonmanifold_edges and name != "duplicate faces"
    assert len(repairs) == 1 + len(others) + with_all_connected
    for mapped in repairs:
        for made in (mapped.manifold, mapped.mesh):
            assert_manifold(made)
            assert (made.face_areas > 0.0).all()
            assert made.is_oriented or name == "Möbius strip"
        manifold, parts = mapped.manifold, mapped.in_given
        np.testing.assert_allclose(parts.corners.sum(axis=2), 1.0, atol=1e-15)
        of_faces = parts.corners @ mesh.vertices[mesh.faces[parts.parent]]
        places = np.zeros((mapped.place.max() + 1, 3))
        places[mapped.place[manifold.faces]] = of_faces
        divided = len(mapped.clean.divisions) > 0
        width = divided * tolerances.DEGENERATE_SINE * mesh.mean_edge_length
        np.testing.assert_allclose(
            places[mapped.place[manifold.faces]], of_faces, atol=1e-12 * mesh.diagonal + width
        )
        moved = manifold.vertices[manifold.faces] + mapped.origin - of_faces
        start, end = mesh.vertices[mesh.edges].transpose(1, 0, 2)
        assert np.abs(moved).max() <= 1e-3 * np.linalg.norm(end - start, axis=1).max() + 1e-9


@pytest.mark.parametrize("name", MESHES)
def test_parts_of_a_face_cover_it_once(name):
    mesh = MESHES[name]
    for mapped in repairs_of(mesh):
        for parts in (mapped.in_given, mapped.in_mesh):
            area = np.bincount(parts.parent, weights=np.abs(np.linalg.det(parts.corners)))
            np.testing.assert_allclose(area[np.unique(parts.parent)], 1.0, atol=1e-12)


@pytest.mark.parametrize("count", [3, 4, 5, 8, 9, 40])
def test_all_faces_at_one_edge_are_connected(count):
    """The number of pieces is so small that the number of faces grows as count log count."""
    angle = 2 * np.pi * np.arange(count) / count
    around = np.stack([np.cos(angle), np.sin(angle), 0.5 + 0 * angle], axis=1)
    mesh = nicmm.Mesh(
        np.concatenate([[[0, 0, 0], [0, 0, 1]], around]), [[0, 1, 2 + i] for i in range(count)]
    )
    straight, connected = repairs_of(mesh)
    assert len(np.unique(straight.mesh.face_component)) == -(-count // 2)
    assert len(np.unique(connected.mesh.face_component)) == 1
    assert len(connected.mesh.faces) <= count * (2 * np.log2(count) + 4)
    for mapped in (straight, connected):
        assert_manifold(mapped.mesh)


def assert_manifold(mesh):
    """Assert at most two faces per edge and one fan of faces per vertex."""
    assert (unique_edges(mesh.faces)[1] <= 2).all()
    assert not nonmanifold_vertices(mesh).any()


def test_copies_of_one_vertex_are_at_different_places():
    """Otherwise a straight trace from a control point at one copy would pass through another."""
    copy = first_repair(MESHES["touching at vertices"])
    doubled = np.bincount(copy.place).max()
    assert doubled > 1
    assert len(np.unique(copy.mesh.vertices, axis=0)) == len(copy.mesh.vertices)


def test_only_vertices_of_faces_without_area_move():
    """Where the faces without area stay."""
    vertices = grid(4).vertices.copy()
    faces = grid(4).faces
    vertices[faces[5, 0]] = vertices[faces[5, 1]]
    copy = repairs_of(nicmm.Mesh(vertices, faces))[1]
    offset = copy.mesh.vertices - vertices
    offset -= np.median(offset, axis=0)
    flat = triangle_heights(vertices[faces]) <= tolerances.DEGENERATE_SINE
    assert flat.any()
    still = np.setdiff1d(np.arange(len(vertices)), faces[flat])
    np.testing.assert_allclose(offset[still], 0.0, atol=1e-15)
    assert (np.linalg.norm(offset[np.unique(faces[flat])], axis=1) > 0.0).all()


def triangle_heights(corners):
    side = corners - np.roll(corners, 1, axis=1)
    return np.linalg.norm(np.cross(side[:, 0], side[:, 1]), axis=1)


@pytest.mark.slow
def test_curve_field_and_warm_start_belong_to_the_users_mesh(monkeypatch):
    mesh = MESHES["caps"]
    from_nothing = []
    designed = SurfaceDesigner._designed
    monkeypatch.setattr(
        SurfaceDesigner, "_designed", lambda *given: from_nothing.append(1) or designed(*given)
    )
    before = mesh.vertices.copy(), mesh.faces.copy()
    designer = nicmm.Designer(mesh)
    points = np.array([3, 100, 400, 500])
    first = designer.design(points, order="shortest")
    again = designer.design(points, order="shortest", smoothness=2.0, start=first)
    for design in (first, again):
        assert not judge(mesh, design, points, True, "shortest").faults
        assert design.field.shape == (len(mesh.vertices),)
        assert np.isfinite(design.field).all()
        np.testing.assert_allclose(design.field[points], 0.0, atol=1e-2 * mesh.mean_edge_length)
    assert len(from_nothing) == 1
    np.testing.assert_array_equal(mesh.vertices, before[0])
    np.testing.assert_array_equal(mesh.faces, before[1])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["fins", "caps"])
def test_maps_and_via_points_reach_the_copy(name):
    mesh = MESHES[name]
    on_ball = mesh.vertices[: len(MESHES["sphere"].vertices)]
    obstacles = (mesh.vertices[:, 2] > 0.3).astype(float)
    ends = np.array([on_ball[:, 0].argmin(), on_ball[:, 0].argmax()])
    down = [int(on_ball[:, 2].argmin())]
    around = nicmm.design_curve(mesh, ends, closed=False, obstacles=obstacles)
    below = nicmm.design_curve(mesh, ends, closed=False, via_points={0: down})
    for design in (around, below):
        assert not judge(mesh, design, ends, False).faults
    assert around.curves[0].points[:, 2].max() < 0.6
    assert below.curves[0].points[:, 2].mean() < 0.0


@pytest.mark.slow
def test_points_of_a_twin_face_and_of_a_cut_edge():
    """Control points lie in faces that the repaired mesh omits or subdivides."""
    ball = shapes.sphere(2)
    mesh = nicmm.Mesh(ball.vertices, np.concatenate([ball.faces, ball.faces[:, [1, 0, 2]]]))
    faces = len(ball.faces) + np.array([3, 90, 200])
    points = nicmm.SurfacePoints(faces, np.array([[0.5, 0.3, 0.2], [0.5, 0.5, 0.0], [0, 0, 1.0]]))
    design = nicmm.design_curve(mesh, points)
    assert not judge(mesh, design, points).faults


@pytest.mark.parametrize("along", [0.0, 0.25, 1.0])
def test_position_in_a_face_without_area(along):
    """On a mesh without any other face there."""
    mesh = joined(nicmm.Mesh([[2, 0, 0], [3, 0, 0], [5, 0, 0]], [[0, 1, 2]]), shapes.sphere(1))
    place = np.array([[2 + 3 * along, 0, 0]])
    located = locate_points(mesh, place, "here")
    assert located.faces.tolist() == [0]
    np.testing.assert_allclose(located.positions(mesh), place, atol=1e-12)
    assert (located.barycentric >= 0.0).all()


def test_parts_that_meet_in_one_vertex_are_refused():
    mesh = MESHES["hour glass"]
    points = [0, 1, len(mesh.vertices) - 1]
    with pytest.raises(nicmm.UnreachableError, match="share only single vertices"):
        nicmm.design_curve(mesh, points)


def test_components_without_any_area_are_refused():
    flat = nicmm.Mesh([[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]], [[0, 1, 2], [1, 3, 2]])
    mesh = joined(flat, shapes.sphere(1))
    curve = nicmm.design_curve(mesh, [5, 20, 35])
    assert not judge(mesh, curve, [5, 20, 35]).faults


@pytest.mark.parametrize("factor", [1e-40, 1e40])
def test_any_size_in_reason(factor):
    ball = shapes.sphere(2)
    mesh = nicmm.Mesh(factor * ball.vertices, ball.faces)
    design = nicmm.design_curve(mesh, [3, 60, 100])
    assert not judge(mesh, design, [3, 60, 100]).faults


@pytest.mark.parametrize("factor", [0.0, 1e-60, 1e60, 1e300])
def test_sizes_beyond_all_numbers_are_refused(factor):
    ball = shapes.sphere(1)
    with pytest.raises(nicmm.MeshError, match="scale"):
        nicmm.Mesh(factor * ball.vertices, ball.faces)


class TestOpenEdgesAtOnePlace:
    """Open edges at one place are one edge."""

    @pytest.fixture
    def soup(self, small_ball):
        corners = small_ball.vertices[small_ball.faces].reshape(-1, 3)
        return nicmm.Mesh(corners, np.arange(len(corners)).reshape(-1, 3))

    @pytest.mark.slow
    @pytest.mark.parametrize("method", ["elastic", "variational"])
    def test_a_soup_has_the_curve_of_the_surface_that_it_is(self, small_ball, soup, method):
        ball, faces = small_ball, np.array([3, 70, 150, 280])
        points = nicmm.SurfacePoints(faces, np.tile([0.2, 0.3, 0.5], (4, 1)))
        weights = (ball.vertices[:, 2] > 0.95).astype(float)
        of_corners = np.zeros(len(soup.vertices))
        # It is enough to paint one of the vertices at each place.
        of_corners[np.unique(ball.faces, return_index=True)[1]] = weights
        one, other = (
            nicmm.design_curve(mesh, points, order="shortest", obstacles=obstacles, method=method)
            for mesh, obstacles in ((ball, weights), (soup, of_corners))
        )
        assert not judge(soup, other, points, order="shortest").faults
        assert abs(one.curves[0].length - other.curves[0].length) < 0.02 * one.curves[0].length
        np.testing.assert_allclose(
            np.abs(other.field), np.abs(one.field)[ball.faces.ravel()], atol=0.1
        )

    def test_closed_surfaces_that_touch_stay_apart(self):
        """Two boxes that touch along one side, with separate vertices there."""
        mesh = MESHES["touching boxes"]
        assert "vertices joined" not in first_repair(mesh).repairs
        with pytest.raises(nicmm.UnreachableError, match="different components"):
            nicmm.design_curve(mesh, [0, 5, len(mesh.vertices) - 1])

    def test_two_zeros_are_one_place(self):
        sheet = grid(2)
        half = sheet.vertices * [-1.0, 1.0, 1.0]
        mesh = joined(sheet, nicmm.Mesh(half, sheet.faces))
        n = len(sheet.vertices)
        far = int(sheet.vertices.sum(axis=1).argmax())
        design = nicmm.design_curve(mesh, [far, far + n], closed=False)
        assert not judge(mesh, design, [far, far + n], closed=False).faults

    @pytest.mark.slow
    def test_three_sheets_that_share_no_vertices(self):
        mesh = MESHES["three sheets along an edge"]
        soup = nicmm.Mesh(
            mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(mesh.faces.size).reshape(-1, 3)
        )
        corners = mesh.faces.ravel()
        ends = np.array([np.flatnonzero(corners == v)[0] for v in (40, 120, 200)])
        design = nicmm.design_curve(soup, ends, closed=False, order="shortest")
        assert not judge(soup, design, ends, closed=False, order="shortest").faults

    def test_a_gap_is_named_as_what_it_is(self, soup):
        vertices = soup.vertices + np.repeat(np.linspace(0.0, 1e-3, len(soup.faces)), 3)[:, None]
        with pytest.raises(nicmm.UnreachableError, match="merge vertices by distance"):
            nicmm.design_curve(nicmm.Mesh(vertices, soup.faces), [3, 100, 400])

    @pytest.mark.slow
    def test_cutting_a_soup_says_what_mends_it(self, soup):
        curve = nicmm.design_curve(soup, [3, 100, 400]).curves[0]
        with pytest.raises(nicmm.CurveError, match="merge vertices by distance"):
            nicmm.cut_mesh(soup, curve)


class TestEdgesOfManyFaces:
    """Edges at which the straightest pairs of faces do not connect the points."""

    @pytest.mark.slow
    @pytest.mark.parametrize("seed", range(4))
    def test_octants_about_one_vertex(self, seed):
        """All edges at the vertex have four faces, and each curve needs other pairs of them."""
        axes = np.concatenate([np.eye(3), -np.eye(3)])
        vertices = np.concatenate([np.zeros((1, 3)), axes])
        pairs = [(a, b) for a in range(1, 7) for b in range(a + 1, 7) if b != a + 3]
        mesh = nicmm.Mesh(vertices, [[0, a, b] for a, b in pairs])
        assert mesh.has_nonmanifold_edges
        chosen = np.random.default_rng(seed).choice(np.arange(1, 7), 3, replace=False)
        design = nicmm.design_curve(mesh, chosen, order="shortest", closed=False)
        assert not judge(mesh, design, chosen, closed=False, order="shortest").faults

    @pytest.mark.slow
    def test_any_of_four_faces_at_one_edge(self):
        mesh = nicmm.Mesh(
            [[0, 0, -0.5], [0, 0, 0.5], [-1, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0]],
            [[0, 1, 2], [0, 1, 3], [0, 1, 4], [0, 1, 5]],
        )
        designer = nicmm.Designer(mesh)
        for ends in ([2, 4], [3, 5], [4, 2], [2, 3], [4, 3]):
            design = designer.design(ends, closed=False)
            assert not judge(mesh, design, ends, closed=False).faults
        for points in ([2, 3, 4], [5, 3, 4, 2]):
            design = designer.design(points, order="shortest")
            assert not judge(mesh, design, points, order="shortest").faults


@pytest.mark.slow
def test_two_faces_with_the_same_corners_are_one(small_ball):
    """Even if their edges have no other faces, so that they would form a closed surface."""
    for second in ([0, 1, 2], [1, 0, 2]):
        corners = np.vstack([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]], small_ball.vertices + 5.0])
        mesh = nicmm.Mesh(corners, np.vstack([[[0, 1, 2], second], small_ball.faces + 3]))
        weights = np.random.default_rng(0).dirichlet(np.ones(3), size=6)
        points = nicmm.SurfacePoints(np.array([0, 1, 0, 1, 1, 0]), weights)
        design = nicmm.design_curve(mesh, points, order="shortest")
        assert not judge(mesh, design, points, True, "shortest").faults
