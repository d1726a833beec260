"""Assertions that every curve must satisfy, and helpers that several tests share.

The assertions rely on `tests.oracles.checker`, the only definition of a valid curve.
"""

import igl
import numpy as np

import nicmm_core as nicmm
from nicmm_core.geometry.crossings import meeting_segments
from nicmm_core.geometry.curve import curve_on_mesh
from nicmm_core.geometry.tracing import strictly_inside, trace_between
from nicmm_core.paper.initial_loop import build_initial_loop
from nicmm_core.path.initial_path import find_initial_path
from nicmm_core.relaxation.node_traces import traced_segments, traces_between_nodes
from tests.oracles.checker import judge_curve


def assert_valid_curve(mesh, curve, control_positions=None, closed=True):
    """Assert that a curve lies on the surface, is simple and visits the control points in order."""
    assert not judge_curve(mesh, curve, control_positions, closed).faults


def assert_valid_design(mesh, design, control_positions=None, closed=True):
    """Assert that a design has one valid curve, a finite field and all terms of the energy."""
    assert design.status in (nicmm.Status.CONVERGED, nicmm.Status.ITERATION_LIMIT), design.status
    assert len(design.curves) == 1
    assert_valid_curve(mesh, design.curves[0], control_positions, closed)
    assert design.field.shape == (len(mesh.vertices),)
    assert np.isfinite(design.field).all()
    assert set(design.energy) == {"sdf", "int", "smooth", "fea"}
    assert all(np.isfinite(value) and value >= 0.0 for value in design.energy.values())
    assert isinstance(design.iterations, int) and design.iterations >= 0
    assert design.seconds > 0.0


def assert_lies_on_surface(mesh, curve):
    """Assert that points agree with their barycentrics and consecutive ones share a face."""
    assert not judge_curve(mesh, curve).off_surface


def assert_does_not_touch_itself(mesh, curve):
    """Assert that no point is repeated and no two strands cross or touch."""
    verdict = judge_curve(mesh, curve)
    assert verdict.readable
    assert not verdict.not_simple


def assert_visits(mesh, curve, control_positions):
    """Assert that the polyline contains the control points, in the order of their positions."""
    verdict = judge_curve(mesh, curve, control_positions, curve.closed)
    assert verdict.readable
    assert not verdict.not_through_points


def random_surface_points(mesh, count, seed):
    """Points strictly inside random faces, at most one per face."""
    generator = np.random.default_rng(seed)
    faces = generator.choice(len(mesh.faces), size=count, replace=False)
    barycentric = generator.dirichlet([2.0, 2.0, 2.0], size=count)
    return nicmm.SurfacePoints(faces, barycentric)


def euler_characteristic(faces):
    """Euler characteristic V - E + F; only vertices of faces count."""
    sides = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    return len(np.unique(faces)) - len(np.unique(sides, axis=0)) + len(faces)


def circle(angles, radius=1.0):
    """Points of a circle about the origin in the xy plane."""
    angles = np.asarray(angles)
    return radius * np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=1)


def apart(first, second):
    """Symmetric Hausdorff distance of two closed polylines (n, 3)."""
    return max(_farthest(first, second), _farthest(second, first))


def _farthest(points, polyline):
    start = polyline[None]
    step = np.roll(polyline, -1, axis=0)[None] - start
    offset = points[:, None] - start
    squared = np.maximum((step**2).sum(axis=2), np.finfo(float).tiny)
    along = np.clip((offset * step).sum(axis=2) / squared, 0.0, 1.0)
    return np.linalg.norm(offset - along[:, :, None] * step, axis=2).min(axis=1).max()


def mean_edge_length(mesh):
    """Mean length over the sides of all faces."""
    corners = mesh.vertices[mesh.faces]
    return float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean())


def joined(*meshes):
    """Several meshes as one mesh with several components."""
    offsets = np.cumsum([0, *[len(mesh.vertices) for mesh in meshes[:-1]]])
    return nicmm.Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + o for mesh, o in zip(meshes, offsets, strict=True)]),
    )


def chosen(points, index):
    """Points at some indices."""
    return nicmm.SurfacePoints(points.faces[index], points.barycentric[index])


def points_near(mesh, positions):
    """Nearest points of a mesh, moved strictly inside faces."""
    positions = np.asarray(positions, dtype=float)
    _, faces, nearest = igl.point_mesh_squared_distance(positions, mesh.vertices, mesh.faces)
    corners = np.ascontiguousarray(mesh.vertices[mesh.faces[faces]].transpose(1, 0, 2))
    barycentric = igl.barycentric_coordinates(nearest, *corners)
    return nicmm.SurfacePoints(faces.astype(np.int64), strictly_inside(barycentric))


def distances(mesh, start, end):
    """Distance in space between the points of each pair."""
    return np.linalg.norm(end.positions(mesh) - start.positions(mesh), axis=1)


def curve_through(mesh, positions, controls, closed=True):
    """Curve traced straight from each position to the next; consecutive ones must be close.

    ``controls`` are the indices of the positions that are control points.
    """
    points = points_near(mesh, positions)
    here = np.arange(len(points) if closed else len(points) - 1)
    there = (here + 1) % len(points)
    normals = mesh.face_normals[points.faces]
    agree = np.where((normals[here] * normals[there]).sum(axis=1) < 0.0, -1.0, 1.0)[:, None]
    plane = normals[here] + agree * normals[there]
    start, end = chosen(points, here), chosen(points, there)
    ways = trace_between(mesh, start, end, plane, 3.0 * distances(mesh, start, end))
    assert ways.reached.all()
    owner = np.concatenate([np.arange(len(points)), ways.pair])
    order = np.argsort(owner, kind="stable")
    faces = np.concatenate([points.faces, ways.crossings.faces])[order]
    barycentric = np.concatenate([points.barycentric, ways.crossings.barycentric])[order]
    at_controls = np.searchsorted(owner[order], controls)
    return curve_on_mesh(mesh, closed, faces, barycentric, at_controls)


def flipped(mesh, seed):
    """The same surface with about half of its faces reversed."""
    turned = np.random.default_rng(seed).random(len(mesh.faces)) < 0.5
    return nicmm.Mesh(mesh.vertices, np.where(turned[:, None], mesh.faces[:, ::-1], mesh.faces))


def renumbered(mesh, seed):
    """The same surface with vertices and faces renumbered and the corners of faces rotated."""
    generator = np.random.default_rng(seed)
    vertex = generator.permutation(len(mesh.vertices))
    number = np.argsort(vertex)
    turn = (np.arange(3) + generator.integers(0, 3, (len(mesh.faces), 1))) % 3
    faces = np.take_along_axis(number[mesh.faces], turn, axis=1)
    return nicmm.Mesh(mesh.vertices[vertex], faces[generator.permutation(len(faces))])


def scaled(mesh, factor):
    """The same mesh, scaled."""
    return nicmm.Mesh(factor * mesh.vertices, mesh.faces)


def cylinder(around=24, along=12, radius=1.0):
    """Open prism about the z axis, from z = 0 to z = 2."""
    angle, height = np.meshgrid(
        np.arange(around) * 2 * np.pi / around, np.linspace(0.0, 2.0, along + 1), indexing="ij"
    )
    vertices = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=-1)
    index = np.arange(angle.size).reshape(angle.shape)
    onward = np.roll(index, -1, axis=0)
    a, b, c, d = index[:, :-1], onward[:, :-1], onward[:, 1:], index[:, 1:]
    faces = np.concatenate([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)])
    return nicmm.Mesh(vertices.reshape(-1, 3), faces.reshape(-1, 3))


def grid(count):
    """Unit square of ``count`` by ``count`` squares, each divided along its diagonal."""
    x, y = np.meshgrid(np.linspace(0, 1, count + 1), np.linspace(0, 1, count + 1), indexing="ij")
    index = np.arange(x.size).reshape(x.shape)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    faces = np.concatenate([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)])
    return nicmm.Mesh(np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3), faces.reshape(-1, 3))


def crossing_steps(surface, nodes):
    """Pairs of nodes of a curve, (p, 2), ascending, whose traces to the next nodes cross."""
    segments = traced_segments(traces_between_nodes(surface, nodes))
    size, count = nodes.per_curve, len(nodes.positions)
    curve = segments.node // size
    group = curve * len(surface.mesh.faces) + segments.face
    one, other = meeting_segments(group, segments.start, segments.end).T
    apart = np.abs(one - other)
    if nodes.closed:
        first = np.searchsorted(curve, np.arange(nodes.curves + 1))
        apart = np.minimum(apart, np.diff(first)[curve[one]] - apart)
    one, other = segments.node[one[apart > 1]], segments.node[other[apart > 1]]
    pairs = np.unique(np.minimum(one, other) * count + np.maximum(one, other))
    return np.stack(np.divmod(pairs, count), axis=1)


def simple_curves(surface, nodes):
    """Whether each curve does not cross itself, (c,), wherever its traces succeed."""
    simple = np.ones(nodes.curves, dtype=bool)
    simple[crossing_steps(surface, nodes)[:, 0] // (len(nodes.positions) // nodes.curves)] = False
    return simple


def initial_loop(mesh, points, order, phi_fea=None, closed=True, via_points=None):
    """Working mesh, and the initial path on it."""
    path = find_initial_path(mesh, points, order, phi_fea, closed, via_points)
    return build_initial_loop(int(mesh.face_component[points.faces[0]]), path)
