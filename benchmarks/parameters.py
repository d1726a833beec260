"""Measures how the weights of the energy terms affect the curve (Fig. 5)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from nicmm_core.geometry.curve import SurfaceCurve
from nicmm_core.paper.fitting import fit
from nicmm_core.paper.losses import LossWeights
from nicmm_core.paper.network import Network
from nicmm_core.paper.solution import Solution
from nicmm_core.paper.weights_file import load_network

from . import collections, plots, renders, report
from .evidence import NETWORK, Results
from .measures import bending
from .scale import Scale
from .solving import (
    Sample,
    designed_curve,
    random_samples,
    relative_distances,
    significant,
    without_early_stop,
)

TITLE = "Weights of the energy (Fig. 5)"
ROOMS = NETWORK

SEED = 4

FACTORS = (0.01, 0.1, 1.0, 10.0, 100.0)
"""Factors of each weight, relative to the value that a design uses."""

NAMES = {"sdf": "λ_sdf", "smooth": "λ_smooth"}

MEASURED = ("mean", "greatest", "bending")
"""Values per curve: distances to the default one, and bending."""

SIMILAR = 1.0
"""Mean distance, in percent of the diagonal, up to which curves count as quite similar."""

REASONABLE = (0.1, 10.0)
"""Factors that are taken as the bounds of the paper's "reasonable range"."""

STILLS = "parameters_curves.png"
SHOWN = {0.01: renders.WHITE, 1.0: renders.BLUE, 100.0: renders.GREEN}
"""Colours as in Fig. 5: white, blue and green for increasing weight."""


Key = tuple[str, float]
"""Name of a weight, and its factor."""


def measure(scale: Scale) -> Results:
    """Vary one weight at a time over several decades."""
    network = load_network()
    iterations = scale.choose(50, 20, 5)
    meshes = collections.surfaces(scale, scale.choose(6, 1))
    varied: list[Results] = []
    pictures: list[renders.Picture] = []
    for sample in random_samples(meshes, 1, SEED):
        solutions = _solutions(network, sample, iterations)
        curves = {key: designed_curve(sample, each.field) for key, each in solutions.items()}
        varied.append(
            {
                "mesh": sample.name,
                "smooth": significant(sample.weights.smooth),
                "outcomes": _outcomes(sample, solutions, curves),
            }
        )
        if not pictures:
            pictures = _pictures(sample, curves)
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
    """Effect of each factor, and whether it agrees with the paper."""
    varied, weights = results["varied"], results["weights"]
    lowered = [of_mesh["smooth"] for of_mesh in varied]
    plot = report.figure(
        "parameters.png", "Medians over the meshes against the factor of each weight"
    )
    stills = report.figure(
        results["stills"],
        "Curves with 0.01 (white), 1 (blue) and 100 (green) times each weight (Fig. 5)",
    )
    return (
        "The weights λ_sdf and λ_smooth of the energy were multiplied by factors, one weight at a "
        "time, to see how much the curve of `nicmm` depends on them, as in Fig. 5 of the "
        "paper. Each row is a factor and a weight. Distances are mean and greatest distances to "
        "the curve with factor 1, in percent of the bounding box diagonal; all values are medians "
        f"over {len(varied)} meshes, with one set of 3–5 random vertices per mesh (seed "
        f"{results['seed']}, shortest order). The factors multiply the weights that a design uses: "
        f"λ_sdf = {weights['sdf']:g}, and λ_smooth = {weights['smooth']:g} or less, where bending "
        "would otherwise dominate the energy "
        f"({min(lowered):.2g} to {max(lowered):.2g} on these meshes). So a design never uses the "
        f"larger values of λ_smooth in the table. All runs have {results['iterations']} iterations "
        "from the shipped weights, without early stop, so that they can be compared. "
        f"Meshes ({results['collection']}): "
        f"{report.listed(of_mesh['mesh'] for of_mesh in varied)}.\n\n"
        f"{_table(results)}\n\n{_findings(results)}\n\n{plot}\n\n{stills}"
    )


def draw(results: Results, folder: Path) -> None:
    """Plot the medians against the factors."""
    figure, axes = plots.labelled_row(
        "factor of the weight",
        {
            "Distance to the curve with factor 1": "mean distance (% of the diagonal)",
            "Bending of the curve": "L ∮ κ_g² ds",
        },
    )
    factors = results["factors"]
    for place, name in zip(axes, ("mean", "bending"), strict=True):
        for weight, label in NAMES.items():
            values = [_median(results, weight, factor, name) for factor in factors]
            place.plot(factors, values, "o-", label=label)
        place.set_xscale("log")
        place.set_xticks(factors, [f"{factor:g}" for factor in factors])
        place.minorticks_off()
        place.set_ylim(bottom=0.0)
        place.legend()
    plots.save(figure, folder / "parameters.png")


def _solutions(network: Network, sample: Sample, iterations: int) -> dict[Key, Solution]:
    """Level sets for each weight and factor; that with factor 1 is the same for both weights."""
    solutions: dict[Key, Solution] = {}
    config = without_early_stop(iterations)
    default = fit(network, sample.problem, sample.weights, config)
    for weight in NAMES:
        for factor in FACTORS:
            if factor == 1.0:
                solutions[weight, factor] = default
                continue
            changed = replace(sample.weights, **{weight: factor * getattr(sample.weights, weight)})
            solutions[weight, factor] = fit(network, sample.problem, changed, config)
    return solutions


def _outcomes(
    sample: Sample, solutions: dict[Key, Solution], curves: dict[Key, SurfaceCurve]
) -> list[Results]:
    """Summary of the curves, with their distances to the curve of the default weights."""
    outcomes = []
    for (weight, factor), curve in curves.items():
        mean, greatest = relative_distances(sample, curve, curves[weight, 1.0])
        outcomes.append(
            {
                "weight": weight,
                "factor": factor,
                "by_itself": solutions[weight, factor].held == 0,
                "mean": significant(mean),
                "greatest": significant(greatest),
                "bending": significant(bending(sample.mesh, curve)),
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


def _found(results: Results, weight: str, factor: float) -> list[Results]:
    """Outcomes for one weight and factor, one per mesh."""
    return [
        outcome
        for of_mesh in results["varied"]
        for outcome in of_mesh["outcomes"]
        if (outcome["weight"], outcome["factor"]) == (weight, factor)
    ]


def _median(results: Results, weight: str, factor: float, name: str) -> float:
    """Median over the meshes that have a value."""
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
                    f"{sum(outcome['by_itself'] for outcome in found)} of {len(found)}",
                )
            )
    header = (
        "weight", "mean distance, %", "greatest distance, %", "L ∮ κ_g² ds",
        "sets without held vertices",
    )  # fmt: skip
    return report.table(header, rows)


def _findings(results: Results) -> str:
    """What the table shows, in words, and whether it agrees with the paper."""
    factors = results["factors"]
    text = (
        "The paper states for Fig. 5, without numbers, that the curves “remain quite similar” "
        "within a reasonable range of the weights. "
    )
    for weight, name in NAMES.items():
        means = {f: _median(results, weight, f, "mean") for f in factors if f != 1.0}
        inner = max(means[factor] for factor in REASONABLE)
        outer = max(means.values())
        verdict = "agrees with" if inner <= SIMILAR else "contradicts"
        text += (
            f"Multiplying or dividing {name} by 10 moves the curve by a mean distance of at most "
            f"{inner:.2f} %, which {verdict} the paper; a factor of 100 moves it by up to "
            f"{outer:.2f} %. "
        )
    pairs = [
        abs(_median(results, "sdf", f, "mean") - _median(results, "smooth", inverse, "mean"))
        for f, inverse in zip(factors, factors[::-1], strict=True)
    ]
    text += (
        "\n\nOnly the ratio of the two weights matters, because φ is exactly zero at the points "
        "and the steps are invariant under a common factor: a factor of λ_sdf and its inverse as "
        f"factor of λ_smooth give mean distances that differ by at most {max(pairs):.2f} %."
    )
    low, high = (_median(results, "smooth", f, "bending") for f in (factors[0], factors[-1]))
    change = "decreases" if high < low else "does not decrease"
    text += (
        f" From {factors[0]:g} to {factors[-1]:g} times λ_smooth the bending of the curve {change} "
        f"({low:.0f} to {high:.0f}). φ cannot flatten instead of giving a fairer curve, since it "
        "becomes a signed distance after every step"
    )
    kept = [not outcome["by_itself"] for each in results["varied"] for outcome in each["outcomes"]]
    return text + (
        f". In {100 * np.mean(kept):.0f} % of all runs some vertices had to be held, because "
        "the level set would have split there, whatever the weights are."
    )
