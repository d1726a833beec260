"""A Designer goes on from its last curve: cheaply, validly, and only where that is right."""

import igl
import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import shapes, surface_designer
from nicmm_core.geometry.surface_points import locate_control_points
from nicmm_core.relaxation.curve_nodes import CurveSurface, unsigned_normals
from nicmm_core.relaxation.noded_curve import without_short_segments
from nicmm_core.relaxation.relaxing import RelaxationConfig, relax
from nicmm_core.relaxation.warm_start import WARM, moved_along
from tests.core.checks import apart, assert_valid_design, circle, nearest_vertices

CHOSEN = [12, 80, 41, 150]


def _counted(function, calls):
    def counted(*arguments):
        calls.append(arguments)
        return function(*arguments)

    return counted


@pytest.fixture
def problems(monkeypatch):
    """How often a design has started anew."""
    built = []
    for name in ("predicted", "requested_problem"):
        monkeypatch.setattr(
            surface_designer, name, _counted(getattr(surface_designer, name), built)
        )
    return built


def beside(mesh, vertex, taken):
    """A neighbour of a vertex that is not taken."""
    return next(v for v in igl.adjacency_list(mesh.faces)[vertex] if v not in taken)


@pytest.mark.parametrize("closed", [True, False])
def test_a_dragged_point_starts_from_the_last_curve(surface, problems, closed):
    designer = nicmm.Designer(surface)
    rim = np.zeros(len(surface.vertices), dtype=bool)
    for loop in igl.boundary_loop_all(surface.faces):
        rim[loop] = True
    inner = np.flatnonzero(surface.referenced & ~rim)
    chosen = np.random.default_rng(3).choice(inner, size=4, replace=False).tolist()
    first = designer.design(chosen, closed=closed, order="shortest")
    assert_valid_design(surface, first, closed=closed)
    for place in range(4):
        chosen[place] = beside(surface, chosen[place], {*chosen, *np.flatnonzero(rim)})
        dragged = designer.design(chosen, closed=closed, order="shortest")
        assert_valid_design(surface, dragged, closed=closed)
        found = dragged.curves[0].points[dragged.curves[0].control_index]
        expected = surface.vertices[chosen]
        gap = np.linalg.norm(found[:, None] - expected, axis=2)
        assert gap.min(axis=0).max() <= 1e-12 * surface.diagonal
    assert len(problems) == 1


def test_dragging_there_and_back_returns_to_the_curve(ball, problems):
    designer = nicmm.Designer(ball)
    first = designer.design(CHOSEN, order="shortest")
    away = [beside(ball, CHOSEN[0], CHOSEN), *CHOSEN[1:]]
    moved = designer.design(away, order="shortest")
    back = designer.design(CHOSEN, order="shortest")
    assert len(problems) == 1
    gap = apart(first.curves[0].points, back.curves[0].points)
    assert gap < 0.2 * apart(first.curves[0].points, moved.curves[0].points)
    assert back.energy["smooth"] == pytest.approx(first.energy["smooth"], rel=0.02)


def test_a_warm_great_circle_is_one(ball):
    """Three points on the equator, from three beside it."""
    equator = circle(np.radians([0.0, 130.0, 230.0]))
    designer = nicmm.Designer(ball)
    designer.design(nearest_vertices(ball, equator + [0.0, 0.0, 0.1]))
    on_surface = igl.point_mesh_squared_distance(equator, ball.vertices, ball.faces)[2]
    warm = designer.design(on_surface)
    assert np.abs(warm.curves[0].points[:, 2]).max() < 5e-3


def test_the_same_request_has_the_same_answer(body):
    designer = nicmm.Designer(body)
    first, second = (designer.design(CHOSEN, order="shortest") for _ in range(2))
    np.testing.assert_array_equal(first.curves[0].points, second.curves[0].points)


def test_smoothness_starts_from_the_last_curve(body, problems):
    designer = nicmm.Designer(body)
    first = designer.design(CHOSEN, order="shortest")
    tight = designer.design(CHOSEN, order="shortest", smoothness=0.02)
    assert tight.curves[0].length < first.curves[0].length
    assert len(problems) == 1


def test_new_maps_start_anew_and_stay_for_dragging(body, problems):
    """The initial path has to go round a new obstacle."""
    designer = nicmm.Designer(body)
    first = designer.design(CHOSEN, order="shortest")
    weights = np.zeros(len(body.vertices))
    middle = first.curves[0].points[len(first.curves[0].points) // 2]
    weights[np.linalg.norm(body.vertices - middle, axis=1) < 0.05 * body.diagonal] = 1.0
    avoiding = designer.design(CHOSEN, order="shortest", obstacles=weights)
    assert_valid_design(body, avoiding)
    assert len(problems) == 2
    away = [beside(body, CHOSEN[0], CHOSEN), *CHOSEN[1:]]
    dragged = designer.design(away, order="shortest", obstacles=weights.copy())
    assert len(problems) == 2
    assert dragged.energy["fea"] > 0.0


@pytest.mark.parametrize(
    "change",
    [
        {"control_points": [12, 80, 41, 300]},
        {"control_points": [12, 80, 41]},
        {"closed": False},
        {"order": "given"},
        {"method": "variational"},
    ],
    ids=lambda change: next(iter(change)),
)
def test_other_requests_start_anew(body, problems, change):
    designer = nicmm.Designer(body)
    request = {"control_points": CHOSEN, "order": "shortest"}
    designer.design(**request)
    anew = designer.design(**{**request, **change})
    assert len(problems) == 2
    plain = nicmm.design_curve(body, **{**request, **change})
    np.testing.assert_array_equal(anew.curves[0].points, plain.curves[0].points)


def test_forgetting_starts_anew(body, problems):
    designer = nicmm.Designer(body)
    designer.design(CHOSEN, order="shortest")
    designer.forget()
    designer.design([beside(body, CHOSEN[0], CHOSEN), *CHOSEN[1:]], order="shortest")
    assert len(problems) == 2


def test_other_via_points_start_anew(ring, problems):
    """Also where the caller changes the mapping that was passed before."""
    designer = nicmm.Designer(ring)
    controls = nearest_vertices(ring, 1.4 * circle(np.radians([250.0, 270.0, 290.0])))
    via = {2: nearest_vertices(ring, 1.4 * circle(np.radians([0.0, 90.0, 180.0]))).tolist()}
    designer.design(controls, via_points=via)
    designer.design(controls, via_points={2: np.array(via[2])}, smoothness=0.5)
    assert len(problems) == 1
    via[2] = via[2][:1]
    designer.design(controls, via_points=via)
    assert len(problems) == 2
    with pytest.raises(nicmm.ArgumentError, match="via_points"):
        designer.design(controls, via_points=[57])


def test_a_bad_request_leaves_the_last_curve(body, problems):
    designer = nicmm.Designer(body)
    designer.design(CHOSEN, order="shortest")
    with pytest.raises(nicmm.ControlPointError):
        designer.design([12, 80, 80, 150], order="shortest")
    designer.design([beside(body, CHOSEN[0], CHOSEN), *CHOSEN[1:]], order="shortest")
    assert len(problems) == 1


def test_iterations_are_few_from_afar_and_fewer_from_the_last_curve():
    """Medians over random points of generated creatures, with every attempt counted.

    From afar they depend on the initial curve too; that bound only keeps them from growing.
    """
    from_afar, dragged = [], []
    for seed in range(6):
        mesh = shapes.creature(seed, resolution=32, faces=2000)
        generator = np.random.default_rng(seed)
        for closed in (True, False):
            chosen = generator.choice(len(mesh.vertices), 4, replace=False).tolist()
            designer = nicmm.Designer(mesh)
            design = designer.design(chosen, closed=closed, order="shortest")
            from_afar.append(design.iterations)
            for _ in range(3):
                chosen[0] = beside(mesh, chosen[0], chosen)
                design = designer.design(chosen, closed=closed, order="shortest")
                assert_valid_design(mesh, design, closed=closed)
                dragged.append(design.iterations)
    assert np.median(from_afar) <= 10
    assert np.median(dragged) <= 3


def test_a_dragged_curve_keeps_its_nodes(ball):
    """What is remembered is the curve that was returned, with as many nodes as it has."""
    surface = CurveSurface(ball, unsigned_normals(ball))
    start = nicmm.design_curve(ball, CHOSEN, order="shortest").curves[0]
    first = relax(surface, start, 1.0, RelaxationConfig())
    result = without_short_segments(ball, first.exact)
    np.testing.assert_array_equal(result.points, first.curve.points)
    places = locate_control_points(ball, first.curve.points[first.curve.control_index], True)
    moved = moved_along(surface, first.exact, places)
    again = relax(surface, moved, 1.0, WARM)
    assert len(again.exact.nodes.positions) == len(first.exact.nodes.positions)
    assert again.iterations <= 2
    assert apart(again.curve.points, first.curve.points) < 1e-2
