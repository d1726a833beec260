"""How fast the variational method converges (its reference claims quadratic convergence)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from nicmm_core.geometry.array_types import FloatArray
from nicmm_core.level_set.variational import VariationalConfig, solve

from . import collections, plots, report
from .evidence import Results
from .scale import Scale
from .solving import PARTS_WITHOUT, random_samples, significant

TITLE = "Order of convergence of the variational method"
WITHOUT = (*PARTS_WITHOUT, "network")

SEED = 0
NOISE = 1e-3
"""Share of the first loss below which the excess over the least one is not followed.

Every iteration ends with new distances, whose rounding to the mesh lifts the loss a little.
"""


DIGITS = 10
"""Of the losses: their differences are small."""


def measure(scale: Scale) -> Results:
    """Losses by iteration."""
    config = VariationalConfig()
    meshes = collections.surfaces(scale, scale.choose(40, 6))
    sets = []
    for sample in random_samples(meshes, 1, SEED):
        losses = solve(sample.problem, sample.weights, config).losses
        kept = [significant(loss, DIGITS) for loss in losses]
        sets.append({"mesh": sample.name, "losses": kept})
    return {
        "seed": SEED,
        "collection": collections.label(scale),
        "tolerance": config.tolerance,
        "patience": config.patience,
        "sets": sets,
    }


def section(results: Results) -> str:
    """The order that the losses show."""
    counts = [len(each["losses"]) for each in results["sets"]]
    figure = report.figure(
        "variational_order.png", "Loss of the variational method above its least, by iteration"
    )
    tolerance = f"{results['tolerance']:g}".replace("e-0", "e-")
    return (
        f"Seed {results['seed']}, {len(counts)} sets on {results['collection']}; iterations until "
        f"the least loss has changed by less than {tolerance} over {results['patience']} of them: "
        f"median {np.median(counts):.0f}, from {min(counts)} to {max(counts)}.\n\n"
        f"{_verdict(results)}\n\n{figure}"
    )


def draw(results: Results, folder: Path) -> None:
    """Draw the losses above the least one of each set."""
    figure, axes = plots.labelled(
        "Variational method", "iteration", "loss above its least, share of the start"
    )
    for excess in _excesses(results):
        relative = excess / excess[0] if len(excess) and excess[0] > 0.0 else excess
        axes.semilogy(relative, color="tab:green", alpha=0.5, linewidth=1.0)
    plots.save(figure, folder / "variational_order.png")


def _excesses(results: Results) -> list[FloatArray]:
    return [excess_to_least(np.array(each["losses"])) for each in results["sets"]]


def _verdict(results: Results) -> str:
    claim = "The reference claims order 2 (quadratic)."
    fitted = [order_and_rate(excess) for excess in _excesses(results)]
    orders, rates = _finite(fitted)
    if not orders:
        return f"Too few iterations came before the least loss to fit an order. {claim}"
    median = float(np.median(orders))
    agrees = "This agrees" if median > 1.8 else "This contradicts it"
    verdict = (
        f"Fitted order of e(k+1) = c e(k)^p, e the loss above its least: median p = "
        f"{median:.2f} (quartiles {np.quantile(orders, 0.25):.2f} and "
        f"{np.quantile(orders, 0.75):.2f}) over {len(orders)} sets; an iteration leaves "
        f"{np.median(rates):.0%} of e in the median. {claim} {agrees}."
    )
    if median <= 1.8:
        verdict += (
            " The steps are Gauss–Newton's on an energy that keeps residuals (a signed "
            "distance of a bent curve is not linear in any face), and after each of them φ "
            "becomes a signed distance again, which Newton's model does not know."
        )
    return verdict


def _finite(fitted: Sequence[tuple[float, float]]) -> tuple[list[float], list[float]]:
    """Orders and rates of the sets that have them."""
    kept = [each for each in fitted if np.isfinite(each[0])]
    return [order for order, _ in kept], [rate for _, rate in kept]


def excess_to_least(losses: FloatArray) -> FloatArray:
    """Losses above the least one, up to where they fall to the noise."""
    excess = losses - losses.min()
    small = np.flatnonzero(excess <= NOISE * excess[0])
    return excess[: small[0]] if len(small) else excess


def order_and_rate(excess: FloatArray) -> tuple[float, float]:
    """Exponent p of e(k+1) = c e(k)^p by least squares, and the median of e(k+1) / e(k).

    NaN where fewer than four falls are left.
    """
    falling = (excess[1:] < excess[:-1]) if len(excess) > 1 else np.zeros(0, dtype=bool)
    if falling.sum() < 4:
        return float("nan"), float("nan")
    before, after = np.log(excess[:-1][falling]), np.log(excess[1:][falling])
    order = np.polyfit(before, after, 1)[0]
    return float(order), float(np.median(np.exp(after - before)))
