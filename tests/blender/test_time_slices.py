"""Long work in time slices, and the operators that use it, without a window."""

import threading
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
    """Stands in for the parts of Blender's context that an operator in a window uses."""

    def __init__(self, operators, mesh_object):
        self.events, self.texts, self.timers, self.reports = [], [], [], []
        self.context = SimpleNamespace(
            window=None,
            window_manager=SimpleNamespace(
                event_timer_add=self.add_timer,
                event_timer_remove=self.timers.remove,
                modal_handler_add=self.events.append,
            ),
            workspace=SimpleNamespace(status_text_set=self.texts.append),
            scene=bpy.context.scene,
            view_layer=bpy.context.view_layer,
            active_object=mesh_object,
            selected_objects=[],
            space_data=None,
            mode="OBJECT",
        )

    def add_timer(self, _seconds, window):
        self.timers.append(object())
        return self.timers[-1]


@pytest.fixture
def window(empty_scene, monkeypatch):
    """An operator as a window runs it, without waiting time: background mode sends no events."""
    design_curve = import_module(f"{empty_scene.name}.nicmm_blender.operators.design_curve")
    long_solves = import_module(f"{empty_scene.name}.nicmm_blender.operators.long_solves")
    monkeypatch.setattr(long_solves.preferences, "patience", lambda: 0.0)
    monkeypatch.setattr(long_solves, "LONGEST_TIME_SLICE", 0.0)
    monkeypatch.setattr(long_solves, "answer_all", slow(long_solves.answer_all))
    sphere = scenes.sphere(5)
    scenes.select(sphere, scenes.ring(sphere, 4, height=0.3))
    window = Window(design_curve, sphere)
    window.sphere = sphere
    defaults = {
        name: found.default
        for name, found in bpy.ops.nicmm.design_curve.get_rna_type().properties.items()
        if hasattr(found, "default")
    }

    class Operator(long_solves.LongSolves):
        bl_label = "Design"
        points = point_group = ()
        requests = design_curve.NICMM_OT_design_curve.requests
        _control_points = design_curve.NICMM_OT_design_curve._control_points
        finish = design_curve.NICMM_OT_design_curve.finish

        def __init__(self):
            for name, value in defaults.items():
                if not hasattr(type(self), name):
                    setattr(self, name, value)

        def report(self, kind, message):
            window.reports.append((kind, message))

    window.operator = Operator()
    return window


def slow(answer_all):
    """Wrap `answer_all` so that it reports a partial curve first."""

    def answer(requests, progress):
        for step in range(3):
            line = np.outer(np.arange(4.0), [1.0, 0.0, 0.0])
            if progress(step / 10, line[: step + 1]) is False:
                return None
        return answer_all(requests, progress)

    return answer


def event(kind, value="NOTHING"):
    return SimpleNamespace(type=kind, value=value)


def test_long_solve_shows_progress_and_ends(window):
    operator, context = window.operator, window.context
    assert operator._begin(context) == {"RUNNING_MODAL"}
    assert window.events == [operator] and len(window.timers) == 1
    result = {"PASS_THROUGH"}
    while result == {"PASS_THROUGH"}:
        assert not scenes.curves()
        result = operator.modal(context, event("TIMER"))
    assert result == {"FINISHED"}, window.reports
    assert not window.timers
    assert window.texts[-1] is None
    percents = [text.partition(":")[2].split()[0] for text in window.texts[:-1]]
    assert percents[:3] == ["0%", "10%", "20%"]
    assert all("Esc: Cancel" in text for text in window.texts[:-1])
    (stepped,) = scenes.curves()
    bpy.context.view_layer.objects.active = window.sphere
    bpy.ops.nicmm.design_curve()
    (other,) = set(scenes.curves()) - {stepped}
    np.testing.assert_array_equal(scenes.points(stepped), scenes.points(other))


def test_escape_stops_a_long_solve(window):
    operator, context = window.operator, window.context
    before = threading.active_count()
    operator._begin(context)
    operator.modal(context, event("TIMER"))
    assert operator.modal(context, event("ESC", "PRESS")) == {"CANCELLED"}
    assert threading.active_count() == before
    assert not window.timers and window.texts[-1] is None
    assert not scenes.curves()
    assert window.reports == [({"INFO"}, "Cancelled without changes")]


def test_only_navigation_passes_a_long_solve(window):
    operator, context = window.operator, window.context
    operator._begin(context)
    assert operator.modal(context, event("WHEELUPMOUSE", "PRESS")) == {"PASS_THROUGH"}
    assert operator.modal(context, event("X", "PRESS")) == {"RUNNING_MODAL"}
    operator.cancel(context)


def test_mesh_that_changes_meanwhile_is_reported(window):
    operator, context = window.operator, window.context
    operator._begin(context)
    window.sphere.data.vertices[0].co.x += 0.1
    result = {"PASS_THROUGH"}
    while result == {"PASS_THROUGH"}:
        result = operator.modal(context, event("TIMER"))
    assert result == {"CANCELLED"}
    ((kind, message),) = window.reports
    assert kind == {"ERROR"} and "changed while the curve was being computed" in message
    assert not scenes.curves()


def test_disabling_ends_a_long_solve(window, empty_scene):
    operator, context = window.operator, window.context
    operator._begin(context)
    before = threading.active_count()
    operator.cancel(context)
    assert threading.active_count() == before - 1
    assert not window.timers


def test_short_solve_does_not_wait_for_a_timer(window, monkeypatch):
    long_solves = import_module(window.operator.__class__.__mro__[1].__module__)
    monkeypatch.setattr(long_solves.preferences, "patience", lambda: 600.0)
    assert window.operator._begin(window.context) == {"FINISHED"}
    assert not window.events and not window.texts
    assert len(scenes.curves()) == 1
