"""The problem of one curve design: the input of the network and of the variational solver.

It is built by the paper's pipeline up to section 3.1: control points, initial loop, signed distance
and input features. Pretraining and both solvers start from it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csgraph

from ..geometry.array_types import BoolArray, FloatArray
from ..geometry.mesh import Mesh
from ..geometry.normals import vertex_normals
from ..geometry.surface_points import SurfacePoints
from ..maps.guidance import feature_map, surface_unit
from ..path.initial_path import find_initial_path
from ..path.via_points import ViaPoints
from ..path.virtual_splits import WorkingMesh
from ..progress import checkpoint, subrange
from ..request import Request
from .features import control_indicator, in_principal_frame, input_features
from .finite_elements import FiniteElements, build_finite_elements
from .initial_loop import InitialLoop, build_initial_loop
from .sign_bundle import SignBundle, build_sign_bundle
from .signed_distance import bounding_side, signed_distance
from .smoothing import Smoother, build_smoother
from .topology import keep_topology

SMOOTHING_LENGTH = 1.5
"""Smoothing length ℓ of φ₀ at smoothness 1, in steps of the initial loop.

A smaller value leaves the zigzag of the edge path in the curve. With a larger value thin regions
vanish, and φ₀ falls back on the unsmoothed distance there to keep the topology.
"""


END_RADIUS = 3.0
"""Distance from an end of an open curve, in edge lengths, within which bending is ignored.

φ is a cone around the end, and the curvature of its level sets is unbounded there.
"""


PATH_SHARE, SMOOTHED_SHARE = 0.6, 0.9
"""Approximate fractions of the time until the path is found, and until the smoother is built."""


@dataclass(frozen=True)
class Problem:
    """A curve to be designed on a working mesh with n vertices.

    Attributes
    ----------
    working : WorkingMesh
        The working mesh, in units of the input mesh.
    unit : float
        Square root of the area of the working mesh: the unit of all lengths below, except those of
        the initial loop.
    vertices : (n, 3) float array
        Positions relative to the surface's centroid, along its principal axes.
    bundle : SignBundle or None
        Signs with which faces read φ, if the curve is open or bounds no region.
    elements : FiniteElements
    loop : InitialLoop
        The initial path, in units of the input mesh.
    distance : (n,) float array
        Signed distance to the initial path.
    smoother : Smoother
    initial_distance : (n,) float array
        φ₀, the smoothed distance. Its zero set is one simple curve through the control points.
    feature_map : (n,) float array or None
        φ_fea at the working vertices.
    features : (n, 8) or (n, 9) float array
        Input features of the network.
    """

    working: WorkingMesh
    unit: float
    vertices: FloatArray
    bundle: SignBundle | None
    elements: FiniteElements
    loop: InitialLoop
    distance: FloatArray
    smoother: Smoother
    initial_distance: FloatArray
    feature_map: FloatArray | None
    features: FloatArray

    @property
    def edge_length(self) -> float:
        """Mean length h of the edges at the initial loop, in the unit of the problem."""
        return self.loop.edge_length / self.unit


def build_problem(
    mesh: Mesh,
    points: SurfacePoints,
    order: str = "given",
    obstacles: FloatArray | None = None,
    alignment: FloatArray | None = None,
    smoothness: float = 1.0,
    closed: bool = True,
    via_points: ViaPoints | None = None,
) -> Problem:
    """Build the problem: insert the control points, find the initial path, compute the features.

    Parameters
    ----------
    mesh : Mesh
    points : SurfacePoints
        Control points from `locate_control_points`.
    order : {"given", "shortest"}
        Whether the points are visited as given or in the shortest order.
    obstacles, alignment : (V,) float array or None
        Weights in [0, 1] at the vertices of the input mesh.
    smoothness : float
        Factor of the bending term in the smoothing of φ₀, that is, of the fourth power of the
        smoothing length.
    closed : bool
        Whether the curve returns from the last point to the first.
    via_points : mapping, optional
        Mapping from the index of a control point to via points on the leg that starts there.

    Returns
    -------
    Problem

    Raises
    ------
    MeshError
        If the component with the control points has faces without area.
    UnreachableError
        If no simple path passes the points in this order.
    ArgumentError, ControlPointError
        If the via points cannot be used, see `path.initial_path`.
    """
    component = int(mesh.face_component[points.faces[0]])
    phi_fea = None
    if obstacles is not None or alignment is not None:
        phi_fea = feature_map(mesh, obstacles, alignment, surface_unit(mesh, component))
    with subrange(0.0, PATH_SHARE):
        path = find_initial_path(mesh, points, order, phi_fea, closed, via_points)
        working, loop = build_initial_loop(component, path)
    checkpoint(PATH_SHARE, lambda: working.vertices[loop.vertices])
    unit = float(np.sqrt(working.face_areas.sum()))
    vertices = in_principal_frame(working.vertices, working.faces, working.face_areas) / unit
    edge_length = loop.edge_length / unit
    elements = build_finite_elements(vertices, working.faces, working.on_boundary)
    plain, bundle = elements, None
    checkpoint()
    side = bounding_side(working, elements, loop) if closed else None
    if side is None:
        bundle = build_sign_bundle(working, loop)
        side = bundle.side
        without_divergence = working.on_boundary | _near_ends(working, loop)
        elements = build_finite_elements(vertices, working.faces, without_divergence, bundle)
    distance = signed_distance(plain, loop, edge_length, side)
    length = smoothness**0.25 * SMOOTHING_LENGTH * loop.zigzag / unit
    base = None if bundle is None else plain
    smoother = build_smoother(elements, loop.control_vertices, length, base)
    checkpoint(SMOOTHED_SHARE)
    smoothed = smoother.smoothed(distance)
    initial_distance, _ = keep_topology(working, loop, distance, smoothed, bundle)
    if phi_fea is not None:
        phi_fea = working.interpolation @ phi_fea
    features = input_features(
        vertices,
        vertex_normals(vertices, working.faces),
        control_indicator(smoother.response),
        initial_distance,
        phi_fea,
    )
    return Problem(
        working=working,
        unit=unit,
        vertices=vertices,
        bundle=bundle,
        elements=elements,
        loop=loop,
        distance=distance,
        smoother=smoother,
        initial_distance=initial_distance,
        feature_map=phi_fea,
        features=features,
    )


def requested_problem(mesh: Mesh, request: Request) -> Problem:
    """Build the problem of a request on a mesh, see `build_problem`."""
    return build_problem(
        mesh,
        request.points,
        request.order,
        request.obstacles,
        request.alignment,
        request.smoothness,
        request.closed,
        request.via_points,
    )


def _near_ends(working: WorkingMesh, loop: InitialLoop) -> BoolArray:
    """Whether each vertex is within `END_RADIUS` of an end of an open path, shape (n,)."""
    if loop.closed:
        return np.zeros(len(working.vertices), dtype=bool)
    distance = csgraph.dijkstra(
        working.edge_graph(),
        directed=False,
        indices=loop.vertices[[0, -1]],
        min_only=True,
        limit=END_RADIUS * loop.edge_length,
    )
    return np.isfinite(distance)
