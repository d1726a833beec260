"""The entry point: computes a curve from a mesh and control points. Read this file first.

`Designer` checks a request and prepares the surface (`designer`). The default method takes the
steps

control points → courses without crossings (`courses`), compared by their energy → relaxation of the
best course,

or, if no course is found,

control points → initial path (`path`) → relaxation of the path.

All of this takes place on the Delaunay triangulation of the surface, and a last relaxation on the
given faces (`final_relaxation`). Except on small meshes, courses are found on a coarse mesh of the
same surface, and mapped from there to the fine mesh (`coarsening`). The other methods are in
`paper`. The functions besides `design_curve` make control points, or further curves, and use the
same `Designer`.
"""

from __future__ import annotations

from collections.abc import Sequence

from numpy.typing import ArrayLike

from .design_result import Design
from .designer import Designer
from .geometry.array_types import FloatArray
from .geometry.curve import SurfaceCurve
from .geometry.mesh import MeshLike
from .geometry.surface_points import SurfacePoints
from .path.via_points import ViaPoints
from .progress import Progress


def design_curve(
    mesh: MeshLike,
    control_points: ArrayLike | SurfacePoints,
    *,
    closed: bool = True,
    order: str = "given",
    via_points: ViaPoints | None = None,
    method: str = "elastic",
    obstacles: ArrayLike | None = None,
    alignment: ArrayLike | None = None,
    clearance: float = 0.0,
    avoid: Sequence[SurfaceCurve | Design] | None = None,
    smoothness: float = 1.0,
    corners: ArrayLike | None = None,
    normal_bending: float = 0.0,
    mirror: ArrayLike | None = None,
    alternatives: int = 0,
    progress: Progress | None = None,
) -> Design:
    """Design a smooth curve on a mesh through control points.

    Parameters
    ----------
    mesh : Mesh or object with `vertices` and `faces`
    control_points : (k,) int array_like, (k, 3) float array_like or SurfacePoints
        Vertex indices, points on the surface, or faces with barycentric coordinates; at least
        three for a closed curve and two for an open one.
    closed : bool, default True
        Whether the curve is closed. An open curve runs from the first point visited to the last.
    order : {"given", "shortest"}
        Whether the curve visits the points in the given order or in the order of the shortest path
        through them, which is cyclic for a closed curve. With "shortest", the curve may visit them
        in yet another order, if it would cross itself otherwise or, if it is open, is fairer then.
    via_points : mapping, optional
        Points that select one of several courses between two control points, such as
        ``{1: [57]}``. The key is the index of a control point. The value has points, in any form
        that control points may have, through which the curve from which the computation starts
        runs to the next control point. The result passes near them. Only for the order "given".
    method : {"elastic", "nicmm", "variational"}
        The best of many candidate courses, or else the initial path, relaxed as an elastic curve
        (the default); the network of the paper, fitted to each curve; or the same energy as for
        "nicmm", minimised without a network.
    obstacles : (V,) array_like of weights in [0, 1], optional
        Weights of the vertices that the curve avoids. It never enters a face whose three corners
        have weight 1; smaller weights only add to the energy.
    alignment : (V,) array_like of weights in [0, 1], optional
        Weights of the vertices that the curve follows.
    clearance : float, default 0
        Distance along the surface, in mesh units, that the curve keeps from obstacles of weight 1
        and from the curves of `avoid`.
    avoid : list of SurfaceCurve or Design, optional
        Curves on the mesh that the curve does not cross, and from which it keeps the clearance.
        Control points on them are junctions, at which the curve ends or passes through; the
        clearance does not count along an avoided curve up to twice the clearance from a junction.
        Only with the method "elastic".
    smoothness : float, default 1
        Larger values give a fairer curve that follows the shortest path less closely.
    corners : (c,) int array_like, optional
        Indices of control points at which the curve may turn freely. No bending is counted there.
        Only with the method "elastic".
    normal_bending : float, default 0
        Weight w of the normal curvature: the bending energy is ∮ (κ_g² + w κ_n²) ds in place of
        ∮ κ_g² ds, so the curve avoids ridges and valleys. With 1, the whole curvature in space
        counts. Only with the method "elastic".
    mirror : (2, 3) array_like, optional
        A point of a plane and its normal. The curve is then its own mirror image: it passes through
        the control points, which lie on one side of the plane or on it, and then through their
        mirror images in reverse order. It crosses the plane at right angles. A closed curve crosses
        it twice, an open one once; the first and the last point of a closed curve, and the last
        point of an open one, may lie on the plane. The images are the places of the mesh nearest to
        the reflected points, and the `control_index` of the curve has them as well. A map counts on
        both sides: each vertex has the greater of its own weight and that of its mirror image. The
        mirror image of the leg from the i-th point has the images of ``via_points[i]``. With
        "shortest", the order is that of a short path of the half. Not with `avoid`. Only for the
        method "elastic".
    alternatives : int, default 0
        Largest number of further curves, along other courses, to return in `Design.alternatives`.
        Only with the method "elastic".
    progress : callable, optional
        Called up to ten times a second with the fraction done and the points of the current curve,
        an (n, 3) array that is empty at first. If the function returns False, the design stops and
        returns the last curve, or none if there is none yet.

    Returns
    -------
    Design

    Raises
    ------
    ControlPointError
        If there are too few points, or one is repeated, out of range or off the surface, or closer
        to a curve of `avoid` than the clearance without lying on it.
    UnreachableError
        If no simple curve through the points exists on the surface, if every path found winds
        around itself too often, or if obstacles of weight 1 or curves to avoid separate the points.
    CurveError
        If a curve of `avoid` does not lie on the mesh.
    ArgumentError
        If another argument cannot be used, or the mesh is not symmetric enough about the mirror.

    Examples
    --------
    >>> import nicmm_core as nicmm
    >>> from nicmm_core import shapes
    >>> mesh = shapes.sphere(3)
    >>> design = nicmm.design_curve(mesh, [12, 80, 41], order="shortest")
    >>> len(design.curves)
    1
    """
    return Designer(mesh).design(
        control_points,
        closed=closed,
        order=order,
        via_points=via_points,
        method=method,
        obstacles=obstacles,
        alignment=alignment,
        clearance=clearance,
        avoid=avoid,
        smoothness=smoothness,
        corners=corners,
        normal_bending=normal_bending,
        mirror=mirror,
        alternatives=alternatives,
        progress=progress,
    )


def mirrored(mesh: MeshLike, design: Design, plane: ArrayLike) -> Design:
    """The mirror image of a design, as a design on the same mesh.

    Every point of the curve is moved to the place of the mesh nearest to its mirror image, and
    consecutive places are joined by straight traces. The result is not relaxed; another design with
    ``start=`` continues from it. `Designer.mirrored` does the same.

    Parameters
    ----------
    mesh : Mesh or object with `vertices` and `faces`
        The mesh of the design.
    design : Design
        A design with one curve.
    plane : (2, 3) array_like
        A point of the plane and its normal.

    Returns
    -------
    Design
        A design through the mirror images of the control points, in the same order, with the status
        of the given one. Its energy has no term of maps.

    Raises
    ------
    CurveError
        If the design has not exactly one curve on this mesh, or its mirror image is too far from
        the surface, or cannot be traced on it without crossing itself.
    ArgumentError
        If another argument cannot be used.

    Examples
    --------
    >>> import nicmm_core as nicmm
    >>> from nicmm_core import shapes
    >>> mesh = shapes.sphere(3)
    >>> left = nicmm.design_curve(mesh, [12, 80, 41], order="shortest")
    >>> right = nicmm.mirrored(mesh, left, ((0, 0, 0), (1, 0, 0)))
    >>> len(right.curves)
    1
    """
    return Designer(mesh).mirrored(design, plane)


def offset_curve(
    mesh: MeshLike, curve: SurfaceCurve | Design, distance: ArrayLike
) -> list[SurfaceCurve]:
    """Curves at a distance from a curve along the surface, on one side of it.

    They consist of all points at the distance whose shortest path to the curve begins on that side.
    So they split and merge as the lines of a distance field do, and those of an open curve end
    beside its ends. They have the direction of the curve.

    Parameters
    ----------
    mesh : Mesh or object with `vertices` and `faces`
    curve : SurfaceCurve or Design
        A curve on this mesh, or a design with one.
    distance : float or (k,) float array_like
        Distance along the surface in mesh units: positive for the left side of the curve, seen
        with the normals of the faces upwards, negative for the right side. With one value for each
        of its control points, in the order visited, the distance varies linearly with the arc
        length in between. All values have the same sign.

    Returns
    -------
    list of SurfaceCurve
        The curves, the longest first, without control points. It is empty if no point on that side
        is so far away.

    Raises
    ------
    CurveError
        If the curve does not lie on the mesh, or the surface has only one side.
    ArgumentError
        If the distance cannot be used.

    Examples
    --------
    >>> import nicmm_core as nicmm
    >>> from nicmm_core import shapes
    >>> mesh = shapes.sphere(3)
    >>> curve = nicmm.design_curve(mesh, [12, 80, 41]).curves[0]
    >>> [parallel] = nicmm.offset_curve(mesh, curve, 0.1)
    >>> parallel.closed
    True
    """
    designer = Designer(mesh)
    (found,) = designer.offset_curves(curve, [distance])
    return found


def fit_stroke(
    mesh: MeshLike,
    points: ArrayLike,
    tolerance: float,
    *,
    closed: bool = False,
    progress: Progress | None = None,
) -> FloatArray:
    """Few control points whose curve follows a stroke, such as a line drawn by hand.

    Parameters
    ----------
    mesh : Mesh or object with `vertices` and `faces`
    points : (n, 3) float array_like
        The stroke, in order: positions near the surface, possibly noisy.
    tolerance : float
        Greatest distance between the stroke and the curve, in mesh units.
    closed : bool, default False
        Whether the stroke is closed; its last point is then joined to the first.
    progress : callable, optional
        As for `design_curve`. If the function returns False, there are no control points.

    Returns
    -------
    (k, 3) float array
        Control points on the surface. Every point of ``design_curve(mesh, found, closed=closed)``
        is within the tolerance of the stroke, and every point of the stroke within the tolerance
        of the curve, measured in space.

    Raises
    ------
    ControlPointError
        If the stroke is farther from the surface than the tolerance.
    UnreachableError
        If no curve was found that follows the stroke, for example since it crosses itself.
    ArgumentError
        If an argument cannot be used.

    Examples
    --------
    >>> import numpy as np
    >>> import nicmm_core as nicmm
    >>> from nicmm_core import shapes
    >>> mesh = shapes.sphere(4)
    >>> angle = np.linspace(0.0, 2.0, 200)
    >>> stroke = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    >>> len(nicmm.fit_stroke(mesh, stroke, tolerance=0.05)) < 6
    True
    """
    designer = Designer(mesh)
    found = designer.fit_stroke(points, tolerance, closed, progress=progress)
    return found.positions(designer.mesh)


def feature_loop(
    mesh: MeshLike,
    point: ArrayLike | SurfacePoints,
    *,
    edges: ArrayLike | None = None,
    weights: ArrayLike | None = None,
    reach: float | None = None,
    progress: Progress | None = None,
) -> FloatArray:
    """Control points of the closed loop along the feature next to a point.

    A feature is a sharp edge, a boundary, a smooth ridge or valley, marked edges, or the rim of a
    painted region. Where no loop follows it, they are those of the open line along it;
    `Designer.feature_loop` also tells which of both it is.

    Parameters
    ----------
    mesh : Mesh or object with `vertices` and `faces`
    point : (1,) int array_like, (1, 3) float array_like or SurfacePoints
        A point on the surface near the feature; a vertex index or a position may be given alone.
    edges : (n, 2) int array_like, optional
        Vertices of marked edges, which are followed first.
    weights : (V,) float array_like, optional
        Weights at the vertices; the rim of the region with more than half is followed next.
    reach : float, optional
        Distance from the point within which the feature is looked for; at least four edges.
    progress : callable, optional
        As for `design_curve`. If the function returns False, there are no control points.

    Returns
    -------
    (k, 3) float array
        Control points on the surface, for `design_curve`. Its curve stays within a third of an edge
        of the feature.

    Raises
    ------
    ControlPointError
        If the point is not one point on the surface.
    UnreachableError
        If there is no feature within reach, or no curve was found that follows it.
    ArgumentError
        If another argument cannot be used.

    Examples
    --------
    >>> import nicmm_core as nicmm
    >>> from nicmm_core import shapes
    >>> mesh = shapes.annulus()
    >>> rim = nicmm.feature_loop(mesh, [0.31, 0.0, 0.0])
    >>> design = nicmm.design_curve(mesh, rim)
    >>> design.curves[0].closed
    True
    """
    designer = Designer(mesh)
    found, _ = designer.feature_loop(point, edges, weights, reach, progress)
    return found.positions(designer.mesh)
