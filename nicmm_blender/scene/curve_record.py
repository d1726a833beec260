# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads and writes the record of its design that each curve object stores, also in a saved file.

Each point is stored by the three vertices of its triangle and its barycentric coordinates: vertices
keep their indices when the mesh is moved or deformed, and when the file is opened again. Control
points and via points are stored in the same form, together with the settings, so that the curve can
be edited. On a surface that modifiers generate, each of them is also stored by the face of the cage
that it comes from, because that face stays the same when the subdivision level changes.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import TYPE_CHECKING, Any, TypedDict

import bpy
import numpy as np

from ...nicmm_core.options import COMPOUND_KINDS, OPTIONS, Kind
from . import curve_order, junctions, mesh_data, mirror_plane, record_check, surface_cache
from .cage_trace import CagePoints, identity_trace, to_cage_points, to_surface_points
from .control_points import ControlPoints
from .curve_order import RECORD_KEY
from .junctions import Junction, OtherCurve
from .lookup import is_in, is_in_a_scene
from .messages import InputError, check_finite
from .record_check import Record
from .surface import Surface, group_weights, read
from .via_points import ViaPoints, no_via_points

if TYPE_CHECKING:
    from ...nicmm_core import SurfaceCurve, SurfacePoints
    from ...nicmm_core.options import Option

CONTROL, VIA = "control_", "via_"
"""Beginnings of the names of the fields of control points and of via points."""

KINDS = ("CURVE", "CURVES")
"""Types of the objects that may have a record."""

VERSION = 6
"""Version of the record's format. That of release 1.0.0 is 6; no release wrote an earlier one."""

SAME_PLACE = 1e-5
"""Distance, in diagonals of the mesh, up to which a control point counts as not moved."""

DIGEST_KEY = "nicmm_designed_on"
"""Custom property of the object's data that holds the digest at the time of the design."""


class Drawn(TypedDict):
    """How a curve is drawn."""

    spline: str
    offset: float


def identifier(name: str) -> str:
    """The Blender identifier of one of the core's choices."""
    return name.upper().replace("-", "_")


def property_name(option: Option) -> str:
    """The name of the Blender property for a core option; for weights it names a vertex group."""
    return f"{option.name.removesuffix('s')}_group" if option.kind is Kind.WEIGHTS else option.name


NEW_CURVE_OPTIONS = ("order", "alternatives")
"""Options that matter only once, since control points are stored in the order visited."""

RECORDED = tuple(
    option
    for option in OPTIONS
    if option.kind not in COMPOUND_KINDS and option.name not in NEW_CURVE_OPTIONS
)
"""Options that a record stores."""


@dataclass(frozen=True)
class CurveSettings:
    """The settings of a curve, besides its control points: `RECORDED` and those of Blender."""

    closed: bool = True
    method: str = "ELASTIC"
    smoothness: float = 1.0
    normal_bending: float = 0.0
    obstacle_group: str = ""
    clearance: float = 0.0
    alignment_group: str = ""
    avoid_others: bool = False
    use_modifiers: bool = True
    mirror_axis: str = mirror_plane.NONE
    mirror_as: str = mirror_plane.JOINED

    @property
    def avoids(self) -> bool:
        """Whether the curve avoids the curves above it, which only one method can."""
        return self.avoid_others and self.method == "ELASTIC"

    def __post_init__(self) -> None:
        """Raise an error if a setting is NaN or infinite."""
        for name, value in asdict(self).items():
            check_finite(name, value)

    def with_value(self, name: str, value: bool | float | str) -> CurveSettings:
        """A copy with another value of the setting with a name."""
        changed: dict[str, Any] = {name: value}
        return replace(self, **changed)


def groups_of(settings: CurveSettings) -> list[str]:
    """Names of the vertex groups that a curve depends on; an empty name means none."""
    names = [property_name(option) for option in RECORDED if option.kind is Kind.WEIGHTS]
    return [getattr(settings, name) for name in names]


def arguments_of(
    settings: CurveSettings, weights: Callable[[str], np.ndarray | None]
) -> dict[str, Any]:
    """Settings as keyword arguments for the core.

    `weights` is a function from the name of a vertex group to its weights, and from "" to None.
    """
    values = {}
    for option in RECORDED:
        value = getattr(settings, property_name(option))
        if option.kind is Kind.WEIGHTS:
            value = weights(value)
        elif option.kind is Kind.CHOICE:
            value = value.lower().replace("_", "-")
        values[option.name] = value
    for option in RECORDED:
        is_of_no_use = option.elastic_only and settings.method != "ELASTIC"
        given = [name for name in option.needs if values.get(name) is not None]
        lacks = option.needs and not given and not (settings.avoids and "avoid" in option.needs)
        if is_of_no_use or lacks:
            values[option.name] = option.default
    return values


def settings_from(properties: bpy.types.Operator | bpy.types.PropertyGroup) -> CurveSettings:
    """The settings of a curve from the properties of an operator or the scene."""
    return CurveSettings(
        **{field.name: getattr(properties, field.name) for field in fields(CurveSettings)}
    )


def write_record(
    curve_object: bpy.types.Object,
    mesh_object: bpy.types.Object,
    surface: Surface,
    curves: list[SurfaceCurve],
    settings: CurveSettings,
    drawn: Drawn,
    corners: np.ndarray,
    controls: SurfacePoints | None = None,
    via: ViaPoints | None = None,
    others: Sequence[OtherCurve] = (),
) -> None:
    """Store the positions of curves on the mesh, their settings and how they are drawn.

    Parameters
    ----------
    curve_object : bpy.types.Object
        Object that gets the record.
    mesh_object : bpy.types.Object
        Mesh object that the curves lie on.
    surface : Surface
        Its surface.
    curves : list of SurfaceCurve
        The curves; empty for a drawing that has too few points.
    settings : CurveSettings
        Settings of the curves.
    drawn : dict
        Spline type and offset of the drawing.
    corners : (k,) bool array
        Whether each control point is a corner.
    controls : SurfacePoints, optional
        Control points; by default those of the curves.
    via : ViaPoints, optional
        Via points; by default none.
    others : sequence of OtherCurve
        The curves that it was designed to avoid; control points on them are junctions.
    """
    if controls is None:
        controls = _control_points_of(curves)
    curve_object[RECORD_KEY] = {
        "version": VERSION,
        curve_order.RANK: _rank_of(curve_object, mesh_object),
        "mesh": mesh_object,
        "cage": [] if surface.cage is None else list(surface.cage.sizes),
        "faces": surface.faces_digest,
        "triangles": surface.triangles_digest,
        "vertices": len(surface.local_positions),
        **_curves_to_store(surface, curves),
        **_points_to_store(CONTROL, surface, controls.faces, controls.barycentric),
        **_via_points_to_store(surface, via),
        "corner_points": corners.astype(int).tolist(),
        **_junctions_to_store(surface, controls, others),
        "asked": asdict(settings),
        "drawn": drawn,
    }
    # Stored in the same data-block as the points, so that undo restores both together.
    curve_object.data[DIGEST_KEY] = digest(mesh_object, surface, settings, others)
    surface_cache.note_change()


def _curves_to_store(surface: Surface, curves: list[SurfaceCurve]) -> dict[str, list[float]]:
    """Curves as a record stores them."""
    return {
        "counts": [len(curve.faces) for curve in curves],
        "closed": [int(curve.closed) for curve in curves],
        "corners": _flat([surface.faces[curve.faces] for curve in curves]),
        "barycentric": _flat([curve.barycentric for curve in curves]),
        "control_counts": [len(curve.control_index) for curve in curves],
        "control_index": _flat([curve.control_index for curve in curves]),
    }


def _via_points_to_store(surface: Surface, via: ViaPoints | None) -> dict[str, list[float]]:
    """Via points as a record stores them; an empty dict without any."""
    if via is None or not len(via):
        return {}
    points = _points_to_store(VIA, surface, via.points.faces, via.points.barycentric)
    return {"via_legs": via.legs.tolist(), **points}


def _rank_of(curve_object: bpy.types.Object, mesh_object: bpy.types.Object) -> int:
    """The rank of a curve; that of a new one is below all curves of the mesh."""
    if has_record(curve_object):
        return curve_order.rank_of(curve_object)
    return curve_order.next_rank(designed_on(mesh_object))


def _control_points_of(curves: list[SurfaceCurve]) -> SurfacePoints:
    """The control points that curves pass, as points of the core."""
    from ... import nicmm_core as nicmm

    found = [curve.control_index[curve.control_index >= 0] for curve in curves]
    pairs = list(zip(curves, found, strict=True))
    return nicmm.SurfacePoints(
        np.concatenate([curve.faces[index] for curve, index in pairs]),
        np.concatenate([curve.barycentric[index] for curve, index in pairs]),
    )


def _junctions_to_store(
    surface: Surface, points: SurfacePoints, others: Sequence[OtherCurve]
) -> dict[str, list[dict[str, Any]]]:
    """Control points on other curves as a record stores them; an empty dict without any."""
    if not others:
        return {}
    found = junctions.on_curves(surface_cache.core_mesh(surface), points, others)
    return {"junctions": junctions.to_store(found)} if found else {}


def junctions_of(curve_object: bpy.types.Object) -> list[Junction]:
    """The control points of a curve that lie on other curves."""
    return junctions.of_record(_checked_record(curve_object))


def _points_to_store(
    kind: str, surface: Surface, faces: np.ndarray, barycentric: np.ndarray
) -> dict[str, list[float]]:
    """Points as a record stores them, by names that begin with their kind."""
    values = {
        "corners": surface.faces[faces],
        "barycentric": barycentric,
        "positions": surface.points(faces, barycentric),
    }
    if surface.cage is not None:
        cage_points = to_cage_points(surface, surface.cage, faces, barycentric)
        values |= {"cage_faces": cage_points.faces, "cage_places": cage_points.face_coordinates}
        values["cage_copies"] = cage_points.copies
    return {kind + name: array.ravel().tolist() for name, array in values.items()}


def _flat(arrays: list[np.ndarray]) -> list[float]:
    """The values of arrays, one after another."""
    return [value for array in arrays for value in array.ravel().tolist()]


def digest(
    mesh_object: bpy.types.Object,
    surface: Surface,
    settings: CurveSettings,
    others: Sequence[OtherCurve] = (),
) -> str:
    """A hash of everything that a curve depends on besides its control points.

    `others` are the curves that it avoids; their order does not matter.
    """
    # Digests in saved files must remain valid: leave out a new setting while it has its default.
    found = hashlib.blake2b(repr(settings).encode(), digest_size=16)
    found.update(surface.core_positions.tobytes())
    found.update(surface.faces.tobytes())
    if settings.clearance > 0.0 and surface.unit != 1.0:
        found.update(np.float64(surface.unit).tobytes())
    if (mirror := mirror_plane.mirror_of(mesh_object, surface, settings)) is not None:
        found.update(mirror.argument().tobytes())
    for name in groups_of(settings):
        if name in mesh_object.vertex_groups:
            weights = group_weights(mesh_object, name, surface.with_modifiers)
            found.update(weights.tobytes())
    for each in sorted(junctions.digest_of(other) for other in others):
        found.update(each)
    return found.hexdigest()


def digest_of(curve_object: bpy.types.Object) -> str:
    """The digest that a curve was designed with; empty if it has none."""
    return curve_object.data.get(DIGEST_KEY, "")


def is_current(curve_object: bpy.types.Object, now: str) -> bool:
    """Whether a curve was designed with the digest `now`."""
    return digest_of(curve_object) == now


def _checked_record(curve_object: bpy.types.Object) -> Record:
    """The record of a curve; an error if its version, settings or points cannot be used."""
    record = _record_with_checked_settings(curve_object)
    _refuse(curve_object, record_check.problem_of(record))
    return record


def _record_with_checked_settings(curve_object: bpy.types.Object) -> Record:
    """The record of a curve; an error if its version or settings cannot be used."""
    record = curve_object[RECORD_KEY]
    version = record.get("version")
    if not isinstance(version, int):
        _refuse(curve_object, f"its version is {version!r}")
    if version > VERSION:
        raise InputError(
            f'"{curve_object.name}" was designed by a newer version of NICMM Curves. '
            "Update the extension to use it"
        )
    if version < VERSION:
        raise InputError(
            f'"{curve_object.name}" was designed by a version of NICMM Curves before 1.0.0, which '
            "was never released. Delete it and draw it again"
        )
    _refuse(curve_object, record_check.problem_of_settings(record, CurveSettings))
    return record


def _refuse(curve_object: bpy.types.Object, problem: str) -> None:
    """Raise an error if there is a problem with the record."""
    if problem:
        raise InputError(
            f'The record of "{curve_object.name}" is damaged: {problem}. Undo, or delete the curve '
            "and draw it again"
        )


def has_record(candidate: bpy.types.Object | None) -> bool:
    """Whether an object is a designed curve."""
    if candidate is None or candidate.type not in KINDS or RECORD_KEY not in candidate:
        return False
    return record_check.is_group(candidate[RECORD_KEY])


def number_of_curves(curve_object: bpy.types.Object) -> int:
    """The number of curves in a designed object; 0 for a drawing that has too few points."""
    return len(_checked_record(curve_object)["counts"])


def has_curve(curve_object: bpy.types.Object) -> bool:
    """Whether a designed curve has enough points for a curve."""
    return number_of_curves(curve_object) > 0


def have_same_points(one: bpy.types.Object, other: bpy.types.Object) -> bool:
    """Whether two objects have records of the same curve, as after duplicating one of them."""
    first, second = one[RECORD_KEY], other[RECORD_KEY]
    return all(
        np.array_equal(np.asarray(first.get(name, ())), np.asarray(second.get(name, ())))
        for name in ("corners", "barycentric")
    )


def is_unfinished(curve_object: bpy.types.Object) -> bool:
    """Whether a drawing has too few points for a curve; False if its record is damaged."""
    try:
        return not has_curve(curve_object)
    except InputError:
        return False


def mesh_of(curve_object: bpy.types.Object) -> bpy.types.Object | None:
    """The mesh object that a curve was designed on, or None if it no longer exists."""
    found = curve_object[RECORD_KEY].get("mesh")
    override = getattr(curve_object.parent, "override_library", None)
    if override is not None and override.reference == found:
        return curve_object.parent  # a custom property of an override refers to the linked object
    return found if isinstance(found, bpy.types.Object) and found.type == "MESH" else None


def mesh_in_view_layer(
    context: bpy.types.Context, curve_object: bpy.types.Object
) -> bpy.types.Object:
    """The mesh object that a curve was designed on; an error if it is not in the view layer."""
    found = mesh_of(curve_object)
    if found is not None and is_in(context.view_layer, found):
        return found
    if found is not None and context.scene in found.users_scene:
        raise InputError(
            f'"{found.name}", the mesh of "{curve_object.name}", is excluded from this view layer. '
            "Enable its collection in the Outliner"
        )
    raise _missing_mesh_error(curve_object)


def mesh_in_any_scene(curve_object: bpy.types.Object) -> bpy.types.Object:
    """The mesh object that a curve was designed on; an error if it is in no scene."""
    found = mesh_of(curve_object)
    if found is None or not found.users_scene:
        raise _missing_mesh_error(curve_object)
    return found


def _missing_mesh_error(curve_object: bpy.types.Object) -> InputError:
    return InputError(
        f'The mesh that "{curve_object.name}" was designed on is not in this scene. '
        "Link it to the scene, or draw the curve again"
    )


def mesh_of_context(context: bpy.types.Context) -> bpy.types.Object | None:
    """The active mesh, or the mesh of the active designed curve."""
    active = context.active_object
    if has_record(active):
        return mesh_of(active)
    return mesh_data.mesh_object(context)


def curves_on(context: bpy.types.Context, mesh_object: bpy.types.Object) -> list[bpy.types.Object]:
    """Visible curve objects of the view layer that were designed on a mesh."""
    return [
        found
        for found in context.view_layer.objects
        if has_record(found) and mesh_of(found) == mesh_object and found.visible_get()
    ]


def lines_of(curve_object: bpy.types.Object, surface: Surface) -> list[np.ndarray]:
    """The points of each curve of an object, (n, 3), in the mesh's local space.

    Points whose triangle no longer exists are left out; a closed curve ends with its first point.
    """
    record = _checked_record(curve_object)
    faces, barycentric = _find_points(record, "corners", "barycentric", surface)
    lines = []
    ends = np.cumsum(record["counts"], dtype=np.int64)
    for end, count, closed in zip(ends, record["counts"], record["closed"], strict=True):
        here = np.arange(end - count, end)
        here = here[faces[here] >= 0]
        line = surface.points(faces[here], barycentric[here])
        lines.append(np.concatenate([line, line[:1]]) if closed else line)
    return lines


def lies_on(curve_object: bpy.types.Object, surface: Surface) -> bool:
    """Whether all triangles of a curve still exist; False if it has no curve yet."""
    record = _checked_record(curve_object)
    return len(record["counts"]) > 0 and bool(
        (_find_points(record, "corners", "barycentric", surface)[0] >= 0).all()
    )


def designed_on(mesh_object: bpy.types.Object) -> list[bpy.types.Object]:
    """All curve objects designed on a mesh object, in their order; deleted ones are left out."""
    found = [
        each
        for each in bpy.data.objects
        if has_record(each) and mesh_of(each) == mesh_object and is_in_a_scene(each)
    ]
    return sorted(found, key=curve_order.position_of)


def take_place_of(converted: bpy.types.Object, original: bpy.types.Object) -> None:
    """Give a converted curve the rank of the original curve, and the junctions on it."""
    curve_order.set_rank(converted, curve_order.rank_of(original))
    for each in designed_on(mesh_of(original)):
        if each.library is None:
            junctions.point_to(each[RECORD_KEY], original, converted)


def settings_of(curve_object: bpy.types.Object) -> CurveSettings:
    """The settings of a curve."""
    stored = _record_with_checked_settings(curve_object)["asked"]
    defaults = asdict(CurveSettings())
    return CurveSettings(
        **{name: type(default)(stored.get(name, default)) for name, default in defaults.items()}
    )


def drawn_as(curve_object: bpy.types.Object) -> Drawn:
    """How a curve is drawn."""
    found = _record_with_checked_settings(curve_object)["drawn"]
    return {"spline": found["spline"], "offset": found["offset"]}


def no_curve_message(curve_object: bpy.types.Object) -> str:
    """The message for a drawing that has too few points for a curve."""
    count = len(_checked_record(curve_object)["control_corners"]) // 3
    return (
        f'"{curve_object.name}" has {count} control point{"" if count == 1 else "s"} and no curve '
        "yet. Add points with the Surface Curve tool, or delete it"
    )


def surface_of(curve_object: bpy.types.Object, mesh_object: bpy.types.Object) -> Surface:
    """The current surface that a curve lies on."""
    return read(mesh_object, settings_of(curve_object).use_modifiers)


def read_curves(curve_object: bpy.types.Object, surface: Surface) -> list[SurfaceCurve]:
    """The recorded curves as curves of the core, on the current surface."""
    from ... import nicmm_core as nicmm

    record = _checked_record(curve_object)
    if not len(record["counts"]):
        raise InputError(no_curve_message(curve_object))
    faces, barycentric = _find_points(record, "corners", "barycentric", surface)
    if (faces < 0).any():
        raise InputError(
            f'The mesh has changed since "{curve_object.name}" was designed: '
            f"the triangles of {(faces < 0).sum()} of its {len(faces)} points no longer exist. "
            "Run Update Curves to move its control points to the current mesh, or draw the curve "
            "again"
        )
    curves, start, control = [], 0, 0
    for count, closed, controls in zip(
        record["counts"], record["closed"], record["control_counts"], strict=True
    ):
        here = slice(start, start + count)
        weights, on = barycentric[here], faces[here]
        points = np.einsum("nj,njk->nk", weights, surface.core_positions[surface.faces[on]])
        index = np.array(record["control_index"], dtype=np.int64)[control : control + controls]
        curves.append(nicmm.SurfaceCurve(bool(closed), on, weights, points, index))
        start, control = start + count, control + controls
    return curves


def read_control_points(
    curve_object: bpy.types.Object, surface: Surface
) -> tuple[SurfacePoints, np.ndarray]:
    """The control points of a curve as SurfacePoints, and their positions when it was designed.

    The face of a point is -1 if its triangle no longer exists. Positions, (k, 3), are in the local
    space of the mesh object.
    """
    record = _checked_record(curve_object)
    return _read_points(record, CONTROL, surface)


def _read_points(record: Record, kind: str, surface: Surface) -> tuple[SurfacePoints, np.ndarray]:
    """Control points or via points, and their positions, as `read_control_points` returns them."""
    from ... import nicmm_core as nicmm

    names = (f"{kind}corners", f"{kind}barycentric")
    found = nicmm.SurfacePoints(*_find_points(record, *names, surface))
    return found, np.array(record[f"{kind}positions"], dtype=np.float64).reshape(-1, 3)


def current_via_points(
    curve_object: bpy.types.Object, mesh_object: bpy.types.Object, surface: Surface
) -> ViaPoints:
    """The via points of a curve on the current surface, found like its control points."""
    record = _checked_record(curve_object)
    if "via_legs" not in record:
        return no_via_points()
    found = _read_points(record, VIA, surface)
    points, _ = _on_surface(curve_object, mesh_object, surface, VIA, *found)
    return ViaPoints(np.array(record["via_legs"], dtype=np.int64), points)


def current_control_points(
    curve_object: bpy.types.Object, mesh_object: bpy.types.Object, surface: Surface
) -> tuple[ControlPoints, int]:
    """The control points of a curve on the current surface, and how many of them were moved."""
    if not len(surface.faces):
        raise InputError(f'"{mesh_object.name}" has no faces to draw on. Choose another mesh')
    found = read_control_points(curve_object, surface)
    places, moved = _on_surface(curve_object, mesh_object, surface, CONTROL, *found)
    return ControlPoints(places, corners_of(curve_object)), moved


def _on_surface(
    curve_object: bpy.types.Object,
    mesh_object: bpy.types.Object,
    surface: Surface,
    kind: str,
    points: SurfacePoints,
    positions: np.ndarray,
) -> tuple[SurfacePoints, int]:
    """Points that were read, on the current surface, and how many of them were moved.

    A point whose triangle no longer exists is located by the face of the cage that it came from. If
    that fails too, it is moved to the nearest point of the surface.
    """
    from ... import nicmm_core as nicmm
    from ...nicmm_core.geometry.surface_points import nearest_points

    faces, barycentric = points.faces.copy(), points.barycentric.copy()
    lost = faces < 0
    if lost.any():
        cage = identity_trace(surface) if surface.cage is None else surface.cage
        cage_points = _cage_points(curve_object, mesh_object, cage.sizes, kind)
        if cage_points is not None:
            there, weights = to_surface_points(surface, cage, cage_points)
            faces[lost], barycentric[lost] = there[lost], weights[lost]
    lost = faces < 0
    if lost.any():
        mesh = surface_cache.core_mesh(surface)
        nearest, _ = nearest_points(mesh, positions[lost] @ surface.local_to_core.T)
        faces[lost], barycentric[lost] = nearest.faces, nearest.barycentric
    return nicmm.SurfacePoints(faces, barycentric), int(lost.sum())


def corners_of(curve_object: bpy.types.Object) -> np.ndarray:
    """Whether each control point of a curve is a corner, (k,)."""
    return np.array(_checked_record(curve_object)["corner_points"], dtype=bool)


def _cage_points(
    curve_object: bpy.types.Object,
    mesh_object: bpy.types.Object,
    sizes: tuple[int, int, int],
    kind: str,
) -> CagePoints | None:
    """The control points or via points of a curve in faces of the cage; None if unknown.

    `sizes` are the current numbers of vertices, faces and corners of the cage.
    """
    record = curve_object[RECORD_KEY]
    if record.get("cage"):
        if tuple(record["cage"]) != sizes:
            return None
        return CagePoints(
            np.array(record[f"{kind}cage_faces"], dtype=np.int64),
            np.array(record[f"{kind}cage_places"], dtype=np.float64).reshape(-1, 2),
            np.array(record[f"{kind}cage_copies"], dtype=np.int64),
        )
    cage = read(mesh_object, use_modifiers=False)
    points = (
        read_control_points(curve_object, cage)[0]
        if kind == CONTROL
        else _read_points(record, kind, cage)[0]
    )
    there = points.faces >= 0
    if not there.any():
        return None
    found = to_cage_points(cage, identity_trace(cage), points.faces, points.barycentric)
    found.faces[~there] = -1
    return found


def _find_points(
    record: Record, corners_name: str, weights_name: str, surface: Surface
) -> tuple[np.ndarray, np.ndarray]:
    """Triangles (n,) and barycentric coordinates (n, 3) of recorded points.

    The triangle is -1 if it no longer exists.
    """
    corners = np.array(record[corners_name], dtype=np.int64).reshape(-1, 3)
    barycentric = np.array(record[weights_name], dtype=np.float64).reshape(-1, 3)
    faces, order = _find_triangles(surface.faces, corners)
    if not _keeps_indices(record, surface):
        faces = np.full(len(corners), -1, dtype=np.int64)
    return faces, np.take_along_axis(barycentric, order, axis=1)


def _keeps_indices(record: Record, surface: Surface) -> bool:
    """Whether vertices of the surface have the indices that they had when a curve was designed.

    A deformation and turned normals keep them. Many operators that add or remove faces do not; then
    a triangle of the same indices may be elsewhere.
    """
    if record.get("faces") == surface.faces_digest:
        return True
    generated = bool(record.get("cage")) or surface.cage is not None
    if generated or record["vertices"] > len(surface.local_positions):
        return False
    return record.get("triangles") == surface.triangles_digest or not _is_elsewhere(record, surface)


def _is_elsewhere(record: Record, surface: Surface) -> bool:
    """Whether control points found by indices have moved although the surface is still there.

    Where a deformation has moved a point, the surface has left the former position, too.
    """
    from ...nicmm_core.geometry.surface_points import nearest_points

    corners = np.array(record["control_corners"], dtype=np.int64).reshape(-1, 3)
    weights = np.array(record["control_barycentric"], dtype=np.float64).reshape(-1, 3)
    former = np.array(record["control_positions"], dtype=np.float64).reshape(-1, 3)
    faces, order = _find_triangles(surface.faces, corners)
    there = faces >= 0
    found = surface.points(faces[there], np.take_along_axis(weights, order, axis=1)[there])
    moved = np.linalg.norm(found - former[there], axis=1) > SAME_PLACE * surface.diagonal
    if not moved.any():
        return False
    mesh = surface_cache.core_mesh(surface)
    _, away = nearest_points(mesh, former[there][moved] @ surface.local_to_core.T)
    return bool((away <= SAME_PLACE * mesh.diagonal).any())


def _find_triangles(faces: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find triangles by their vertices.

    Returns
    -------
    found : (n,) int array
        Triangle with the vertices of each row of `corners`; -1 if there is none.
    order : (n, 3) int array
        For each corner of that triangle, its index in the row of `corners`.
    """
    # Few triangles have only vertices from `corners`, and only these need to be compared.
    wanted = np.zeros(int(faces.max(initial=-1)) + 1, dtype=bool)
    wanted[corners[corners < len(wanted)]] = True
    candidates = np.flatnonzero(wanted[faces].all(axis=1))
    sides = map(tuple, np.sort(faces[candidates], axis=1).tolist())
    known = dict(zip(sides, candidates.tolist(), strict=True))
    keys = map(tuple, np.sort(corners, axis=1).tolist())
    found = np.array([known.get(key, -1) for key in keys], dtype=np.int64)
    if not len(faces):
        return found, np.tile(np.arange(3), (len(found), 1))
    order = (faces[found][:, :, None] == corners[:, None, :]).argmax(axis=2)
    return found, order
