"""Named requests on generated shapes, whose energies are kept in the repository.

python -m tests.oracles.energies    measure all energies and keep them
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.array_types import IntArray
from nicmm_core.geometry.mesh import Mesh
from nicmm_core.mapped_surface import MappedSurface
from nicmm_core.relaxation.curve_energies import energies_of

from . import same_surface
from .defects import defective_meshes

KEPT = Path(__file__).with_name("energies.json")

CREATURES = range(12)
"""Seeds of the creatures, each asked for a closed and an open curve."""

DEFECTS = (
    "hole",
    "duplicate faces",
    "collapsed edges",
    "caps",
    "soup",
    "seam",
    "fins",
    "touching at vertices",
    "needles at vertices",
    "faces turned over",
    "fans without area",
    "caps of height 1e-07",
)


@dataclass(frozen=True)
class NamedRequest:
    """A request with a name.

    Attributes
    ----------
    name : str
    mesh : Mesh
    points : (k,) int array
        Vertices of the control points.
    options : dict
        Keyword arguments of `nicmm_core.design_curve`.
    """

    name: str
    mesh: Mesh
    points: IntArray
    options: dict[str, Any] = field(default_factory=dict)

    def energy(self) -> float:
        """Elastic energy of the curve with its maps; L ∮ κ_g² ds + 4π² by default."""
        design = nicmm.design_curve(self.mesh, self.points, **self.options)
        assert design.resumable is not None
        mesh, request = design.resumable.mesh, design.resumable.request
        surface = MappedSurface(mesh).of(request)
        return energies_of(surface, [design.resumable.curve], request.smoothness)[0]


def named_requests() -> Iterator[NamedRequest]:
    """All requests, in a fixed order."""
    yield from _on_creatures()
    yield from _on_simple_shapes()
    yield from _with_maps()
    yield from _with_other_bending()
    yield from _on_defects()


def _on_creatures() -> Iterator[NamedRequest]:
    for seed in CREATURES:
        mesh = shapes.creature(seed, resolution=40, faces=400)
        for closed in (True, False):
            points = _points(mesh, 4, seed)
            options = {"closed": closed, "order": "shortest"}
            yield NamedRequest(f"creature {seed}, {_kind(closed)}", mesh, points, options)


def _on_simple_shapes() -> Iterator[NamedRequest]:
    ball = shapes.sphere(3)
    meshes = {
        "ball": ball,
        "egg": Mesh(ball.vertices * [1.0, 0.7, 1.5], ball.faces),
        "disc": shapes.disc(10),
        "torus": shapes.torus(around=36, across=18),
        "cube of 12 faces": shapes.cube(1),
        "cube": shapes.cube(6),
        "Möbius strip": shapes.moebius_strip(),
    }
    for name, mesh in meshes.items():
        for closed in (True, False):
            if closed and name == "Möbius strip":
                continue
            options = {"closed": closed, "order": "shortest"}
            yield NamedRequest(f"{name}, {_kind(closed)}", mesh, _points(mesh, 4, 7), options)


def _with_maps() -> Iterator[NamedRequest]:
    for seed in range(6):
        mesh = shapes.creature(20 + seed, resolution=40, faces=400)
        points = _points(mesh, 3, seed)
        middle = mesh.vertices[points].mean(axis=0)
        distance = np.linalg.norm(mesh.vertices - middle, axis=1)
        weights = np.clip(1.0 - 8.0 * distance / distance.max(), 0.0, 0.9)
        weights[points] = 0.0
        for option in ("obstacles", "alignment"):
            options = {"order": "shortest", option: weights}
            yield NamedRequest(f"creature {20 + seed}, {option}", mesh, points, options)


def _with_other_bending() -> Iterator[NamedRequest]:
    for seed in range(30, 33):
        mesh = shapes.creature(seed, resolution=40, faces=400)
        points = _points(mesh, 4, seed)
        for name, value in {"corners": [0, 2], "normal_bending": 0.5}.items():
            options = {"order": "shortest", name: value}
            yield NamedRequest(f"creature {seed}, {name}", mesh, points, options)


def _on_defects() -> Iterator[NamedRequest]:
    meshes = dict(defective_meshes())
    for name in DEFECTS:
        options = {"order": "shortest"}
        yield NamedRequest(name, meshes[name], _points(meshes[name], 4, 3), options)
    body = shapes.creature(1, resolution=40, faces=400)
    for name in same_surface.CHAINS:
        changed = same_surface.changed(body, name, 1)
        points = changed.number[_points(body, 4, 1)]
        yield NamedRequest(f"creature 1, {name}", changed.mesh, points, {"order": "shortest"})


def _points(mesh: Mesh, count: int, seed: int) -> IntArray:
    vertices = np.flatnonzero(mesh.referenced)
    return np.random.default_rng(seed).choice(vertices, count, replace=False)


def _kind(closed: bool) -> str:
    return "closed" if closed else "open"


def kept_energies() -> dict[str, float]:
    """The energies in the repository, by the name of the request."""
    energies: dict[str, float] = json.loads(KEPT.read_text(encoding="utf-8"))
    return energies


def main() -> None:
    """Measure all energies and write them to the repository."""
    before = kept_energies() if KEPT.is_file() else {}
    energies = {}
    for request in named_requests():
        energies[request.name] = round(request.energy(), 4)
        old = before.get(request.name)
        if old is None or abs(energies[request.name] - old) > 1e-3 * old:
            print(f"{request.name}: {energies[request.name]:.2f}, before {old}", flush=True)
    KEPT.write_text(json.dumps(energies, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
