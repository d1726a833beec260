# SPDX-License-Identifier: GPL-3.0-or-later
"""A cache of the core's designers, with their factorisations, for the last meshes.

The redo panel runs the operator again on the same mesh for every change of a setting.
"""

import hashlib
import weakref
from contextlib import contextmanager

import numpy as np

from .. import preferences

_designers: dict = {}
_in_use: dict = {}
"""Those of work in time slices; only their meshes may be used."""

_fingerprints: dict = {}
"""Of the arrays that were asked for before, by their addresses."""


def designer_for(vertices: np.ndarray, faces: np.ndarray):
    """The core's designer for a mesh, created only if the mesh has changed."""
    fingerprint = _fingerprint(vertices, faces)
    designer = _taken(fingerprint, vertices, faces)
    _keep(fingerprint, designer)
    return designer


@contextmanager
def exclusive(vertices: np.ndarray, faces: np.ndarray):
    """Yield the designer for a mesh, without sharing it meanwhile; for work in time slices.

    A designer works on one curve at a time: a caller that waited for one whose thread is blocked
    would wait for ever.
    """
    fingerprint = _fingerprint(vertices, faces)
    designer = _taken(fingerprint, vertices, faces)
    _in_use[fingerprint] = designer
    try:
        yield designer
    finally:
        _in_use.pop(fingerprint, None)
        _keep(fingerprint, designer)


def mesh_for(vertices: np.ndarray, faces: np.ndarray):
    """The core's mesh of these arrays, also while a designer works on it."""
    fingerprint = _fingerprint(vertices, faces)
    if fingerprint in _in_use:
        return _in_use[fingerprint].mesh
    return designer_for(vertices, faces).mesh


def is_prepared(vertices: np.ndarray, faces: np.ndarray) -> bool:
    """Whether a ray can be cast at a mesh at once."""
    fingerprint = _fingerprint(vertices, faces)
    designer = _in_use.get(fingerprint) or _designers.get(fingerprint)
    return designer is not None and "face_trees" in vars(designer.mesh)


def prepare(vertices: np.ndarray, faces: np.ndarray, progress) -> bool:
    """Compute what a ray needs; False if the progress function has cancelled it."""
    from ...nicmm_core.progress import CancelledError, watched

    try:
        with watched(progress), exclusive(vertices, faces) as designer:
            _ = designer.mesh.face_trees
    except CancelledError:
        return False
    return True


def forget() -> None:
    """Free the memory."""
    _designers.clear()
    _fingerprints.clear()


def _fingerprint(vertices: np.ndarray, faces: np.ndarray) -> bytes:
    """A hash of the arrays of a surface, which nobody changes."""
    address = id(vertices), id(faces)
    known = _fingerprints.get(address)
    if known is not None and known[0]() is vertices and known[1]() is faces:
        return known[2]
    digest = hashlib.blake2b(vertices.tobytes())
    digest.update(faces.tobytes())
    for gone in [key for key, kept in _fingerprints.items() if kept[0]() is None]:
        del _fingerprints[gone]
    _fingerprints[address] = weakref.ref(vertices), weakref.ref(faces), digest.digest()
    return digest.digest()


def _taken(fingerprint: bytes, vertices: np.ndarray, faces: np.ndarray):
    """Remove the designer for a mesh from the cache, or create one."""
    from ... import nicmm_core as nicmm

    designer = _designers.pop(fingerprint, None)
    return nicmm.Designer(nicmm.Mesh(vertices, faces)) if designer is None else designer


def _keep(fingerprint: bytes, designer) -> None:
    """Store a designer as the most recently used, and drop the oldest ones."""
    _designers[fingerprint] = designer
    while len(_designers) > preferences.kept_meshes():
        del _designers[next(iter(_designers))]
