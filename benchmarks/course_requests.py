"""Requests for which different courses are compared, and energies of curves on any length scale."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain

import numpy as np

import nicmm_core as nicmm
from nicmm_core.geometry.array_types import FloatArray, IntArray
from nicmm_core.geometry.mesh import Mesh
from nicmm_core.relaxation.elastic_energy import bending_energy

from . import collections
from .samples import random_sets
from .scale import Scale

SEED = 23

KIND = {True: "closed", False: "open"}


@dataclass(frozen=True)
class Asked:
    """A request for a curve through points of a mesh, in the shortest order, and its number."""

    mesh_name: str
    mesh: Mesh
    points: IntArray
    closed: bool
    number: int

    @property
    def name(self) -> str:
        """The mesh, and whether the curve is closed."""
        return f"{self.mesh_name}, {KIND[self.closed]}"


def every_request(scale: Scale) -> Iterator[Asked]:
    """A closed and an open curve on each of many meshes."""
    surfaces = collections.surfaces(scale, scale.choose(48, 4, 1))
    if scale is not Scale.SMOKE:
        others = (collections.clean(scale.choose(12, 2)), collections.bodies(scale.choose(8, 1)))
        surfaces = chain(surfaces, *others)
    for number, (name, mesh, points) in enumerate(random_sets(surfaces, 1, SEED)):
        for closed in (True, False):
            yield Asked(name, mesh, points, closed, number)


@dataclass(frozen=True)
class Similarity:
    """x ↦ factor · matrix x + shift, with an orthogonal matrix."""

    matrix: FloatArray
    factor: float = 1.0
    shift: FloatArray | float = 0.0

    def done(self, positions: FloatArray) -> FloatArray:
        """Positions, (n, 3), after it."""
        return self.factor * positions @ self.matrix.T + self.shift

    def undone(self, positions: FloatArray) -> FloatArray:
        """Positions, (n, 3), before it."""
        return (positions - self.shift) @ self.matrix / self.factor


UNCHANGED = Similarity(np.eye(3))


@dataclass(frozen=True)
class Answer:
    """∮ κ_g² ds and the length of a curve, and its points, in the units of the unchanged mesh."""

    bending: float
    length: float
    points: FloatArray


def answered(design: nicmm.Design, change: Similarity = UNCHANGED) -> Answer:
    """A design on a mesh after a similarity."""
    assert design.resumable is not None  # `elastic` relaxes every curve
    curve, whole = design.resumable.curve, design.curves[0]
    factor = curve.length / whole.length * change.factor  # the curve has units of its own
    bending = float(bending_energy(curve.nodes)) * factor
    return Answer(bending, curve.length / factor, change.undone(whole.points))


def energy(bending: float, length: float, scale: float) -> float:
    """Energy of a curve on a length scale, as `comparable_energies` defines it without maps."""
    return scale * bending + 4.0 * math.pi**2 * length / scale
