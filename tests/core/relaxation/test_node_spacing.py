"""Where nodes go on a polyline, against strips whose folds are known."""

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core.relaxation.curve_nodes import CurveSurface, folded_back, unsigned_normals
from nicmm_core.relaxation.elastic_energy import bending_energy
from nicmm_core.relaxation.exact_curve import drawn, exact_curve
from nicmm_core.relaxation.node_spacing import arc_lengths, node_arcs
from nicmm_core.relaxation.relaxing import RelaxationConfig, relax
from tests.core.checks import assert_valid_curve, circle, curve_through, grid

ANGLES = np.arange(40) * 2 * np.pi / 40


def folded_strip(columns: int = 48, pushed: tuple[int, ...] = (24,), by: float = 1.6) -> nicmm.Mesh:
    """A flat strip of unit squares; pushed columns of vertices lie beyond the next one."""
    x, y = np.meshgrid(np.arange(columns + 1.0), np.arange(5.0), indexing="ij")
    x[list(pushed)] += by
    vertices = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    return nicmm.Mesh(vertices, grid(columns, 4))


def crossing_the_folds(mesh: nicmm.Mesh, row: float = 1.7) -> nicmm.SurfaceCurve:
    """A straight open way along the strip, through every fold, forth and back and forth."""
    x = mesh.vertices.reshape(-1, 5, 3)[:, 0, 0]
    faces, barycentric = [], []
    quads = (len(mesh.faces) // 4) // 2
    for column in range(quads):
        for face in np.flatnonzero(
            (mesh.vertices[mesh.faces].min(axis=1)[:, 0] == min(x[column], x[column + 1]))
            & (mesh.vertices[mesh.faces].max(axis=1)[:, 0] == max(x[column], x[column + 1]))
        ):
            corners = mesh.vertices[mesh.faces[face]]
            if not corners[:, 1].min() < row < corners[:, 1].max():
                continue
            faces.append(face)
    raise NotImplementedError
