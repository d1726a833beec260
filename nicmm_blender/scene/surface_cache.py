# SPDX-License-Identifier: GPL-3.0-or-later
"""Caches the surfaces of mesh objects, and what the core has computed for them.

Blender reports every change of an object; the surface of a changed object is dropped. What the core
has computed is stored by the fingerprint of the surface, so it cannot become outdated, and the redo
panel, which undoes a design and repeats it, finds it again. It consists of the designer with its
factorisations and the latest designs: an update that starts from a design, and not only from its
curve, knows the weights of before and moves the curve only near those that have changed.

Reading a surface makes temporary objects, which Blender does not allow while it draws, or while it
asks gizmos about the mouse. Code that runs then gets a surface from the cache, or has it read soon.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np
from bpy.app.handlers import persistent

from .. import preferences
from .lookup import by_uid
from .messages import InputError
from .surface import Surface, read
from .viewports import redraw

if TYPE_CHECKING:
    from ...nicmm_core import Design, Designer, Mesh, SurfaceCurve
    from ...nicmm_core.geometry.mirror import Plane
    from ...nicmm_core.geometry.plane_section import PlaneSection
    from ...nicmm_core.progress import Progress

MOST_SURFACES = 4
"""Maximum number of surfaces in the cache."""

MOST_DESIGNS = 32
"""Maximum number of designs that are stored for a surface."""

FEW_FACES = 100_000
"""Faces up to which a mesh is read immediately, in about a tenth of a second."""

DELAY = 0.3
"""Seconds until a larger mesh is read, so that several undo steps in a row cause one reading."""

SAME_COORDINATES = 1e-12
"""Difference of barycentric coordinates up to which two curves are the same."""


@dataclass
class _Computed:
    """What the core has computed for a surface.

    Attributes
    ----------
    designer : Designer of the core
        Contains the core's mesh.
    designs : list of Design
        The latest designs, the oldest first.
    is_busy : bool
        Whether the designer is working in time slices.
    section : (bytes, PlaneSection) or None
        The last section with the plane of a mirror, and that plane.
    """

    designer: Designer
    designs: list[Design] = field(default_factory=list)
    is_busy: bool = False
    section: tuple[bytes, PlaneSection] | None = None


class _Cache:
    """The cache; everything in it belongs to the current file.

    Attributes
    ----------
    surfaces : dict
        Surfaces by session_uid and mode of the mesh object, and use of modifiers.
    computed : dict
        `_Computed` by the fingerprint of the surface, the most recently used one last.
    read : set
        The session_uids of all objects that have been read.
    wanted : set
        Surfaces to read soon: session_uid of the mesh object, and use of modifiers.
    failed : dict
        The number of changes at which the reading of a wanted surface failed.
    changes : int
        Number of changes that may affect a surface or a designed curve.
    """

    def __init__(self) -> None:
        self.changes = 0
        self.clear()

    def clear(self) -> None:
        """Drop everything."""
        self.surfaces: dict[tuple[int, str, bool], Surface] = {}
        self.computed: dict[bytes, _Computed] = {}
        self.read: set[int] = set()
        self.wanted: set[tuple[int, bool]] = set()
        self.failed: dict[tuple[int, bool], int] = {}
        self.changes += 1


_cache = _Cache()


def changes() -> int:
    """A counter that increases whenever a mesh or a designed curve may have changed."""
    return _cache.changes


def note_change() -> None:
    """Record that a designed curve has changed."""
    _cache.changes += 1


# Surfaces


def cached(mesh_object: bpy.types.Object, use_modifiers: bool) -> Surface | None:
    """The surface of an object if it has been read since the object's last change, or None."""
    return _cache.surfaces.get(_key(mesh_object, use_modifiers))


def get(mesh_object: bpy.types.Object, use_modifiers: bool) -> Surface:
    """The surface of an object, read again only if the object has changed."""
    found = cached(mesh_object, use_modifiers)
    if found is None:
        found = read(mesh_object, use_modifiers)
        bpy.context.view_layer.update()  # handles the reports caused by reading itself
        _cache.surfaces[_key(mesh_object, use_modifiers)] = found
        _drop_oldest(_cache.surfaces, MOST_SURFACES)
        _cache.read.add(mesh_object.session_uid)
    return found


def cached_or_soon(mesh_object: bpy.types.Object, use_modifiers: bool) -> Surface | None:
    """The surface of an object if it is in the cache; if not, it is read soon.

    A large mesh is read only if it was read before: the user waits for that at the first click.
    """
    found = cached(mesh_object, use_modifiers)
    if found is None:
        few = _has_few_faces(mesh_object)
        if few or mesh_object.session_uid in _cache.read:
            _want((mesh_object.session_uid, use_modifiers), 0.0 if few else DELAY)
    return found


def _key(mesh_object: bpy.types.Object, use_modifiers: bool) -> tuple[int, str, bool]:
    return mesh_object.session_uid, mesh_object.mode, use_modifiers


def _drop_oldest(entries: dict[Any, Any], most: int) -> None:
    while len(entries) > most:
        del entries[next(iter(entries))]


def _has_few_faces(mesh_object: bpy.types.Object) -> bool:
    """Whether reading the surface of an object is fast."""
    evaluated = mesh_object.evaluated_get(bpy.context.evaluated_depsgraph_get())
    return len(evaluated.data.polygons) <= FEW_FACES and not any(
        modifier.show_viewport and modifier.type in {"SUBSURF", "MULTIRES"} and modifier.levels > 2
        for modifier in mesh_object.modifiers
        if hasattr(modifier, "levels")
    )


def _want(wanted: tuple[int, bool], delay: float) -> None:
    """Read a surface after a delay, unless that has failed and nothing has changed since."""
    if _cache.failed.get(wanted) == _cache.changes:
        return
    _cache.wanted.add(wanted)
    if not bpy.app.timers.is_registered(_read_wanted):
        bpy.app.timers.register(_read_wanted, first_interval=delay)


def _read_wanted() -> float | None:
    if bpy.app.is_job_running("RENDER"):
        return DELAY
    wanted = list(_cache.wanted)
    _cache.wanted.clear()
    _cache.failed.clear()
    for uid, use_modifiers in wanted:
        mesh_object = by_uid(uid)
        if mesh_object is None:
            continue
        try:
            get(mesh_object, use_modifiers)
            note_change()  # curves on this surface can be shown now
        except InputError:  # a click reports the error
            bpy.context.view_layer.update()  # so that the reading itself counts as no change
            _cache.failed[uid, use_modifiers] = _cache.changes
    redraw()
    return None


# What the core has computed


def core_mesh(surface: Surface) -> Mesh:
    """The core's mesh of a surface, even while a designer is working on it."""
    return _computed(surface).designer.mesh


@contextmanager
def designer_of(surface: Surface) -> Iterator[Designer]:
    """Yield the designer of a surface, which nobody else uses inside the block.

    A designer computes one curve at a time, so a caller that waited for a designer whose thread is
    blocked would wait forever. Such a designer is replaced by a new one.
    """
    computed = _computed(surface)
    if computed.is_busy:
        computed = _store(surface, _new(surface))
    computed.is_busy = True
    try:
        yield computed.designer
    finally:
        computed.is_busy = False


def store_design(surface: Surface, design: Design) -> None:
    """Store a design and its alternatives if another design may start from them."""
    computed = _computed(surface)
    new = [each for each in (design, *design.alternatives) if each.resumable is not None]
    computed.designs = [*computed.designs, *new][-MOST_DESIGNS:]


def design_of(surface: Surface, curve: SurfaceCurve) -> Design | None:
    """The stored design of a curve, or None."""
    computed = _cache.computed.get(surface.fingerprint)
    for design in reversed(computed.designs if computed is not None else ()):
        if len(design.curves) == 1 and _is_same(design.curves[0], curve):
            return design
    return None


def section_with(surface: Surface, plane: Plane) -> PlaneSection:
    """Where a plane of the core cuts a surface; computed again only for another plane."""
    from ...nicmm_core.geometry.plane_section import plane_section

    computed, key = _computed(surface), plane.point.tobytes() + plane.normal.tobytes()
    if computed.section is None or computed.section[0] != key:
        computed.section = key, plane_section(computed.designer.mesh, plane)
    return computed.section[1]


def is_prepared(surface: Surface) -> bool:
    """Whether a ray can be cast at a surface without building its search trees first."""
    computed = _cache.computed.get(surface.fingerprint)
    return computed is not None and "face_trees" in vars(computed.designer.mesh)


def prepare(surface: Surface, progress: Progress) -> bool:
    """Build the search trees for ray casts; return False if the progress function cancelled it."""
    from ...nicmm_core.progress import CancelledError, watched

    try:
        with watched(progress), designer_of(surface) as designer:
            _ = designer.mesh.face_trees
    except CancelledError:
        return False
    return True


def _computed(surface: Surface) -> _Computed:
    """What was computed for a surface, now the most recently used one."""
    found = _cache.computed.pop(surface.fingerprint, None)
    return _store(surface, _new(surface) if found is None else found)


def _new(surface: Surface) -> _Computed:
    from ... import nicmm_core as nicmm

    return _Computed(nicmm.Designer(nicmm.Mesh(surface.core_positions, surface.faces)))


def _store(surface: Surface, computed: _Computed) -> _Computed:
    _cache.computed[surface.fingerprint] = computed
    _drop_oldest(_cache.computed, preferences.kept_meshes())
    return computed


def _is_same(one: SurfaceCurve, other: SurfaceCurve) -> bool:
    """Whether two curves of the core on the same mesh have the same points."""
    return np.array_equal(one.faces, other.faces) and np.allclose(
        one.barycentric, other.barycentric, rtol=0.0, atol=SAME_COORDINATES
    )


# Changes


@persistent
def note_updates(_scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    """Drop the surfaces of the objects that have changed."""
    for update in depsgraph.updates:
        changed = update.id.original
        if not isinstance(changed, bpy.types.Object):
            continue
        if changed.type in {"CURVE", "CURVES"}:
            _cache.changes += 1
        if changed.type != "MESH":
            continue
        # Blender reports strokes in Sculpt Mode as changes of the shading only.
        sculpted = update.is_updated_shading and changed.mode == "SCULPT"
        if update.is_updated_geometry or update.is_updated_transform or sculpted:
            _drop(changed.session_uid)


def _drop(uid: int) -> None:
    _cache.changes += 1
    for key in [key for key in _cache.surfaces if key[0] == uid]:
        del _cache.surfaces[key]


@persistent
def drop_surfaces(*_arguments: object) -> None:
    """Drop the surfaces of all objects: after undo or redo, or a frame change."""
    _cache.surfaces.clear()
    _cache.changes += 1


@persistent
def forget(*_arguments: object) -> None:
    """Drop everything, before another file is opened."""
    _cache.clear()


HANDLERS = (
    ("depsgraph_update_post", note_updates),
    ("frame_change_post", drop_surfaces),
    ("undo_post", drop_surfaces),
    ("redo_post", drop_surfaces),
    ("load_pre", forget),
)


def register() -> None:
    for name, function in HANDLERS:
        getattr(bpy.app.handlers, name).append(function)


def unregister() -> None:
    for name, function in HANDLERS:
        getattr(bpy.app.handlers, name).remove(function)
    if bpy.app.timers.is_registered(_read_wanted):
        bpy.app.timers.unregister(_read_wanted)
    forget()
