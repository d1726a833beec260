# SPDX-License-Identifier: GPL-3.0-or-later
"""Keeps the core's factorisations of the last meshes.

The redo panel runs the operator again for every change of a setting, on the same mesh.
"""

import hashlib
from contextlib import contextmanager

import numpy as np

from .. import preferences

_designers: dict = {}


def designer_for(vertices: np.ndarray, faces: np.ndarray):
    """The core's designer for a mesh, made anew only where the mesh has changed."""
    fingerprint = _fingerprint(vertices, faces)
    designer = _taken(fingerprint, vertices, faces)
    _keep(fingerprint, designer)
    return designer


@contextmanager
def lent(vertices: np.ndarray, faces: np.ndarray):
    """The same for work by turns: nobody else gets this designer until it is given back.

    A designer works on one curve at a time, and who waited for one that is parked would do so for
    ever.
    """
    fingerprint = _fingerprint(vertices, faces)
    designer = _taken(fingerprint, vertices, faces)
    try:
        yield designer
    finally:
        _keep(fingerprint, designer)


def forget() -> None:
    """Give the memory back."""
    _designers.clear()


def _fingerprint(vertices: np.ndarray, faces: np.ndarray) -> bytes:
    digest = hashlib.blake2b(vertices.tobytes())
    digest.update(faces.tobytes())
    return digest.digest()


def _taken(fingerprint: bytes, vertices: np.ndarray, faces: np.ndarray):
    """The designer for a mesh, which is kept no longer."""
    from ... import nicmm_core as nicmm

    designer = _designers.pop(fingerprint, None)
    return nicmm.Designer(nicmm.Mesh(vertices, faces)) if designer is None else designer


def _keep(fingerprint: bytes, designer) -> None:
    """Keep a designer as the most recently used, and not too many."""
    _designers[fingerprint] = designer
    while len(_designers) > preferences.kept_meshes():
        del _designers[next(iter(_designers))]
