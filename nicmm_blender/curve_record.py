# SPDX-License-Identifier: GPL-3.0-or-later
"""What a curve object remembers of the surface that it lies on, also in a saved file.

Each point is kept by the three vertices of its triangle and its barycentric coordinates: vertices
keep their numbers when the mesh is moved or deformed, and when the file is opened again.
"""

import numpy as np

from .mesh_data import InputError

KEY = "nicmm_curve"


def remember(curve_object, mesh_object, surface, curves) -> None:
    """Store where the points of curves are on the mesh."""
    curve_object[KEY] = {
        "mesh": mesh_object,
        "vertices": len(surface.local),
        "counts": [len(curve.faces) for curve in curves],
        "closed": [int(curve.closed) for curve in curves],
        "corners": np.concatenate([surface.faces[c.faces] for c in curves]).ravel().tolist(),
        "barycentric": np.concatenate([c.barycentric for c in curves]).ravel().tolist(),
        "control_counts": [len(curve.control_index) for curve in curves],
        "control_index": np.concatenate([c.control_index for c in curves]).tolist(),
    }


def has_record(candidate) -> bool:
    """Whether an object is a curve that was designed on a mesh."""
    return candidate is not None and KEY in candidate


def mesh_of(curve_object):
    """The mesh object that a curve was designed on, or None where it is gone."""
    found = curve_object[KEY].get("mesh")
    return found if found is not None and found.type == "MESH" else None


def recall(curve_object, surface) -> list:
    """The curves of the core that an object remembers, on the mesh as it is now."""
    from .. import nicmm_core as nicmm

    record = curve_object[KEY]
    corners = np.array(record["corners"], dtype=np.int64).reshape(-1, 3)
    barycentric = np.array(record["barycentric"], dtype=np.float64).reshape(-1, 3)
    faces, order = _find_triangles(surface.faces, corners)
    if record["vertices"] > len(surface.local) or (faces < 0).any():
        raise InputError(
            f'The mesh has changed since "{curve_object.name}" was drawn: '
            f"{(faces < 0).sum()} of its {len(faces)} points lie on triangles that are gone. "
            "Draw the curve again"
        )
    barycentric = np.take_along_axis(barycentric, order, axis=1)
    curves, start, control = [], 0, 0
    for count, closed, controls in zip(
        record["counts"], record["closed"], record["control_counts"], strict=True
    ):
        here = slice(start, start + count)
        weights, on = barycentric[here], faces[here]
        points = np.einsum("nj,njk->nk", weights, surface.solved[surface.faces[on]])
        index = np.array(record["control_index"], dtype=np.int64)[control : control + controls]
        curves.append(nicmm.SurfaceCurve(bool(closed), on, weights, points, index))
        start, control = start + count, control + controls
    return curves


def _find_triangles(faces: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The triangle that has three vertices, or -1, and for each of its corners which of these."""
    known = {key: face for face, key in enumerate(map(tuple, np.sort(faces, axis=1).tolist()))}
    keys = map(tuple, np.sort(corners, axis=1).tolist())
    found = np.array([known.get(key, -1) for key in keys], dtype=np.int64)
    order = (faces[found][:, :, None] == corners[:, None, :]).argmax(axis=2)
    return found, order
