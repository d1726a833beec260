"""The mirror image of a curve, traced on a mesh without relaxing it."""

from __future__ import annotations

from functools import partial

import numpy as np

from ..design_result import Design
from ..errors import CurveError
from ..geometry.array_types import FloatArray
from ..geometry.crossings import crossing_segments
from ..geometry.curve import SurfaceCurve, curve_on_mesh
from ..geometry.curve_field import curve_field
from ..mapped_surface import MappedSurface
from ..relaxation.discrete_curve import place_nodes
from ..relaxation.elastic_energy import bending_energy
from ..relaxation.warm_start import WARM
from ..request import Request
from ..status import Status
from .reflection import joined_places, nearest_places, with_controls


def mirrored_design(
    surface: MappedSurface,
    request: Request,
    positions: FloatArray,
    curve: SurfaceCurve,
    status: Status,
) -> Design:
    """The design whose curve runs through the places nearest to some positions.

    Parameters
    ----------
    surface : MappedSurface
    request : Request
        The request with the mirror images of the control points.
    positions : (n, 3) float array
        Mirror images of the points of the curve, in the coordinates of the surface.
    curve : SurfaceCurve
        The curve, on any mesh.
    status : Status
        Its status.

    Raises
    ------
    CurveError
        If the mirror image cannot be traced, or crosses itself.
    """
    mesh = surface.mesh
    places = nearest_places(mesh, positions, curve.barycentric)
    control = np.full(len(positions), -1)
    control[curve.control_index] = np.arange(len(curve.control_index))
    places = with_controls(places, control, request.points)
    found = joined_places(surface.without_maps, places, curve.closed)
    if found is None or len(crossing_segments(mesh.faces, found[0], curve.closed)):
        what = "cannot be traced on" if found is None else "crosses itself on"
        raise CurveError(
            f"the mirror image of design {what} this mesh, which is not symmetric enough about "
            "plane; design a curve through the mirror images of its control points instead"
        )
    polyline, number = found
    image = curve_on_mesh(
        mesh,
        curve.closed,
        polyline.faces,
        polyline.barycentric,
        number[curve.control_index],
    )
    corners = request.are_corners(np.arange(len(curve.control_index)))
    nodes = place_nodes(surface.without_maps, image, WARM.levels[-1], corners).nodes
    bending = 0.5 * bending_energy(nodes, request.normal_bending) * surface.unit
    return Design(
        status=status,
        curves=[image],
        iterations=0,
        seconds=0.0,
        energy={"sdf": 0.0, "int": 0.0, "smooth": bending, "fea": 0.0},
        breaking_vertices=0,
        find_field=partial(curve_field, mesh, image),
    )
