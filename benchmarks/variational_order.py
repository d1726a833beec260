"""How fast the variational method converges (its reference claims quadratic convergence)."""

from __future__ import annotations

import numpy as np

from nicmm_core.geometry.array_types import FloatArray
from nicmm_core.level_set.variational import VariationalConfig, solve

from . import collections, plots, report
from .scale import Scale
from .solving import random_samples

SEED = 0
NOISE = 1e-3
"""Share of the first loss below which the excess over the least one is not followed.

Every iteration ends with new distances, whose rounding to the mesh lifts the loss a little.
"""


def run(scale: Scale) -> None:
    """Losses by iteration, and the order that they show."""
    meshes = collections.surfaces(scale, scale.choose(40, 6))
    excesses, orders, rates, counts = [], [], [], []
    for sample in random_samples(meshes, 1, SEED):
        losses = np.array(solve(sample.problem, sample.weights, VariationalConfig()).losses)
        excess = excess_to_least(losses)
        counts.append(len(losses))
        excesses.append(excess / excess[0] if excess[0] > 0.0 else excess)
        order, rate = order_and_rate(excess)
        if np.isfinite(order):
            orders.append(order)
            rates.append(rate)
    figure, axes = plots.labelled(
        "Variational method", "iteration", "loss above its least, share of the start"
    )
    for excess in excesses:
        axes.semilogy(excess, color="tab:green", alpha=0.5, linewidth=1.0)
    path = plots.save(figure, report.output_folder(scale) / "variational_order.png")
    claim = "The reference claims order 2 (quadratic)."
    if not orders:
        verdict = f"Too few iterations came before the least loss to fit an order. {claim}"
    else:
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
    body = (
        f"Seed {SEED}, {len(counts)} sets on {collections.label(scale)}; iterations until the "
        f"least loss has changed by less than 1e-5 over ten of them: median "
        f"{np.median(counts):.0f}, from {min(counts)} to {max(counts)}.\n\n{verdict}\n\n"
        + report.figure(path, "Loss of the variational method above its least, by iteration")
    )
    report.write_section(
        "variational_order", "Order of convergence of the variational method", body, scale
    )


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
