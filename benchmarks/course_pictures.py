"""Pictures of courses: started by the network, by the search, and the next best ones."""

from __future__ import annotations

import numpy as np

import nicmm_core as nicmm
from nicmm_core.geometry.mesh import Mesh
from nicmm_core.relaxation.curve_nodes import CurveSurface
from nicmm_core.relaxation.elastic_energy import comparable_energies

from . import collections, renders, report
from .evidence import DESIGN, Results
from .portfolio import without_courses
from .samples import random_sets
from .scale import Scale

TITLE = "Courses in pictures"
ROOMS = DESIGN

SEED = 29

ALTERNATIVES = 2

SHEET = "courses.png"


def measure(scale: Scale) -> Results:
    """Render the curves through the same points along several courses."""
    pictures, views, requests = [], [], []
    surfaces = collections.surfaces(scale, scale.choose(6, 2, 1))
    for name, mesh, points in random_sets(surfaces, 1, SEED):
        designer = nicmm.Designer(mesh)
        with without_courses():
            before = designer.design(points, order="shortest")
        after = designer.design(points, order="shortest", alternatives=ALTERNATIVES)
        designs = {"without the search": before, "default": after}
        for number, design in enumerate(after.alternatives, 1):
            designs[f"alternative {number}"] = design
        energies = _energies(mesh, list(designs.values()))
        requests.append({"mesh": name, "energies": dict(zip(designs, energies, strict=True))})
        shown = [
            renders.Picture(
                f"{name}, {label}: {energy / energies[1]:.2f}",
                mesh,
                [(design.curves[0], renders.BLUE if design is after else renders.ORANGE)],
            )
            for (label, design), energy in zip(designs.items(), energies, strict=True)
        ]
        every = [(design.curves[0], renders.BLUE) for design in designs.values()]
        view = renders.best_view(renders.Picture(name, mesh, every))
        none_left = renders.Picture(f"{name}: no other course", mesh, shown[1].curves)
        pictures += [*shown, *[none_left] * (2 + ALTERNATIVES - len(shown))]
        views += [view] * (2 + ALTERNATIVES)
        print(f"  {name}: {requests[-1]['energies']}", flush=True)
    path = report.figures_folder(scale) / SHEET
    renders.render_sheet(pictures, path, scale, columns=2 + ALTERNATIVES, views=views)
    return {
        "seed": SEED,
        "meshes": collections.label(scale),
        "requests": requests,
        "picture": SHEET,
    }


def section(results: Results) -> str:
    """The sheet of pictures."""
    return (
        f"Seed {results['seed']}, {results['meshes']}, closed curves through 3–5 random vertices, "
        "shortest order. One request a row: the course that the initial path and the network find "
        "alone, the default after the search, and `alternatives`. The number is the energy "
        "relative to the default's, on one length scale.\n\n"
        + report.figure(
            results["picture"], "Blue: the default. Orange: other curves through the same points"
        )
    )


def _energies(mesh: Mesh, designs: list[nicmm.Design]) -> list[float]:
    """Energies with one length scale."""
    curves = [each.resumable.curve for each in designs if each.resumable is not None]
    scale = min(curve.length for curve in curves)
    surface = CurveSurface(mesh, mesh.vertices)  # without maps only the nodes count
    energies = [comparable_energies(surface, curve.nodes, 1.0, scale) for curve in curves]
    return [round(float(np.squeeze(energy)), 4) for energy in energies]
