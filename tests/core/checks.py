"""What every curve must fulfil, judged from arrays alone, and helpers that several tests share.

Nothing here looks behind the public interface: a mesh is its vertices and faces, a curve its
points, faces, barycentrics and control indices.
"""

from itertools import combinations

import numpy as np

import nicmm_core as nicmm

ROUNDING = 1e-12
"""Of barycentric coordinates, and of positions relative to the bounding-box diagonal."""


def assert_valid_curve(mesh, curve, control_positions=None, closed=True):
    """A curve on the surface, simple, through the control points in order."""
    assert_lies_on_surface(mesh, curve)
    assert curve.closed == closed
    assert len(curve.points) >= 3
    assert_does_not_touch_itself(mesh, curve)
    if control_positions is not None:
        assert_visits(mesh, curve, control_positions)


def assert_valid_design(mesh, design, control_positions=None, closed=True):
    """A usable result: one valid curve, a finite field and every term of the energy."""
    assert design.status in (nicmm.Status.CONVERGED, nicmm.Status.ITERATION_LIMIT), design.status
    assert len(design.curves) == 1
    assert_valid_curve(mesh, design.curves[0], control_positions, closed)
    assert design.field.shape == (len(mesh.vertices),)
    assert np.isfinite(design.field).all()
    assert set(design.energy) == {"sdf", "int", "smooth", "fea"}
    assert all(np.isfinite(value) and value >= 0.0 for value in design.energy.values())
    assert isinstance(design.iterations, int) and design.iterations > 0
    assert design.seconds > 0.0


def assert_lies_on_surface(mesh, curve):
    """Points are what their barycentrics say, and neighbours share a face."""
    n = len(curve.points)
    assert curve.points.shape == curve.barycentric.shape == (n, 3)
    assert curve.faces.shape == (n,)
    assert np.issubdtype(curve.faces.dtype, np.integer)
    assert curve.faces.min() >= 0 and curve.faces.max() < len(mesh.faces)
    assert np.isfinite(curve.points).all()
    assert (curve.barycentric >= 0.0).all()
    np.testing.assert_allclose(curve.barycentric.sum(axis=1), 1.0, rtol=0, atol=ROUNDING)
    corners = mesh.vertices[mesh.faces[curve.faces]]
    combined = sum(curve.barycentric[:, [j]] * corners[:, j] for j in range(3))
    size = np.abs(corners).max()
    np.testing.assert_allclose(curve.points, combined, rtol=0, atol=4 * np.finfo(float).eps * size)
    for here, there, common in _segments(mesh, curve):
        assert common, f"points {here} and {there} lie on no common face"


def assert_does_not_touch_itself(mesh, curve):
    """No point twice and no two segments that cross."""
    places = [tuple(sorted(place.items())) for place in _places(mesh, curve)]
    assert len(set(places)) == len(places), "the curve passes a point twice"
    # Two strands can only cross in the interior of a face: crossing at a vertex or on an edge,
    # they would have a point there in common.
    in_face = {}
    for here, there, common in _segments(mesh, curve):
        for face in common:
            in_face.setdefault(face, []).append((here, there))
    for face, segments in in_face.items():
        flat = {
            point: _in_face(mesh, curve, face, point) for segment in segments for point in segment
        }
        for first, second in combinations(segments, 2):
            if not set(first) & set(second):
                ends = [flat[point] for point in (*first, *second)]
                assert not _cross(*ends), f"segments {first} and {second} cross in face {face}"


def assert_visits(mesh, curve, control_positions):
    """Control points are polyline points, met in the order of the positions given."""
    control_positions = np.asarray(control_positions)
    assert curve.control_index.shape == (len(control_positions),)
    assert (curve.control_index >= 0).all()
    np.testing.assert_allclose(
        curve.points[curve.control_index],
        control_positions,
        rtol=0,
        atol=ROUNDING * np.linalg.norm(np.ptp(mesh.vertices, axis=0)),
    )
    if not curve.closed:
        assert curve.control_index[0] == 0 and curve.control_index[-1] == len(curve.points) - 1
        assert (np.diff(curve.control_index) > 0).all(), "control points are met out of order"
        return
    ahead = np.roll(curve.control_index, -1) > curve.control_index
    assert len(set(curve.control_index.tolist())) == len(curve.control_index)
    # Walking round once, the index falls back only where the walk passes the polyline's start.
    assert (~ahead).sum() == 1, f"control points are met out of order: {curve.control_index}"


def random_surface_points(mesh, count, seed):
    """Points strictly inside random faces, no two in one face."""
    generator = np.random.default_rng(seed)
    faces = generator.choice(len(mesh.faces), size=count, replace=False)
    barycentric = generator.dirichlet([2.0, 2.0, 2.0], size=count)
    return nicmm.SurfacePoints(faces, barycentric)


def euler_characteristic(faces):
    """V - E + F of the vertices that faces use."""
    sides = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    return len(np.unique(faces)) - len(np.unique(sides, axis=0)) + len(faces)


def nearest_vertices(mesh, positions):
    """Index of the vertex nearest to each position."""
    offset = mesh.vertices[None] - np.asarray(positions)[:, None]
    return np.linalg.norm(offset, axis=2).argmin(axis=1)


def circle(angles, radius=1.0):
    """Points of a circle about the origin in the xy plane."""
    angles = np.asarray(angles)
    return radius * np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=1)


def apart(first, second):
    """Farthest that either closed polyline (n, 3) strays from the other."""
    return max(_farthest(first, second), _farthest(second, first))


def _farthest(points, polyline):
    start = polyline[None]
    step = np.roll(polyline, -1, axis=0)[None] - start
    offset = points[:, None] - start
    along = np.clip((offset * step).sum(axis=2) / (step**2).sum(axis=2), 0.0, 1.0)
    return np.linalg.norm(offset - along[:, :, None] * step, axis=2).min(axis=1).max()


def mean_edge_length(mesh):
    """Mean length of the sides of all faces."""
    corners = mesh.vertices[mesh.faces]
    return float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean())


def joined(*meshes):
    """Several meshes as one with several components."""
    offsets = np.cumsum([0, *[len(mesh.vertices) for mesh in meshes[:-1]]])
    return nicmm.Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + o for mesh, o in zip(meshes, offsets, strict=True)]),
    )


def _places(mesh, curve):
    """Each point as {vertex: weight} without zeros: what it is regardless of the face named."""
    return [
        {int(v): float(w) for v, w in zip(mesh.faces[face], weights, strict=True) if w > 0.0}
        for face, weights in zip(curve.faces, curve.barycentric, strict=True)
    ]


def _segments(mesh, curve):
    """Index of both ends of every segment and the faces that hold both."""
    faces_at = {}
    for face, corners in enumerate(mesh.faces.tolist()):
        for corner in corners:
            faces_at.setdefault(corner, set()).add(face)
    carriers = [
        set.intersection(*(faces_at[vertex] for vertex in place)) for place in _places(mesh, curve)
    ]
    n = len(carriers)
    ends = [(i, (i + 1) % n) for i in range(n if curve.closed else n - 1)]
    return [(here, there, carriers[here] & carriers[there]) for here, there in ends]


def _in_face(mesh, curve, face, point):
    """Two coordinates of a point in the plane of a face that holds it."""
    weight = dict(
        zip(mesh.faces[curve.faces[point]].tolist(), curve.barycentric[point], strict=True)
    )
    first, second, _ = mesh.faces[face].tolist()
    return np.array([weight.get(first, 0.0), weight.get(second, 0.0)])


def _cross(a, b, c, d):
    """Whether segments ab and cd cross between their ends."""

    def turn(p, q, r):
        area = (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
        return 0 if abs(area) < 1e-15 else int(np.sign(area))

    return turn(a, b, c) * turn(a, b, d) < 0 and turn(c, d, a) * turn(c, d, b) < 0
