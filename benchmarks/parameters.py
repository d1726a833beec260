"""What the weights of the energy's terms change (Fig. 5)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from nicmm_core.geometry.array_types import FloatArray
from nicmm_core.geometry.curve import SurfaceCurve
from nicmm_core.level_set.losses import LossWeights
from nicmm_core.network.finetuning import BAND_WIDTH, finetune
from nicmm_core.network.trainable_network import CurveNetwork, load_network

from . import collections, plots, renders, report
from .evidence import Results
from .measures import bending
from .scale import Scale
from .solving import (
    PARTS_WITHOUT,
    Sample,
    designed_curve,
    random_samples,
    relative_distances,
    significant,
    without_early_stop,
)

TITLE = "Weights of the energy (Fig. 5)"
WITHOUT = PARTS_WITHOUT

SEED = 4

FACTORS = (0.01, 0.1, 1.0, 10.0, 100.0)
"""Of each weight, relative to what a design takes."""

NAMES = {"sdf": "λ_sdf", "smooth": "λ_smooth"}

MEASURED = ("mean", "greatest", "bending", "slope")
"""Of each curve: distances to the default one, L ∮ κ_g² ds, and the median of |∇φ| beside it."""

SIMILAR = 1.0
"""Mean distance in percent of the diagonal up to which curves count as quite similar."""

REASONABLE = (0.1, 10.0)
"""Factors that the paper's "reasonable range" is taken to mean."""

STILLS = "parameters_curves.png"
SHOWN = {0.01: renders.WHITE, 1.0: renders.BLUE, 100.0: renders.GREEN}
"""As in Fig. 5: white, blue and green while the weight grows."""


Key = tuple[str, float]
"""A weight and its factor."""


def measure(scale: Scale) -> Results:
    """Vary one weight at a time over decades."""
    network = load_network()
    iterations = scale.choose(200, 40, 20)
    meshes = collections.surfaces(scale, scale.choose(6, 1))
    varied: list[Results] = []
    pictures: list[renders.Picture] = []
    for sample in random_samples(meshes, 1, SEED):
        fields = _fields(network, sample, iterations)
        curves = {key: designed_curve(sample, field) for key, field in fields.items()}
        varied.append(
            {
                "mesh": sample.name,
                "smooth": significant(sample.weights.smooth),
                "outcomes": _outcomes(sample, fields, curves),
            }
        )
        if not pictures:
            pictures = _pictures(sample, {key: curve for key, (curve, _) in curves.items()})
        print(f"  {sample.name}", flush=True)
    if not varied:
        raise SystemExit("No set had a simple loop through its points; there is nothing to vary")
    renders.render_sheet(pictures, report.figures_folder(scale) / STILLS, scale)
    return {
        "seed": SEED,
        "collection": collections.label(scale),
        "iterations": iterations,
        "weights": {"sdf": LossWeights().sdf, "smooth": LossWeights().smooth},
        "factors": list(FACTORS),
        "varied": varied,
        "stills": STILLS,
    }


def section(results: Results) -> str:
    """What each factor changes, and whether that agrees with the paper."""
    varied, weights = results["varied"], results["weights"]
    lowered = [of_mesh["smooth"] for of_mesh in varied]
    plot = report.figure(
        "parameters.png", "Medians over the meshes, against the factor of each weight"
    )
    stills = report.figure(
        results["stills"],
        "Curves with 0.01 (white), 1 (blue) and 100 times (green) each weight (Fig. 5)",
    )
    return (
        f"Seed {results['seed']}, one set of 3–5 random vertices a mesh, shortest order, on "
        f"{len(varied)} meshes ({results['collection']}: "
        f"{report.listed(of_mesh['mesh'] for of_mesh in varied)}), shipped weights, "
        f"{results['iterations']} "
        "iterations without early stop, since its thresholds carry the weights' unit. The factors "
        f"are of the λ that a design takes: λ_sdf = {weights['sdf']:g}, λ_smooth = "
        f"{weights['smooth']:g} or, where bending would outweigh the slope, less "
        f"({min(lowered):.2g} to {max(lowered):.2g} here). A design never takes the larger "
        "λ_smooth below, which is what that limit is for. Distances are to the curve of factor 1, "
        "in percent of the bounding box's diagonal; medians over the meshes.\n\n"
        f"{_table(results)}\n\n{_findings(results)}\n\n{plot}\n\n{stills}"
    )


def draw(results: Results, folder: Path) -> None:
    """Draw the medians against the factors."""
    figure, axes = plots.labelled_row(
        "factor of the weight",
        {
            "Distance to the default": "mean distance (% of the diagonal)",
            "Bending": "L ∮ κ_g² ds",
            "Slope": "|∇φ| near the curve",
        },
    )
    factors = results["factors"]
    for place, name in zip(axes, ("mean", "bending", "slope"), strict=True):
        for weight, label in NAMES.items():
            values = [_median(results, weight, factor, name) for factor in factors]
            place.plot(factors, values, "o-", label=label)
        place.set_xscale("log")
        place.set_xticks(factors, [f"{factor:g}" for factor in factors])
        place.minorticks_off()
        place.set_ylim(bottom=0.0)
        place.legend()
    plots.save(figure, folder / "parameters.png")


def _fields(network: CurveNetwork, sample: Sample, iterations: int) -> dict[Key, FloatArray]:
    """φ for each weight and factor; both have factor 1 in common."""
    fields: dict[Key, FloatArray] = {}
    config = without_early_stop(iterations)
    default = finetune(network, sample.problem, sample.weights, config).field
    for weight in NAMES:
        for factor in FACTORS:
            if factor == 1.0:
                fields[weight, factor] = default
                continue
            changed = replace(sample.weights, **{weight: factor * getattr(sample.weights, weight)})
            fields[weight, factor] = finetune(network, sample.problem, changed, config).field
    return fields


def _outcomes(
    sample: Sample, fields: dict[Key, FloatArray], curves: dict[Key, tuple[SurfaceCurve, bool]]
) -> list[Results]:
    """What results keep of the curves, with the distance to that of the default weights."""
    outcomes = []
    for (weight, factor), (curve, by_itself) in curves.items():
        reference, _ = curves[weight, 1.0]
        mean, greatest = relative_distances(sample, curve, reference)
        outcomes.append(
            {
                "weight": weight,
                "factor": factor,
                "by_itself": bool(by_itself),
                "mean": significant(mean),
                "greatest": significant(greatest),
                "bending": significant(bending(sample.mesh, curve)),
                "slope": significant(_slope(sample, fields[weight, factor])),
            }
        )
    return outcomes


def _pictures(sample: Sample, curves: dict[Key, SurfaceCurve]) -> list[renders.Picture]:
    return [
        renders.Picture(
            f"{sample.name}, {name}",
            sample.mesh,
            [(curves[weight, factor], colour) for factor, colour in SHOWN.items()],
        )
        for weight, name in NAMES.items()
    ]


def _slope(sample: Sample, field: FloatArray) -> float:
    """Median of |∇φ|, by area, over the faces that the zero set passes at close range.

    The band is measured in steps along the surface and not by |φ|, which a flat φ has small
    everywhere.
    """
    elements = sample.problem.elements
    slope = np.linalg.norm((elements.gradient @ field).reshape(3, -1), axis=0)
    working = sample.problem.working
    on_faces = field[working.faces]
    crossed = (on_faces.min(axis=1) < 0.0) & (on_faces.max(axis=1) >= 0.0)
    near = np.zeros(len(working.vertices), dtype=bool)
    near[working.faces[crossed]] = True
    for _ in range(int(0.5 * BAND_WIDTH)):
        near[working.faces[near[working.faces].any(axis=1)]] = True
    band = near[working.faces].all(axis=1)
    return float(np.median(slope[band])) if band.any() else float("nan")


def _found(results: Results, weight: str, factor: float) -> list[Results]:
    """The outcomes with one choice of weights, one for each mesh."""
    return [
        outcome
        for of_mesh in results["varied"]
        for outcome in of_mesh["outcomes"]
        if (outcome["weight"], outcome["factor"]) == (weight, factor)
    ]


def _median(results: Results, weight: str, factor: float, name: str) -> float:
    """Over the meshes where there is a value."""
    values = [outcome[name] for outcome in _found(results, weight, factor)]
    return float(np.nanmedian(np.array(values, dtype=np.float64)))


def _table(results: Results) -> str:
    rows = []
    for weight, label in NAMES.items():
        for factor in results["factors"]:
            found = _found(results, weight, factor)
            medians = {name: _median(results, weight, factor, name) for name in MEASURED}
            rows.append(
                (
                    f"{factor:g} × {label}",
                    "–" if factor == 1.0 else f"{medians['mean']:.2f}",
                    "–" if factor == 1.0 else f"{medians['greatest']:.2f}",
                    f"{medians['bending']:.0f}",
                    f"{medians['slope']:.2f}",
                    f"{sum(outcome['by_itself'] for outcome in found)} of {len(found)}",
                )
            )
    header = (
        "weight", "mean distance", "greatest distance", "L ∮ κ_g² ds", "\\|∇φ\\| near the curve",
        "one loop by itself",
    )  # fmt: skip
    return report.table(header, rows)


def _findings(results: Results) -> str:
    """What the table says, in words."""
    factors = results["factors"]
    text = (
        "The paper says of Fig. 5, without numbers, that the curves “remain quite similar” within "
        "a reasonable range. "
    )
    for weight, name in NAMES.items():
        means = {f: _median(results, weight, f, "mean") for f in factors if f != 1.0}
        inner = max(means[factor] for factor in REASONABLE)
        outer = max(means.values())
        verdict = "which agrees" if inner <= SIMILAR else "which contradicts the paper"
        text += (
            f"A factor of 10 on {name} either way moves the curve by at most {inner:.2f} % on "
            f"average (median over the meshes), {verdict}; a factor of 100 by up to {outer:.2f} %. "
        )
    pairs = [
        abs(_median(results, "sdf", f, "mean") - _median(results, "smooth", inverse, "mean"))
        for f, inverse in zip(factors, factors[::-1], strict=True)
    ]
    text += (
        "\n\nOnly the ratio of both weights counts, since φ is exactly zero at the points and "
        "AdamW does not see a common factor: a factor on λ_sdf and its inverse on λ_smooth give "
        f"mean distances that differ by at most {max(pairs):.2f} % here."
    )
    low, high = (_median(results, "smooth", f, "bending") for f in (factors[0], factors[-1]))
    slope = _median(results, "smooth", factors[-1], "slope")
    change = "less" if high < low else "no less"
    text += (
        f" From {factors[0]:g} to {factors[-1]:g} times λ_smooth the curve bends {change} "
        f"({low:.0f} to {high:.0f}), and |∇φ| beside it ends at {slope:.2f} instead of 1"
    )
    if slope < 0.5:
        text += (
            ": φ flattens rather than giving a fairer curve, since a smaller slope lowers (Δφ)² too"
        )
    kept = [not outcome["by_itself"] for each in results["varied"] for outcome in each["outcomes"]]
    return text + (
        f". In {100 * np.mean(kept):.0f} % of all runs the level set was not one loop by itself "
        "and follows φ₀ where it would split; such parts are alike whatever the weights are."
    )
