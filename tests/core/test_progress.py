"""Tests that every stage of a design calls the progress function, which can stop it anywhere."""

import sys
import threading

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import improvement, progress, shapes
from nicmm_core.geometry import mesh as mesh_module
from nicmm_core.progress import CancelledError, checkpoint, placed, subrange, watched
from tests.oracles.checker import judge_curve
from tests.oracles.defects import defective_meshes

MESHES = dict(defective_meshes())
LARGE = shapes.sphere(5)

STAGES = {
    "large mesh": (
        LARGE,
        [7, 2000, 5000, 9000],
        {"closed": False},
        "mesh nonmanifold coarse_mesh coarse_start hop_graph leg_combinations course_search "
        "batch_relaxation fine_curve relaxing tracing discrete_curve",
    ),
    "fins and an obstacle": (
        MESHES["fins"],
        [3, 100, 400, 500],
        {"order": "shortest", "clearance": 0.05},
        "nonmanifold mapped_mesh distances visiting_order",
    ),
    "paper": (
        shapes.sphere(2),
        [3, 50, 90, 140],
        {"closed": False, "method": "nicmm"},
        "leg_search leg_graph virtual_splits band_refinement sign_bundle sparse_solver smoothing "
        "level_set_solver fitting",
    ),
    "variational": (
        shapes.sphere(3),
        [3, 100, 400, 500],
        {"order": "shortest", "method": "variational"},
        "leg_search topology distances level_set_solver variational sparse_solver",
    ),
}


@pytest.fixture
def at_every_checkpoint(monkeypatch):
    """Make progress functions be called at every checkpoint."""
    monkeypatch.setattr(progress, "INTERVAL", 0.0)


def request_of(name):
    """A request on a mesh for which nothing has been computed by other tests."""
    mesh, points, arguments, stages = STAGES[name]
    mesh = nicmm.Mesh(mesh.vertices, mesh.faces)
    if "clearance" in arguments:
        far = mesh.vertices - mesh.vertices[60]
        arguments = arguments | {"obstacles": (np.linalg.norm(far, axis=1) < 0.1).astype(float)}
    return mesh, points, arguments, stages


def modules_above():
    """Names of the modules on the call stack."""
    names, frame = set(), sys._getframe(1)
    while frame is not None:
        names.add(frame.f_globals["__name__"].rpartition(".")[2])
        frame = frame.f_back
    return names


@pytest.mark.slow
@pytest.mark.parametrize("name", STAGES)
def test_every_stage_asks_and_fractions_only_grow(at_every_checkpoint, name):
    mesh, points, arguments, stages = request_of(name)
    fractions, asking = [], set()

    def look(fraction, curve):
        fractions.append(fraction)
        asking.update(modules_above())

    nicmm.design_curve(mesh, points, progress=look, **arguments)
    assert set(stages.split()) <= asking, set(stages.split()) - asking
    assert fractions == sorted(fractions)
    assert fractions[0] >= 0.0 and fractions[-1] <= 1.0
    assert len(set(fractions)) > 5


@pytest.mark.slow
@pytest.mark.parametrize("name", STAGES)
def test_wherever_it_is_stopped_the_curve_is_good_and_the_designer_goes_on(
    at_every_checkpoint, name
):
    mesh, points, arguments, _ = request_of(name)
    fractions = []
    whole = nicmm.design_curve(
        mesh, points, progress=lambda fraction, _: fractions.append(fraction), **arguments
    )
    designer = nicmm.Designer(mesh)
    without = 0
    limits = np.linspace(0.0, max(fractions), 4)
    for limit in limits:
        after = []

        def stop(fraction, curve, limit=limit, after=after):
            if fraction >= limit:
                after.append(fraction)
                return False
            return None

        design = designer.design(points, progress=stop, **arguments)
        assert len(after) == 1  # not called again after it has stopped the design
        assert design.status is nicmm.Status.CANCELLED
        for curve in design.curves:
            assert not judge_curve(mesh, curve, closed=whole.curves[0].closed).faults
        if not design.curves:
            without += 1
            with pytest.raises(nicmm.CurveError, match="cancelled"):
                _ = design.field
    assert 0 < without < len(limits)
    again = designer.design(points, **arguments)
    assert again.status is whole.status
    np.testing.assert_array_equal(again.curves[0].points, whole.curves[0].points)


@pytest.mark.slow
def test_a_stop_during_another_search_keeps_the_curve(at_every_checkpoint, monkeypatch):
    """If a curve bends strongly, courses are searched again; here this always happens."""
    monkeypatch.setattr(improvement, "SLIGHTLY_BENT", 0.0)
    body = shapes.creature(5, resolution=32, faces=1500, subdivisions=1)
    chosen = [20, 250, 600]
    nicmm.design_curve(body, chosen)  # computes what the mesh keeps, which has checkpoints too
    calls = []
    whole = nicmm.design_curve(body, chosen, progress=lambda *_: calls.append(None))
    assert whole.status is nicmm.Status.CONVERGED
    for share in (0.75, 0.95):
        left = iter(range(int(share * len(calls))))
        design = nicmm.design_curve(
            body, chosen, progress=lambda *_, left=left: next(left, None) is not None
        )
        assert design.status is nicmm.Status.CANCELLED
        (curve,) = design.curves
        assert not judge_curve(body, curve, closed=True).faults


@pytest.mark.slow
def test_points_are_those_of_the_mesh_that_was_given(at_every_checkpoint):
    """Far from the origin, faces without area are repaired on a copy about another origin."""
    mesh = nicmm.Mesh(MESHES["caps"].vertices + 1e5, MESHES["caps"].faces)
    seen = []
    nicmm.design_curve(
        mesh, [3, 100, 400, 500], order="shortest", progress=lambda _, curve: seen.append(curve)
    )
    seen = np.concatenate(seen)
    assert len(seen)
    assert (seen >= mesh.vertices.min(axis=0) - 0.1).all()
    assert (seen <= mesh.vertices.max(axis=0) + 0.1).all()


@pytest.mark.slow
def test_points_of_every_stage_lie_near_the_mesh(at_every_checkpoint):
    """Stages run on copies of the mesh in other coordinates, so points must be mapped back."""
    for mesh, chosen in ((shapes.creature(2, faces=400), [3, 70, 150]), (LARGE, [7, 2000, 9000])):
        placed = nicmm.Mesh(mesh.vertices * 3.0 + [50.0, -20.0, 10.0], mesh.faces)
        seen = []
        nicmm.design_curve(
            placed, chosen, order="shortest", progress=lambda _, curve, s=seen: s.append(curve)
        )
        shown = np.concatenate(seen)
        assert len(shown)
        margin = 0.05 * placed.diagonal
        assert (shown >= placed.vertices.min(axis=0) - margin).all()
        assert (shown <= placed.vertices.max(axis=0) + margin).all()


def test_search_trees_can_be_cancelled_and_built_later(at_every_checkpoint, monkeypatch):
    monkeypatch.setattr(mesh_module, "MOST_FACES_PER_TREE", len(LARGE.faces) // 4)
    mesh = nicmm.Mesh(LARGE.vertices, LARGE.faces)
    left = iter(range(2))
    with (
        pytest.raises(CancelledError),
        watched(lambda *_: next(left, None) is not None),
    ):
        _ = mesh.face_trees
    calls = []
    with watched(lambda *_: calls.append(None)):
        assert len(mesh.face_trees) == len(calls) == 4


class TestWatched:
    def test_nobody_watches(self):
        with watched(None), subrange(0.2, 0.4), placed(lambda points: points + 1.0):
            checkpoint(0.5, lambda: 1 / 0)

    def test_parts_of_parts(self, at_every_checkpoint):
        seen = []
        with watched(lambda done, _: seen.append(done)):
            with subrange(0.0, 0.5), subrange(0.5, 1.0):
                checkpoint(0.5)
            checkpoint(0.1)
            checkpoint(1.0)
        np.testing.assert_allclose(seen, [0.0, 0.25, 0.375, 0.375, 1.0])

    def test_points_are_found_only_when_they_are_shown(self, monkeypatch):
        monkeypatch.setattr(progress, "INTERVAL", 1e9)
        found = []
        with watched(lambda *_: None):
            for number in range(5):
                checkpoint(points=lambda number=number: found.append(number) or np.zeros((1, 3)))
        assert found == [0]  # the first curve is shown immediately

    def test_what_was_stopped_stays_stopped(self, at_every_checkpoint):
        calls = []
        with watched(lambda *_: bool(calls.append(1))):
            for _ in range(3):
                with pytest.raises(CancelledError):
                    checkpoint()
        assert len(calls) == 1

    def test_each_thread_has_its_own(self, at_every_checkpoint):
        calls = []
        with watched(lambda *_: calls.append(1)):
            other = threading.Thread(target=checkpoint)
            other.start()
            other.join()
        assert not calls


class TestThreads:
    @pytest.mark.slow
    def test_threads_share_a_designer(self):
        mesh, points = MESHES["fins"], [[3, 100, 400], [7, 200, 300, 500], [20, 90, 450]]
        alone = [nicmm.design_curve(mesh, chosen, order="shortest") for chosen in points]
        designer, found = nicmm.Designer(mesh), {}
        begin = threading.Barrier(len(points))

        def work(number):
            begin.wait()
            found[number] = designer.design(points[number], order="shortest")

        threads = [threading.Thread(target=work, args=(number,)) for number in range(len(points))]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        for number, design in enumerate(alone):
            np.testing.assert_array_equal(found[number].curves[0].points, design.curves[0].points)

    @pytest.mark.slow
    def test_who_waits_for_a_designer_may_stop_waiting(self):
        designer, waits = nicmm.Designer(LARGE), []
        inside, stopped = threading.Event(), threading.Event()

        def hold(fraction, curve):
            inside.set()
            assert stopped.wait(60.0)

        def give_up(fraction, curve):
            return False

        def wait():
            assert inside.wait(60.0)
            waits.append(designer.design([7, 2000, 5000], progress=give_up))
            stopped.set()

        thread = threading.Thread(target=wait)
        thread.start()
        held = designer.design([7, 2000, 9000], progress=hold)
        thread.join()
        assert held.status is nicmm.Status.CONVERGED
        assert waits[0].status is nicmm.Status.CANCELLED and not waits[0].curves
