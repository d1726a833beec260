"""Assertions that every cut must satisfy, independent of the code that cuts."""

import numpy as np

from tests.core.checks import euler_characteristic


def sides(faces):
    """Directed sides of faces, in the orientation of the faces."""
    return faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)


def edges_with_counts(faces):
    return np.unique(np.sort(sides(faces), axis=1), axis=0, return_counts=True)


def assert_valid_cut(mesh, cut, curve=None):
    n_input = len(mesh.vertices)
    np.testing.assert_array_equal(cut.vertices[:n_input], mesh.vertices)
    assert len(np.unique(cut.faces)) == len(np.unique(mesh.faces)) + len(cut.new_face)

    # The surface has not changed.
    assert euler_characteristic(cut.faces) == euler_characteristic(mesh.faces)
    edges, count = edges_with_counts(cut.faces)
    assert count.max() <= max(2, edges_with_counts(mesh.faces)[1].max())
    rim = edges[count == 1]
    rim_length = np.linalg.norm(np.subtract(*cut.vertices[rim.T]), axis=1).sum()
    edges_before, count_before = edges_with_counts(mesh.faces)
    rim_before = edges_before[count_before == 1]
    length_before = np.linalg.norm(np.subtract(*mesh.vertices[rim_before.T]), axis=1).sum()
    assert abs(rim_length - length_before) <= 1e-9 * (1.0 + length_before)
    areas = cut.mesh.face_areas
    assert abs(areas.sum() / mesh.face_areas.sum() - 1.0) < 1e-9
    np.testing.assert_allclose(
        np.bincount(cut.source_face, areas), mesh.face_areas, rtol=1e-7, atol=1e-12 * areas.max()
    )

    # Every part has an area and the orientation of its source face, and lies inside it.
    weights = cut.corner_weights(mesh)
    assert np.linalg.det(weights).min() > 0.0
    assert weights.min() >= 0.0
    np.testing.assert_allclose(weights.sum(axis=2), 1.0, atol=1e-9)

    # Values that are linear on each face are reproduced, even if they differ between faces.
    generator = np.random.default_rng(0)
    linear = mesh.vertices @ generator.normal(size=(3, 2)) + 1.0
    np.testing.assert_allclose(
        cut.at_vertices(mesh, linear)[cut.faces],
        cut.at_corners(mesh, linear[mesh.faces]),
        atol=1e-9 * np.abs(linear).max(),
    )
    positions = cut.at_corners(mesh, mesh.vertices[mesh.faces])
    np.testing.assert_allclose(positions, cut.vertices[cut.faces], atol=1e-9 * mesh.diagonal)
    torn = generator.normal(size=(len(mesh.faces), 3, 2))
    slopes = generator.normal(size=2)
    np.testing.assert_allclose(
        cut.at_corners(mesh, torn) @ slopes, cut.at_corners(mesh, torn @ slopes), atol=1e-9
    )

    # The curve is a chain of edges.
    assert len(np.unique(cut.chain)) == len(cut.chain)
    size = len(cut.vertices)
    keys = np.sort(cut.chain_edges, axis=1) @ [size, 1]
    assert np.isin(keys, edges @ [size, 1]).all()
    assert len(cut.chain_edges) == len(cut.chain) - (not cut.closed)
    if curve is not None:
        assert cut.closed == curve.closed
        off = np.linalg.norm(cut.vertices[cut.chain] - curve.points[cut.chain_point], axis=1)
        assert off.max() < 3e-3 * longest_edge(mesh)


def longest_edge(mesh):
    start, end = mesh.vertices[edges_with_counts(mesh.faces)[0].T]
    return np.linalg.norm(start - end, axis=1).max()


def components_without(faces, chain_edges):
    """Number of components of the faces if some edges do not connect them."""
    forbidden = {tuple(sorted(edge)) for edge in chain_edges.tolist()}
    keys = np.sort(sides(faces), axis=1)
    at_edge = {}
    for place, edge in enumerate(map(tuple, keys.tolist())):
        at_edge.setdefault(edge, []).append(place // 3)
    parent = list(range(len(faces)))

    def root(face):
        while parent[face] != face:
            parent[face] = parent[parent[face]]
            face = parent[face]
        return face

    for edge, beside in at_edge.items():
        if edge not in forbidden:
            for face in beside[1:]:
                parent[root(face)] = root(beside[0])
    return len({root(face) for face in range(len(faces))})
