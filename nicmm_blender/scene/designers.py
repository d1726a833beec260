# SPDX-License-Identifier: GPL-3.0-or-later
"""Caches the core's designers, with their factorisations, for the most recently used meshes.

The cache pays off because the redo panel runs the operator again, on the same mesh, whenever a
setting changes. The latest designs on each of these meshes are kept, too: an update that starts
from a design, and not only from its curve, knows the weights of before and moves the curve only
near those that have changed.
"""

import hashlib
import weakref
from contextlib import contextmanager

import bpy
import numpy as np
from bpy.app.handlers import persistent

from .. import preferences

_designers: dict = {}
_in_use: dict = {}
"""Designers that are working in time slices; meanwhile others may use only their meshes."""

_fingerprints: dict = {}
"""Fingerprints computed before, by the identity of the arrays."""

_designs = weakref.WeakKeyDictionary()
"""The latest designs by designer, the oldest first."""

MOST_DESIGNS = 32
"""Greatest number of designs that are kept for a mesh."""

SAME_COORDINATES = 1e-12
"""Difference of barycentric coordinates up to which two curves are the same."""


def designer_for(vertices: np.ndarray, faces: np.ndarray):
    """The core's designer for a mesh; a new one only if no designer is kept for these arrays."""
    fingerprint = _fingerprint(vertices, faces)
    designer = _taken(fingerprint, vertices, faces)
    _keep(fingerprint, designer)
    return designer


@contextmanager
def exclusive(vertices: np.ndarray, faces: np.ndarray):
    """Yield the designer for a mesh and do not share it meanwhile; for work in time slices.

    A designer computes one curve at a time, so a caller that waited for a designer whose thread is
    blocked would wait forever.
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
    """The core's mesh of these arrays, even while a designer is working on it."""
    fingerprint = _fingerprint(vertices, faces)
    if fingerprint in _in_use:
        return _in_use[fingerprint].mesh
    return designer_for(vertices, faces).mesh


def keep_design(designer, design) -> None:
    """Keep a design and its alternatives; the oldest designs beyond the limit are dropped.

    Only designs that another one may start from are kept.
    """
    new = [each for each in (design, *design.alternatives) if each.resumable is not None]
    kept = [*_designs.get(designer, []), *new]
    _designs[designer] = kept[-MOST_DESIGNS:]


def design_of(vertices: np.ndarray, faces: np.ndarray, curve):
    """The kept design of a curve of the core on a mesh, or None."""
    designer = _designers.get(_fingerprint(vertices, faces))
    for design in reversed(_designs.get(designer, [])) if designer is not None else ():
        if len(design.curves) == 1 and _is_same(design.curves[0], curve):
            return design
    return None


def _is_same(one, other) -> bool:
    """Whether two curves of the core on the same mesh have the same points."""
    return np.array_equal(one.faces, other.faces) and np.allclose(
        one.barycentric, other.barycentric, rtol=0.0, atol=SAME_COORDINATES
    )


def is_prepared(vertices: np.ndarray, faces: np.ndarray) -> bool:
    """Whether a ray can be cast at a mesh without building its search trees first."""
    fingerprint = _fingerprint(vertices, faces)
    designer = _in_use.get(fingerprint) or _designers.get(fingerprint)
    return designer is not None and "face_trees" in vars(designer.mesh)


def prepare(vertices: np.ndarray, faces: np.ndarray, progress) -> bool:
    """Build the search trees for ray casts; return False if the progress function cancelled it."""
    from ...nicmm_core.progress import CancelledError, watched

    try:
        with watched(progress), exclusive(vertices, faces) as designer:
            _ = designer.mesh.face_trees
    except CancelledError:
        return False
    return True


@persistent
def forget(*_arguments) -> None:
    """Drop all designers and free their memory, also before another file is opened."""
    _designers.clear()
    _fingerprints.clear()


def _fingerprint(vertices: np.ndarray, faces: np.ndarray) -> bytes:
    """A hash of the arrays of a surface, which must never be modified in place."""
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
    """Take the designer for a mesh out of the cache, or create one."""
    from ... import nicmm_core as nicmm

    designer = _designers.pop(fingerprint, None)
    return nicmm.Designer(nicmm.Mesh(vertices, faces)) if designer is None else designer


def _keep(fingerprint: bytes, designer) -> None:
    """Store a designer as the most recently used one, and drop the oldest beyond the limit."""
    _designers[fingerprint] = designer
    while len(_designers) > preferences.kept_meshes():
        del _designers[next(iter(_designers))]


def register() -> None:
    bpy.app.handlers.load_pre.append(forget)


def unregister() -> None:
    bpy.app.handlers.load_pre.remove(forget)
    forget()
