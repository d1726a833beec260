"""Measures the order of convergence of the variational method; its authors claim order 2."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from nicmm_core.geometry.array_types import FloatArray
from nicmm_core.paper.variational import CONVERGENCE, solve

from . import collections, plots, report
from .evidence import NETWORK, Results
from .scale import Scale
from .solving import random_samples, significant

TITLE = "Order of convergence of the variational method"
ROOMS = NETWORK

SEED = 0
NOISE = 1e-3
"""Excess of the loss over its minimum, relative to the first excess, that counts as noise.

Every iteration ends with a redistancing, whose discretisation error raises the loss slightly.
"""


DIGITS = 10
"""Significant digits of the losses, whose differences are small."""


def measure(scale: Scale) -> Results:
    """Record the loss of every iteration."""
    meshes = collections.surfaces(scale, scale.choose(40, 6))
    sets = []
    for sample in random_samples(meshes, 1, SEED):
        losses = solve(sample.problem, sample.weights).losses
        kept = [significant(loss, DIGITS) for loss in losses]
        sets.append({"mesh": sample.name, "losses": kept})
    return {
        "seed": SEED,
        "collection": collections.label(scale),
        "tolerance": CONVERGENCE.tolerance,
        "patience": CONVERGENCE.patience,
        "sets": sets,
    }


def section(results: Results) -> str:
    """Fitted order of convergence, and whether it agrees with the claim."""
    counts = [len(each["losses"]) for each in results["sets"]]
    figure = report.figure(
        "variational_order.png", "Excess of the loss over its minimum against the iteration, by set"
    )
    tolerance = f"{results['tolerance']:g}".replace("e-0", "e-")
    return (
        "The losses of `variational` were recorded at every iteration, to see how fast it "
        f"converges, for {len(counts)} sets of random control points on {results['collection']} "
        f"(seed {results['seed']}). It needs {np.median(counts):.0f} iterations by the median, and "
        f"from {min(counts)} to {max(counts)}, until the lowest loss has changed by less than "
        f"{tolerance} over {results['patience']} iterations. The order p is fitted to "
        "e(k+1) = c e(k)^p, where e(k) is the excess of the loss of iteration k over the lowest "
        "loss.\n\n"
        f"{_verdict(results)}\n\n{figure}"
    )


def draw(results: Results, folder: Path) -> None:
    """Plot the excess of the loss over its minimum, for each set."""
    figure, axes = plots.labelled(
        "Convergence of the variational method",
        "iteration",
        "excess of the loss, relative to the start",
    )
    for excess in _excesses(results):
        relative = excess / excess[0] if len(excess) and excess[0] > 0.0 else excess
        axes.semilogy(relative, color="tab:green", alpha=0.5, linewidth=1.0)
    plots.save(figure, folder / "variational_order.png")


def _excesses(results: Results) -> list[FloatArray]:
    return [excess_to_least(np.array(each["losses"])) for each in results["sets"]]


def _verdict(results: Results) -> str:
    claim = "the quadratic convergence (p = 2) that the authors of the method claim"
    fitted = [order_and_rate(excess) for excess in _excesses(results)]
    orders, rates = _finite(fitted)
    if not orders:
        return f"There are too few iterations to fit an order, so {claim} cannot be tested."
    median = float(np.median(orders))
    agrees = "agrees with" if median > 1.8 else "contradicts"
    verdict = (
        f"The median order is p = {median:.2f} (quartiles {np.quantile(orders, 0.25):.2f} and "
        f"{np.quantile(orders, 0.75):.2f}, {len(orders)} sets), which {agrees} {claim}. An "
        f"iteration leaves {100 * np.median(rates):.0f} % of e by the median."
    )
    if median <= 1.8:
        verdict += (
            " There are two reasons. The steps are Gauss–Newton steps on an energy with non-zero "
            "residuals, since the signed distance to a bent curve is not linear in any face. "
            "After each step, φ becomes a signed distance again, which the Gauss–Newton model "
            "does not include."
        )
    return verdict


def _finite(fitted: Sequence[tuple[float, float]]) -> tuple[list[float], list[float]]:
    """Orders and rates of the sets for which they could be fitted."""
    kept = [each for each in fitted if np.isfinite(each[0])]
    return [order for order, _ in kept], [rate for _, rate in kept]


def excess_to_least(losses: FloatArray) -> FloatArray:
    """Excess of the losses over their minimum, up to where it falls to the noise level."""
    excess = losses - losses.min()
    small = np.flatnonzero(excess <= NOISE * excess[0])
    return excess[: small[0]] if len(small) else excess


def order_and_rate(excess: FloatArray) -> tuple[float, float]:
    """Exponent p of e(k+1) = c e(k)^p by least squares, and the median of e(k+1) / e(k).

    Only decreases count; both values are NaN if there are fewer than four.
    """
    falling = (excess[1:] < excess[:-1]) if len(excess) > 1 else np.zeros(0, dtype=bool)
    if falling.sum() < 4:
        return float("nan"), float("nan")
    before, after = np.log(excess[:-1][falling]), np.log(excess[1:][falling])
    order = np.polyfit(before, after, 1)[0]
    return float(order), float(np.median(np.exp(after - before)))
