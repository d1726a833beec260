# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes a curve as a separate object, or as cut edges, a region or separate parts of its mesh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import bpy
import numpy as np

import bmesh

from ..scene import curve_record, mirror_images, surface_cache
from ..scene.curve_record import CurveSettings, Drawn
from ..scene.design_request import DesignRequest, corners_of
from ..scene.junctions import OtherCurve
from ..scene.messages import InputError, check_finite, counted, sentence
from ..scene.mirror_plane import Mirror
from ..scene.surface import Surface
from ..scene.via_points import ViaPoints
from . import curve_object, mesh_cut, parallel_curves, sticky_curves, tube_radius
from .clean_curves import EXACT, Drawing, automatic_radius, splines

if TYPE_CHECKING:
    from ...nicmm_core import CutMesh, Design, Mesh, Region, SurfaceCurve, SurfacePoints
    from ...nicmm_core.outputs.polygons import CutPolygons

SEPARATE = ("CURVE", "STICKY")
"""Outputs that are separate objects."""

PARALLEL = "PARALLEL"
"""The output that adds parallel curves to a curve object."""

SAME_SCALE = 1e-5
"""Relative difference of scales in single precision that should be equal."""

FACE_SETS = ".sculpt_face_set"
"""Blender's attribute for face sets."""

DEFAULT_FACE_SET = 1
INSIDE = ".nicmm_inside"
"""Temporary face layer that marks the faces inside the curve."""

REGION_NAME = "Region"


class ObjectSettings(Protocol):
    """The output settings of a new object, as properties of an operator or the sidebar."""

    output: str
    spline: str
    radius: float
    offset: float
    thickness: float
    tube: bool


class OutputSettings(ObjectSettings, Protocol):
    """All output settings."""

    mark_seam: bool
    mark_sharp: bool
    cut_faces: str
    simplify: float
    region_as: str
    region_cut: bool
    other_side: bool
    parts_as: str
    parallel_distance: float
    parallel_count: int
    both_sides: bool


@dataclass
class _Cutting:
    """A mesh object whose surface the core has cut along a curve, before Blender's mesh is cut."""

    mesh_object: bpy.types.Object
    surface: Surface
    core_mesh: Mesh
    cut: CutMesh
    polygons: CutPolygons
    weights: np.ndarray


def apply(
    context: bpy.types.Context,
    mesh_object: bpy.types.Object,
    surface: Surface,
    curves: list[SurfaceCurve],
    settings: OutputSettings,
    curve_settings: CurveSettings,
    corners: np.ndarray,
    via: ViaPoints | None = None,
    mirror: Mirror | None = None,
    others: Sequence[OtherCurve] = (),
) -> str:
    """Create the chosen output and return a summary for the report.

    `settings` holds the output settings, `curve_settings` the settings of the curves, `corners`,
    (k,), tells which of their control points are corners, without mirror images, `via` are their
    via points, and `others` the curves that they avoid.
    """
    if settings.output in (*SEPARATE, PARALLEL):
        parallel = []
        if settings.output == PARALLEL:
            parallel = parallel_curves.computed(surface, curves, settings)
        new_object = as_object(mesh_object, surface, curves, settings, corners, mirror)
        drawn = drawn_as(settings)
        controls = _controls(curves, corners, mirror)
        curve_record.write_record(
            new_object,
            mesh_object,
            surface,
            curves,
            curve_settings,
            drawn,
            corners,
            controls,
            via,
            others,
        )
        curve_object.place(context, mesh_object, new_object)
        if parallel:
            parallel_curves.add(context, new_object, surface, parallel, settings)
            return counted(len(parallel), "parallel curve")
        return counted(sum(len(curve.faces) for curve in curves), "curve point")
    if mirror is not None and not mirror.joined:
        raise InputError(
            "The mesh cannot be cut along a pair of curves. Set Mirror As to Joined, or set Mirror "
            "to None and cut along one curve after the other"
        )
    if len(curves) != 1:
        raise InputError(
            f"There are {len(curves)} curves, and only one can be cut. Set Output to Curve to see "
            "them"
        )
    if surface.cage is not None:
        raise InputError(
            f'The modifiers of "{mesh_object.name}" add or remove faces, so its mesh cannot be cut '
            "along a curve on the shown surface. Apply them, or turn Use Modifiers off to draw on "
            "the mesh without them"
        )
    changes_mesh = {"EDGES": _cut_edges, "REGION": _region, "PARTS": _parts}
    mesh_cut.check_editable(mesh_object, cuts=settings.output != "REGION" or settings.region_cut)
    return changes_mesh[settings.output](context, mesh_object, surface, curves[0], settings)


def as_object(
    mesh_object: bpy.types.Object,
    surface: Surface,
    curves: list[SurfaceCurve],
    settings: ObjectSettings,
    corners: np.ndarray,
    mirror: Mirror | None = None,
) -> bpy.types.Object:
    """Create an object that shows curves, without linking it to a collection.

    `corners`, (k,), tells which of their control points are corners, without mirror images.
    """
    corners = mirror_images.corners_along(curves, corners, mirror)
    for name in ("radius", "thickness", "offset"):
        check_finite(name, getattr(settings, name))
    radius = automatic_radius(surface, settings.radius, settings.thickness)
    drawing = Drawing(settings.spline, radius, settings.offset)
    if settings.output == "STICKY":
        return sticky_curves.add(mesh_object, surface, curves, drawing, corners, settings.tube)
    shown = splines(surface, curves, drawing, corners)
    return curve_object.new_object(mesh_object, surface, shown, radius)


def redraw(
    drawn: bpy.types.Object,
    surface: Surface,
    curves: list[SurfaceCurve],
    corners: np.ndarray,
    mirror: Mirror | None = None,
) -> None:
    """Replace the curves in a curve object; its radius, materials and modifiers are kept.

    `corners`, (k,), tells which of their control points are corners, without mirror images. A
    linked duplicate gets data of its own, since its record describes only its own curve.
    """
    corners = mirror_images.corners_along(curves, corners, mirror)
    curve_object.make_single_user(drawn)
    if curve_object.is_child(drawn):
        _parent_again(drawn, surface)
    radius = tube_radius.radius_of(drawn) * curve_object.scale_of(drawn, surface)
    drawing = Drawing(radius=radius, **curve_record.drawn_as(drawn))
    if drawn.type == "CURVES":
        sticky_curves.write(drawn, surface, curves, drawing, corners)
    else:
        curve_object.write_splines(drawn, splines(surface, curves, drawing, corners))


def _parent_again(drawn: bpy.types.Object, surface: Surface) -> None:
    """Put a child of the mesh in its place again; its radius in the scene is kept.

    The place depends on the scale of the mesh. Applying transforms of the mesh changes it, too.
    """
    before = curve_object.scale_of(drawn, surface)
    curve_object.parent_to_mesh(drawn, drawn.parent, surface)
    after = curve_object.scale_of(drawn, surface)
    if abs(after / before - 1.0) > SAME_SCALE:
        tube_radius.set_radius(drawn, tube_radius.radius_of(drawn) * before / after)


def show_unfinished(drawn: bpy.types.Object, surface: Surface, curves: list[SurfaceCurve]) -> None:
    """Show curves that are being changed in their object, with all points of the exact curves."""
    drawing = Drawing(EXACT, 0.0, curve_record.drawn_as(drawn)["offset"])
    no_corners = np.zeros(0, dtype=bool)  # exact curves are sharp anyway
    if drawn.type == "CURVES":
        sticky_curves.write(drawn, surface, curves, drawing, no_corners)
    else:
        curve_object.write_splines(drawn, splines(surface, curves, drawing, no_corners))


def drawn_as(settings: ObjectSettings) -> Drawn:
    """The settings of a drawing that a record stores."""
    return {"spline": settings.spline, "offset": settings.offset}


def check_replaceable(designed: bpy.types.Object) -> None:
    """Raise an error if the points of a curve object cannot be replaced."""
    curve_object.check_replaceable(designed, curve_record.number_of_curves(designed))


def replace(designed: bpy.types.Object, request: DesignRequest, answer: Design | Exception) -> None:
    """Replace the curve in a curve object with the curve of an answer."""
    if isinstance(answer, Exception):
        raise InputError(str(answer)) from answer
    if not answer.curves:
        raise InputError(sentence(str(answer.status)))
    corners, mirror = corners_of(request, answer), request.mirror
    redraw(designed, request.surface, answer.curves, corners, mirror)
    curve_record.write_record(
        designed,
        request.mesh_object(),
        request.surface,
        answer.curves,
        request.settings,
        curve_record.drawn_as(designed),
        corners,
        _controls(answer.curves, corners, mirror),
        request.via,
        request.others,
    )
    parallel_curves.follow(designed, request.surface, answer.curves)


def _controls(
    curves: list[SurfaceCurve], corners: np.ndarray, mirror: Mirror | None
) -> SurfacePoints | None:
    """The control points of the given side of a curve with a mirror; None without a mirror."""
    return None if mirror is None else mirror_images.controls_of(curves, len(corners))


def _cutting(
    mesh_object: bpy.types.Object,
    surface: Surface,
    curve: SurfaceCurve,
    settings: OutputSettings,
    joined: bool = True,
) -> _Cutting:
    from ... import nicmm_core as nicmm
    from ...nicmm_core.outputs.polygons import cut_polygons

    core_mesh = surface_cache.core_mesh(surface)
    deviation = settings.simplify * core_mesh.mean_edge_length
    cut = nicmm.cut_mesh(core_mesh, curve, deviation=deviation)
    joined = joined and settings.cut_faces == "POLYGONS"
    polygons = cut_polygons(cut, surface.polygons, joined)
    weights = cut.corner_weights(core_mesh)
    return _Cutting(mesh_object, surface, core_mesh, cut, polygons, weights)


def _cut_edges(
    context: bpy.types.Context,
    mesh_object: bpy.types.Object,
    surface: Surface,
    curve: SurfaceCurve,
    settings: OutputSettings,
) -> str:
    cutting = _cutting(mesh_object, surface, curve, settings)
    normals = mesh_cut.CornerNormals(mesh_object)
    context.tool_settings.mesh_select_mode = (False, True, False)
    with mesh_cut.editable(mesh_object) as edited:
        vertices, _ = _cut_in_blender(edited, cutting)
        _select_only(edited, "EDGE", edges := _chain_edges(edited, cutting, vertices))
        for edge in edges:
            edge.seam = edge.seam or settings.mark_seam
            edge.smooth = edge.smooth and not settings.mark_sharp
    _set_normals(mesh_object, normals, cutting)
    along = counted(len(edges), "edge")
    return f"mesh cut along the curve, {along}{_custom_normals_note(mesh_object)}"


def _region(
    context: bpy.types.Context,
    mesh_object: bpy.types.Object,
    surface: Surface,
    curve: SurfaceCurve,
    settings: OutputSettings,
) -> str:
    cutting = _cutting(mesh_object, surface, curve, settings)
    region = _enclosed(cutting, settings.other_side)
    normals = mesh_cut.CornerNormals(mesh_object) if settings.region_cut else None
    if settings.region_as == "SELECTION":
        context.tool_settings.mesh_select_mode = (False, False, True)
    with mesh_cut.editable(mesh_object) as edited:
        # Add new layers first, since that invalidates the Python objects of the elements.
        layer = _region_layer(edited, settings.region_as)
        if settings.region_cut:
            vertices, faces = _cut_in_blender(edited, cutting)
            in_region, on_vertex = _faces_inside(cutting, region), region.cut_vertices
        else:
            vertices, faces = list(edited.verts), list(edited.faces)
            in_region = _mostly_inside(cutting, region)
            on_vertex = region.vertices(cutting.core_mesh)
        chosen = [faces[index] for index in np.flatnonzero(in_region)]
        if settings.region_as == "SELECTION":
            _select_only(edited, "FACE", chosen)
        elif settings.region_as == "FACE_SET":
            number = max(face[layer] for face in faces) + 1
            for face in chosen:
                face[layer] = number
        else:
            group = mesh_object.vertex_groups.new(name=REGION_NAME)
            for index in np.flatnonzero(on_vertex).tolist():
                vertices[index][layer][group.index] = 1.0
    if normals is not None:
        _set_normals(mesh_object, normals, cutting)
    what = {"SELECTION": "selected", "FACE_SET": "now a face set"}.get(settings.region_as)
    what = what or f'in the vertex group "{group.name}"'
    words = _custom_normals_note(mesh_object) if settings.region_cut else ""
    return f"{counted(len(chosen), 'face')} of the region {_are(len(chosen))} {what}{words}"


def _parts(
    context: bpy.types.Context,
    mesh_object: bpy.types.Object,
    surface: Surface,
    curve: SurfaceCurve,
    settings: OutputSettings,
) -> str:
    cutting = _cutting(mesh_object, surface, curve, settings)
    normals = mesh_cut.CornerNormals(mesh_object)
    if settings.parts_as == "OBJECTS":
        return _part_as_object(context, cutting, normals, _enclosed(cutting, settings.other_side))
    with mesh_cut.editable(mesh_object) as edited:
        vertices, _ = _cut_in_blender(edited, cutting)
        edges = _chain_edges(edited, cutting, vertices)
        bmesh.ops.split_edges(edited, edges=edges)
    _set_normals(mesh_object, normals, cutting)
    return f"separated along {len(edges)} edges{_custom_normals_note(mesh_object)}"


def _part_as_object(
    context: bpy.types.Context,
    cutting: _Cutting,
    normals: mesh_cut.CornerNormals,
    region: Region,
) -> str:
    mesh_object = cutting.mesh_object
    inside = _faces_inside(cutting, region)
    with mesh_cut.editable(mesh_object) as edited:
        layer = edited.faces.layers.int.new(INSIDE)
        vertices, faces = _cut_in_blender(edited, cutting)
        other_data = mesh_object.data.copy()
        edges = _chain_edges(edited, cutting, vertices)
        for index in np.flatnonzero(inside).tolist():
            faces[index][layer] = 1
        bmesh.ops.split_edges(edited, edges=edges)
        _take_inside(edited, other_data)
    other = mesh_object.copy()
    other.data = other_data
    curve_object.link(context, mesh_object, other)
    if normals.has_values:
        values = normals.after_cut(cutting.surface, cutting.cut, cutting.polygons, cutting.weights)
        sizes = _corner_counts(normals, cutting)
        mesh_object.data.normals_split_custom_set(values[np.repeat(~inside, sizes)].tolist())
        other_data.normals_split_custom_set(values[np.repeat(inside, sizes)].tolist())
    count = int(inside.sum())
    return f'{counted(count, "face")} of the region {_are(count)} now the object "{other.name}"'


def _are(count: int) -> str:
    return "is" if count == 1 else "are"


def _take_inside(edited: bmesh.types.BMesh, other_data: bpy.types.Mesh) -> None:
    """Move the faces marked as inside to another mesh."""
    other = edited.copy()
    try:
        for part, kept in ((edited, 0), (other, 1)):
            layer = part.faces.layers.int[INSIDE]
            removed = [face for face in part.faces if face[layer] != kept]
            bmesh.ops.delete(part, geom=removed, context="FACES")
            part.faces.layers.int.remove(layer)
        loose = [vertex for vertex in other.verts if not vertex.link_faces]
        bmesh.ops.delete(other, geom=loose, context="VERTS")
        other.to_mesh(other_data)
    finally:
        other.free()


def _cut_in_blender(
    edited: bmesh.types.BMesh, cutting: _Cutting
) -> tuple[list[bmesh.types.BMVert], list[bmesh.types.BMFace]]:
    return mesh_cut.apply(
        edited,
        cutting.mesh_object.data,
        cutting.surface,
        cutting.cut,
        cutting.polygons,
        cutting.weights,
    )


def _chain_edges(
    edited: bmesh.types.BMesh, cutting: _Cutting, vertices: list[bmesh.types.BMVert]
) -> list[bmesh.types.BMEdge]:
    pairs = cutting.cut.chain_edges.tolist()
    return [edited.edges.get((vertices[a], vertices[b])) for a, b in pairs]


def _enclosed(cutting: _Cutting, other_side: bool) -> Region:
    from ... import nicmm_core as nicmm

    region = nicmm.enclosed_region(cutting.core_mesh, cutting.cut)
    return region.complement(cutting.core_mesh, cutting.cut) if other_side else region


def _faces_inside(cutting: _Cutting, region: Region) -> np.ndarray:
    """Which faces of the cut Blender mesh are inside: first the unchanged faces, then the new."""
    n_polygons = int(cutting.surface.polygons.max()) + 1
    by_polygon = np.zeros(n_polygons, dtype=bool)
    by_polygon[cutting.surface.polygons[cutting.cut.source_face]] = region.cut_faces
    stays = np.ones(n_polygons, dtype=bool)
    stays[cutting.polygons.source] = False
    new = [region.cut_faces[triangles[0]] for triangles in cutting.polygons.triangles]
    return np.concatenate([by_polygon[stays], np.array(new, dtype=bool)])


def _mostly_inside(cutting: _Cutting, region: Region) -> np.ndarray:
    """Which faces of the uncut Blender mesh have more than half of their area inside."""
    polygons, areas = cutting.surface.polygons, cutting.core_mesh.face_areas
    within = np.bincount(polygons, areas * region.share)
    return within > 0.5 * np.bincount(polygons, areas)


def _region_layer(edited: bmesh.types.BMesh, region_as: str) -> bmesh.types.BMLayerItem | None:
    if region_as == "VERTEX_GROUP":
        return edited.verts.layers.deform.verify()
    if region_as == "SELECTION":
        return None
    layer = edited.faces.layers.int.get(FACE_SETS)
    if layer is None:
        layer = edited.faces.layers.int.new(FACE_SETS)
        for face in edited.faces:
            face[layer] = DEFAULT_FACE_SET
    return layer


def _select_only(
    edited: bmesh.types.BMesh,
    mode: str,
    elements: list[bmesh.types.BMEdge] | list[bmesh.types.BMFace],
) -> None:
    edited.select_history.clear()
    for sequence in (edited.faces, edited.edges, edited.verts):
        for element in sequence:
            element.select = False
    edited.select_mode = {mode}
    for element in elements:
        element.select_set(True)
    edited.select_flush_mode()


def _set_normals(
    mesh_object: bpy.types.Object, normals: mesh_cut.CornerNormals, cutting: _Cutting
) -> None:
    if normals.has_values:
        values = normals.after_cut(cutting.surface, cutting.cut, cutting.polygons, cutting.weights)
        mesh_object.data.normals_split_custom_set(values.tolist())


def _corner_counts(normals: mesh_cut.CornerNormals, cutting: _Cutting) -> np.ndarray:
    """Number of corners of each face of the cut Blender mesh."""
    counts = np.diff(normals.loop_starts, append=len(normals.values))
    stays = np.ones(len(counts), dtype=bool)
    stays[cutting.polygons.source] = False
    return np.concatenate([counts[stays], [len(c) for c in cutting.polygons.corners]]).astype(int)


def _custom_normals_note(mesh_object: bpy.types.Object) -> str:
    if mesh_object.data.has_custom_normals and mesh_object.mode == "EDIT":
        return (
            ". Custom normals near the cut are approximate; cut in Object Mode to interpolate them"
        )
    return ""
