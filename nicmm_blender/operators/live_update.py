# SPDX-License-Identifier: GPL-3.0-or-later
"""Updates curves when the surface that they lie on, or a weight that they use, changes.

Blender's handlers only record which objects have changed, in any mode. Once nothing has changed for
the delay set in the preferences, a timer compares the digest that each curve was designed with to
the current one (`curve_record.digest`) and designs the outdated curves again, in time slices.
Neither reading a surface nor writing a curve changes a mesh object, and undo restores a curve
together with its digest, so an update never triggers another one.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import bpy
from bpy.app.handlers import persistent
from bpy.props import BoolProperty

from .. import preferences
from ..outputs import writing
from ..scene import avoided_curves, curve_order, curve_record, design_request
from ..scene.design_request import DesignRequest
from ..scene.messages import InputError
from ..scene.surface import Surface, read
from ..scene.viewports import redraw
from . import time_slices
from .answers import answer_all
from .sliced_operator import TIME_SLICE

if TYPE_CHECKING:
    from ..scene.design_request import Answer

PAUSE = 0.01
"""Seconds between two time slices, in which Blender handles events."""

WAIT = 0.1
"""Seconds until the next check whether work may begin or continue."""


@dataclass(frozen=True)
class _Failure:
    """Why a curve could not be updated.

    Attributes
    ----------
    digest : str
        Digest of the surface and weights that the curve could not be updated to.
    designed_with : str
        Digest that the curve had been designed with; the failure is out of date once it differs.
    message : str
    """

    digest: str
    designed_with: str
    message: str


class _Updates:
    """Recorded changes and work in progress. Holds no Blender objects, since undo replaces them."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Discard all recorded changes and all work."""
        self.changed: set[int] = set()  # session_uids of mesh objects
        self.everything = False
        self.last_change = 0.0
        self.work: time_slices.Work[list[Answer]] | None = None
        self.requests: list[DesignRequest] = []
        self.curves: list[tuple[int, str]] = []  # session_uid and digest, for each request
        self.failed: dict[int, _Failure] = {}  # by the session_uid of the curve
        self.n_objects: dict[str, int] = {}  # by the name of the scene
        self.is_reading = False

    def note(self, objects: set[int], everything: bool = False) -> None:
        """Record a change and start the timer."""
        self.changed |= objects
        self.everything |= everything
        self.last_change = time.monotonic()
        if not bpy.app.timers.is_registered(tick):
            bpy.app.timers.register(tick, first_interval=preferences.live_delay())

    def stop(self) -> None:
        """Cancel the work in progress."""
        if self.work is not None:
            self.work.cancel()
        self.work, self.requests, self.curves = None, [], []


_updates = _Updates()


def tick(seconds: float = TIME_SLICE) -> float | None:
    """Work for about so many seconds; return those until the next call, or None if all is done."""
    if not _live_scenes():
        _updates.stop()
        return None
    if _updates.changed or _updates.everything:
        _updates.stop()
        remaining = _updates.last_change + preferences.live_delay() - time.monotonic()
        if remaining > 0.0 or _has_to_wait():
            return max(remaining, WAIT)
        _begin()
    if _updates.work is not None:
        if _has_to_wait():
            return WAIT
        if not _updates.work.run_slice(seconds):
            return PAUSE
        _write(_updates.work)
    return PAUSE if _updates.changed or _updates.everything else None


def messages(mesh_object: bpy.types.Object) -> list[str]:
    """Messages about the curves on a mesh that could not be updated."""
    if not _live_scenes():
        return []
    return [
        failure.message
        for each in curve_record.designed_on(mesh_object)
        if (failure := _updates.failed.get(each.session_uid)) is not None
        and failure.designed_with == curve_record.digest_of(each)
    ]


def _begin() -> None:
    """Start work on the outdated curves."""
    changed, everything = _updates.changed, _updates.everything
    _updates.changed, _updates.everything = set(), False
    read_once = cache(read)  # several curves may lie on the same surface
    with _unnoticed():
        for designed in _live_curves():
            mesh_object = curve_record.mesh_of(designed)
            if mesh_object is not None and (everything or mesh_object.session_uid in changed):
                _add_request(designed, mesh_object, read_once)
    if _updates.requests:
        requests = _updates.requests
        _updates.work = time_slices.Work(lambda progress: answer_all(requests, progress))


@contextmanager
def _unnoticed() -> Iterator[None]:
    """Ignore changes inside the block: reading surfaces makes and removes temporary objects."""
    bpy.context.view_layer.update()  # report pending changes of the user before ignoring any
    _updates.is_reading = True
    try:
        yield
        bpy.context.view_layer.update()
    finally:
        _updates.is_reading = False


def _add_request(
    designed: bpy.types.Object,
    mesh_object: bpy.types.Object,
    read_once: Callable[..., Surface],
) -> None:
    """Add a request for a curve if it is outdated; `read_once` is a cached `surface.read`."""
    from ... import nicmm_core as nicmm

    uid = designed.session_uid
    now = ""
    try:
        settings = curve_record.settings_of(designed)
        if not curve_record.has_curve(designed):  # a drawing with too few points
            return
        surface = read_once(mesh_object, settings.use_modifiers, traced=False)
        others = avoided_curves.above(designed, mesh_object, surface, settings)
        now = curve_record.digest(mesh_object, surface, settings, others)
        updated = {uid for uid, _ in _updates.curves}
        follows = any(other.uid in updated for other in others)
        if curve_record.is_current(designed, now) and not follows:
            _updates.failed.pop(uid, None)
            return
        if uid in _updates.failed and _updates.failed[uid].digest == now and not follows:
            return
        writing.check_replaceable(designed)
        traced = read_once(mesh_object, settings.use_modifiers)
        request = design_request.for_curve(designed, mesh_object, traced, settings)
    except (InputError, nicmm.NicmmError) as error:
        _note_failure(designed, now, error)
        return
    _updates.requests.append(request)
    _updates.curves.append((uid, curve_record.digest_of(designed)))


def _write(work: time_slices.Work[list[Answer]]) -> None:
    """Write the new curves into their objects."""
    from ... import nicmm_core as nicmm

    answers = work.result()
    requests = design_request.resolved(_updates.requests, answers)
    curves = _updates.curves
    _updates.work, _updates.requests, _updates.curves = None, [], []
    objects = {found.session_uid: found for found in bpy.data.objects}
    for request, (uid, before), answer in zip(requests, curves, answers, strict=True):
        designed, mesh_object = objects.get(uid), request.mesh_object()
        if designed is None or mesh_object is None:
            continue
        if curve_record.digest_of(designed) != before:  # the user has changed the curve meanwhile
            _updates.note({mesh_object.session_uid})
            continue
        _updates.failed.pop(uid, None)
        now = ""
        try:
            now = curve_record.digest(
                mesh_object, request.surface, request.settings, request.others
            )
            writing.check_replaceable(designed)
            request.check_unchanged()
            writing.replace(designed, request, answer)
        except (InputError, nicmm.NicmmError) as error:
            _note_failure(designed, now, error)


def _note_failure(designed: bpy.types.Object, digest: str, error: Exception) -> None:
    """Record why a curve could not be updated, and show it in the sidebar."""
    _updates.failed[designed.session_uid] = _Failure(
        digest, curve_record.digest_of(designed), f"{designed.name}: {error}"
    )
    redraw()


def _has_to_wait() -> bool:
    """Whether updates have to wait for a render, playback or a modal operator of the extension."""
    if _plays() and not any(scene.nicmm_live_playback for scene in _live_scenes()):
        return True
    running = (
        operator.bl_idname
        for window in bpy.context.window_manager.windows
        for operator in window.modal_operators
    )
    return bpy.app.is_job_running("RENDER") or any(name.startswith("NICMM") for name in running)


def _plays() -> bool:
    """Whether an animation is playing in any window."""
    return any(window.screen.is_animation_playing for window in bpy.context.window_manager.windows)


def _live_scenes() -> list[bpy.types.Scene]:
    return [scene for scene in bpy.data.scenes if scene.nicmm_live_update]


def _live_curves() -> list[bpy.types.Object]:
    found = {designed for scene in _live_scenes() for designed in scene.objects}
    designed = [each for each in found if curve_record.has_record(each)]
    return sorted(designed, key=curve_order.position_of)


@persistent
def note_changes(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    """Record changed mesh objects after an update of the dependency graph.

    In Sculpt Mode changes of shading count too, because Blender reports strokes as such.
    """
    if not scene.nicmm_live_update or _updates.is_reading:
        return
    objects = {
        update.id.original.session_uid
        for update in depsgraph.updates
        if isinstance(update.id, bpy.types.Object)
        and update.id.type == "MESH"
        and (
            update.is_updated_geometry
            or update.is_updated_transform  # a curve depends on the object's scale
            or (update.is_updated_shading and update.id.mode == "SCULPT")
        )
    }
    # Blender does not report which object was deleted; it may be a curve that others avoid.
    count = len(scene.objects)
    has_other_objects = _updates.n_objects.get(scene.name, count) != count
    _updates.n_objects[scene.name] = count
    if objects or has_other_objects:
        _updates.note(objects, everything=has_other_objects)


@persistent
def note_frame(scene: bpy.types.Scene, _depsgraph: bpy.types.Depsgraph | None = None) -> None:
    """Check all curves after a frame change, but not during a render."""
    if scene.nicmm_live_update and not bpy.app.is_job_running("RENDER"):
        _updates.note(set(), everything=True)


@persistent
def note_other_state(*_arguments: object) -> None:
    """Check all curves after undo, redo, or opening a file."""
    _updates.stop()
    if _live_scenes():
        _updates.note(set(), everything=True)


@persistent
def forget(*_arguments: object) -> None:
    """Drop all state before another file is opened."""
    _updates.stop()
    _updates.reset()


def _switched(_scene: bpy.types.Scene, _context: bpy.types.Context) -> None:
    note_other_state()


HANDLERS = (
    ("depsgraph_update_post", note_changes),
    ("frame_change_post", note_frame),
    ("undo_post", note_other_state),
    ("redo_post", note_other_state),
    ("load_pre", forget),
    ("load_post", note_other_state),
)


def register() -> None:
    bpy.types.Scene.nicmm_live_update = BoolProperty(
        name="Live Update",
        description="Update the curves of this scene automatically when their surface or the "
        "weights that they use change, in any mode and after frame changes",
        default=False,
        options=set(),
        update=_switched,
    )
    bpy.types.Scene.nicmm_live_playback = BoolProperty(
        name="During Playback",
        description="Also update curves during animation playback. If disabled, curves are updated "
        "when it stops",
        default=False,
        options=set(),
        update=_switched,
    )
    for name, function in HANDLERS:
        getattr(bpy.app.handlers, name).append(function)


def unregister() -> None:
    forget()
    if bpy.app.timers.is_registered(tick):
        bpy.app.timers.unregister(tick)
    for name, function in HANDLERS:
        getattr(bpy.app.handlers, name).remove(function)
    del bpy.types.Scene.nicmm_live_playback
    del bpy.types.Scene.nicmm_live_update
