# SPDX-License-Identifier: GPL-3.0-or-later
"""A cache of the core's designers, with their factorisations, for the last meshes.

The redo panel runs the operator again on the same mesh for every change of a setting.
"""

import hashlib
from contextlib import contextmanager

import numpy as np

from .. import preferences

_designers: dict = {}


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
    try:
        yield designer
    finally:
        _keep(fingerprint, designer)


def forget() -> None:
    """Free the memory."""
    _designers.clear()


def _fingerprint(vertices: np.ndarray, faces: np.ndarray) -> bytes:
    digest = hashlib.blake2b(vertices.tobytes())
    digest.update(faces.tobytes())
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
