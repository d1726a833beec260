"""Long work in time slices, and the operators that use it, without a window."""

import re
import threading
import time
from importlib import import_module
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

import addon_utils

from tests.blender import scenes


@pytest.fixture
def time_slices(extension):
    return import_module(f"{extension.name}.nicmm_blender.operators.time_slices")


def counting(steps, seen, thread=None):
    """A function that reports a number of steps as progress and records the thread of each."""

    def work(progress):
        for step in range(steps):
            seen.append(threading.current_thread().name)
            if not progress(step / steps, np.full((2, 3), float(step))):
                return "stopped"
        return "finished"

    return work


def test_work_runs_only_in_time_slices(time_slices):
    seen = []
    work = time_slices.Work(counting(5, seen))
    assert not seen
    for step in range(5):
        assert not work.run_slice(0.0)
        assert len(seen) == step + 1
        assert work.fraction == step / 5
        np.testing.assert_array_equal(work.polyline, np.full((2, 3), float(step)))
    assert work.run_slice(0.0)
    assert work.result() == "finished"
    assert set(seen) == {"nicmm"}


def test_short_work_is_done_in_the_first_time_slice(time_slices):
    work = time_slices.Work(counting(5, []))
    assert work.run_slice(60.0)
    assert work.result() == "finished"


def test_cancelled_work_leaves_no_thread(time_slices):
    before = threading.active_count()
    seen = []
    work = time_slices.Work(counting(100, seen))
    work.run_slice(0.0)
    assert threading.active_count() == before + 1
    work.cancel()
    assert threading.active_count() == before
    assert work.result() == "stopped"
    assert len(seen) == 1
    time_slices.Work(counting(1, seen)).cancel()  # cancelled before its first time slice
    assert len(seen) == 1


def test_errors_come_to_the_caller(time_slices):
    def work(progress):
        progress(0.5, np.zeros((0, 3)))
        raise ValueError("broken")

    failing = time_slices.Work(work)
    failing.run_slice(0.0)
    assert failing.run_slice(0.0)
    with pytest.raises(ValueError, match="broken"):
        failing.result()


@pytest.mark.slow
def test_disabling_ends_what_is_parked(empty_scene, time_slices):
    before = threading.active_count()
    parked = [time_slices.Work(counting(9, [])) for _ in range(3)]
    for work in parked:
        work.run_slice(0.0)
    addon_utils.disable(empty_scene.name, default_set=True)
    try:
        assert threading.active_count() == before
        assert all(work.done for work in parked)
    finally:
        addon_utils.enable(empty_scene.name, default_set=True)


class Window:
    """Stands in for a window, which background mode lacks, and runs an operator in it.

    `reports`, `texts` and `timers` are what the operator has reported, shown in the status bar and
    not yet removed.
    """

    def __init__(self, operator_type):
        self.texts, self.timers, self.reports, self.handlers = [], [], [], []
        self.context = SimpleNamespace(
            window=None,
            window_manager=SimpleNamespace(
                event_timer_add=self.add_timer,
                event_timer_remove=self.timers.remove,
                modal_handler_add=self.handlers.append,
            ),
            workspace=SimpleNamespace(status_text_set=self.texts.append),
            mode="OBJECT",
        )

        window = self

        class Operator(operator_type):
            bl_label = "Design"

            def report(self, kind, message):
                window.reports.append((kind, message))

        self.operator = Operator()

    def add_timer(self, _seconds, window):
        self.timers.append(object())
        return self.timers[-1]

    def send(self, kind, value="NOTHING"):
        """Send an event to the operator; return what it returns."""
        return self.operator.modal(self.context, SimpleNamespace(type=kind, value=value))

    def finish(self):
        """Send timer events until the operator ends."""
        result = {"PASS_THROUGH"}
        while result == {"PASS_THROUGH"}:
            result = self.send("TIMER")
        return result


def preferences(extension):
    return bpy.context.preferences.addons[extension.name].preferences


@pytest.fixture
def no_patience(empty_scene):
    """Work continues in time slices at once."""
    preferences(empty_scene).patience = 0.0
    yield
    preferences(empty_scene).property_unset("patience")


STEPS = 4


@pytest.fixture
def counter(empty_scene, no_patience):
    """A window with an operator whose work takes several time slices."""
    base = scenes.module(empty_scene, "operators.sliced_operator").SlicedOperator

    class Counter(base):
        def begin(self, context):
            def work(progress):
                for step in range(STEPS):
                    time.sleep(0.04)
                    if not progress(step / STEPS, np.zeros((0, 3))):
                        return None
                return "counted"

            return self.work_on(context, work)

        def progress_text(self):
            return f"{self._work.fraction}"

        def done(self, _context, result):
            self.report({"INFO"}, result)
            return {"FINISHED"}

    return Window(Counter)


def test_long_work_shows_progress_and_ends(counter):
    assert counter.operator.begin(counter.context) == {"RUNNING_MODAL"}
    assert counter.handlers == [counter.operator] and len(counter.timers) == 1
    assert counter.finish() == {"FINISHED"}
    assert counter.reports == [({"INFO"}, "counted")]
    assert not counter.timers
    assert counter.texts.pop() is None
    assert counter.texts == [f"Design: {step / STEPS}   |   Esc: Cancel" for step in range(STEPS)]


def test_escape_stops_long_work(counter):
    before = threading.active_count()
    counter.operator.begin(counter.context)
    counter.send("TIMER")
    assert counter.send("ESC", "PRESS") == {"CANCELLED"}
    assert threading.active_count() == before
    assert not counter.timers and counter.texts[-1] is None
    assert counter.reports == [({"INFO"}, "Cancelled without changes")]
    assert not vars(counter.operator)


def test_only_navigation_passes_long_work(counter):
    counter.operator.begin(counter.context)
    assert counter.send("WHEELUPMOUSE", "PRESS") == {"PASS_THROUGH"}
    assert counter.send("X", "PRESS") == {"RUNNING_MODAL"}
    counter.operator.cancel(counter.context)


def test_cancelling_ends_long_work(counter):
    """Blender cancels operators when it opens another file or quits."""
    counter.operator.begin(counter.context)
    before = threading.active_count()
    counter.operator.cancel(counter.context)
    assert threading.active_count() == before - 1
    assert not counter.timers and not counter.reports


def test_short_work_does_not_wait_for_a_timer(counter, empty_scene):
    preferences(empty_scene).patience = 10.0
    assert counter.operator.begin(counter.context) == {"FINISHED"}
    assert not counter.handlers and not counter.texts


@pytest.fixture
def preparing(empty_scene, no_patience, monkeypatch):
    """A window with an operator that prepares a sphere for clicks, a search tree per time slice."""
    core = scenes.installed_core().__name__
    monkeypatch.setattr(import_module(f"{core}.geometry.mesh"), "MOST_FACES_PER_TREE", 300)
    monkeypatch.setattr(import_module(f"{core}.progress"), "INTERVAL", 0.0)
    monkeypatch.setattr(
        scenes.module(empty_scene, "operators.sliced_operator"), "LONGEST_TIME_SLICE", 0.0
    )
    base = scenes.module(empty_scene, "operators.sliced_operator").SlicedOperator
    cache = scenes.module(empty_scene, "scene.surface_cache")
    surface = cache.get(scenes.sphere(4), True)  # 1,280 faces

    class Preparing(base):
        def begin(self, context):
            return self.work_on(context, lambda progress: cache.prepare(surface, progress))

        def progress_text(self):
            return "Preparing"

        def done(self, _context, result):
            return {"FINISHED"}

    window = Window(Preparing)
    window.is_prepared = lambda: cache.is_prepared(surface)
    return window


def test_a_mesh_is_prepared_in_time_slices(preparing):
    assert preparing.operator.begin(preparing.context) == {"RUNNING_MODAL"}
    assert not preparing.is_prepared()
    assert preparing.finish() == {"FINISHED"}
    assert preparing.is_prepared()
    assert len(preparing.texts) == 6  # a tree of 300 faces each, and the end


def test_escape_stops_the_preparation_of_a_mesh(preparing):
    before = threading.active_count()
    preparing.operator.begin(preparing.context)
    preparing.send("TIMER")
    assert preparing.send("ESC", "PRESS") == {"CANCELLED"}
    assert threading.active_count() == before
    assert not preparing.is_prepared()
    preparing.operator.begin(preparing.context)
    assert preparing.finish() == {"FINISHED"}
    assert preparing.is_prepared()


@pytest.fixture
def drawing(empty_scene, no_patience):
    """A window with an operator that designs a curve on a sphere and shows its length."""
    solves = scenes.module(empty_scene, "operators.long_solves").LongSolves
    request = scenes.module(empty_scene, "scene.design_request")
    record = scenes.module(empty_scene, "scene.curve_record")
    surface = scenes.module(empty_scene, "scene.surface")
    sphere = scenes.sphere(5)

    class Drawing(solves):
        def requests(self, _context):
            # A curve that bends so strongly that its design takes several time slices.
            points = np.random.default_rng(1).choice(len(sphere.data.vertices), 7, replace=False)
            read, settings = surface.read(sphere, True), record.CurveSettings()
            return [request.for_points(sphere, read, points, "given", settings)]

        def finish(self, _context, requests, answers):
            (answer,) = answers
            self.report({"INFO"}, f"{answer.curves[0].length:.12f}")
            return {"FINISHED"}

    window = Window(Drawing)
    window.sphere = sphere
    return window


@pytest.mark.slow
def test_a_curve_is_the_same_in_time_slices(drawing, empty_scene):
    operator, context = drawing.operator, drawing.context
    assert operator.answer(context, operator.requests(context)) == {"RUNNING_MODAL"}
    assert drawing.finish() == {"FINISHED"}
    assert all(
        re.fullmatch(r"Design: \d+%   \|   Esc: Cancel", text) for text in drawing.texts[:-1]
    )
    preferences(empty_scene).patience = 10.0
    assert operator.answer(context, operator.requests(context)) == {"FINISHED"}
    assert drawing.reports[0] == drawing.reports[1]
    assert not drawing.timers and not vars(operator)


@pytest.mark.slow
def test_mesh_that_changes_meanwhile_is_reported(drawing):
    operator, context = drawing.operator, drawing.context
    operator.answer(context, operator.requests(context))
    drawing.sphere.data.vertices[0].co.x += 0.1
    assert drawing.finish() == {"CANCELLED"}
    ((kind, message),) = drawing.reports
    assert kind == {"ERROR"} and "changed while the curve was being computed" in message


@pytest.fixture
def following(empty_scene, no_patience, monkeypatch):
    """A window with an operator that fits points to a stroke on a sphere, then designs a curve."""
    core = scenes.installed_core().__name__
    monkeypatch.setattr(import_module(f"{core}.progress"), "INTERVAL", 0.0)
    operators = scenes.module(empty_scene, "tool.stroke_operators")
    edited_curve = scenes.module(empty_scene, "outputs.edited_curve")
    scenes.sphere(4)
    opened = edited_curve.open_new(bpy.context)
    angle = np.linspace(0.0, 2.0, 100)
    stroke = np.stack([np.cos(angle), np.sin(angle), 0.2 * np.sin(3.0 * angle)], axis=1)
    stroke /= np.linalg.norm(stroke, axis=1, keepdims=True)
    stroke = stroke @ opened.surface.local_to_core.T

    class Following(operators._FollowsLine):
        def open_curve(self, _context):
            return opened

        def search(self, opened):
            return lambda progress: (
                edited_curve.points_along(opened, stroke, 0.05, False, progress),
                False,
            )

        def finish(self, _context, _requests, answers):
            (answer,) = answers
            self.report({"INFO"}, f"{len(self._edited.points)} {answer.curves[0].length:.9f}")
            return {"FINISHED"}

    return Window(Following)


@pytest.mark.slow
def test_a_stroke_is_fitted_in_time_slices(following, empty_scene):
    assert following.operator._begin(following.context) == {"RUNNING_MODAL"}
    assert following.finish() == {"FINISHED"}  # the fit has designed the curve already
    assert following.handlers == [following.operator] and not following.timers
    preferences(empty_scene).patience = 10.0
    assert following.operator._begin(following.context) == {"FINISHED"}
    assert following.reports[0] == following.reports[1]
    assert int(following.reports[0][1].split()[0]) < 10


def test_escape_stops_the_fit_of_a_stroke(following):
    before = threading.active_count()
    following.operator._begin(following.context)
    following.send("TIMER")
    assert following.send("ESC", "PRESS") == {"CANCELLED"}
    assert threading.active_count() == before
    assert not following.timers and not vars(following.operator)
