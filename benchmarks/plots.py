"""Plots in a common style, written as PNG files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

from matplotlib import pyplot  # noqa: E402 - the backend is chosen first
from matplotlib.axes import Axes  # noqa: E402
from matplotlib.axis import Axis  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402
from matplotlib.ticker import FuncFormatter, MaxNLocator  # noqa: E402

METHOD_COLOURS = {
    "nicmm": "tab:orange",
    "elastic": "tab:blue",
    "variational": "tab:green",
    "initial path": "0.55",
    "reference curve": "black",
}
"""Colour of each method, the same in all plots."""

LEAST_LOSSES = "Least loss so far against the iteration, mean of the sets"
"""Caption of the plots that `least_losses` draws."""


def labelled(
    title: str, x: str, y: str, width: float = 7.0, height: float = 4.2
) -> tuple[Figure, Axes]:
    """Create a figure with one pair of axes, titled and labelled."""
    figure, axes = pyplot.subplots(figsize=(width, height))
    axes.set_title(title)
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.grid(alpha=0.3)
    return figure, axes


def labelled_pair(
    titles: tuple[str, str], x: str, y: tuple[str, str]
) -> tuple[Figure, tuple[Axes, Axes]]:
    """Create a figure with two plots side by side that have the same quantity as x."""
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(10.0, 4.2))
    for axes, title, label in zip((left, right), titles, y, strict=True):
        axes.set_title(title)
        axes.set_xlabel(x)
        axes.set_ylabel(label)
        axes.grid(alpha=0.3)
    return figure, (left, right)


def labelled_row(x: str, labels: Mapping[str, str]) -> tuple[Figure, list[Axes]]:
    """Create a figure with a row of plots that have the same quantity as x.

    ``labels`` maps the title of each plot to its y label.
    """
    figure, row = pyplot.subplots(1, len(labels), figsize=(4.0 * len(labels), 3.8))
    for axes, (title, y) in zip(row, labels.items(), strict=True):
        axes.set_title(title)
        axes.set_xlabel(x)
        axes.set_ylabel(y)
        axes.grid(alpha=0.3)
    return figure, list(row)


def plain_ticks(axis: Axis) -> None:
    """Label the ticks of a logarithmic axis with plain numbers."""
    for set_formatter in (axis.set_major_formatter, axis.set_minor_formatter):
        set_formatter(FuncFormatter(lambda value, _: _plain(value)))


def _plain(value: float) -> str:
    """Label of a tick at 1, 2 or 5 in a decade; other labels would overlap and are left empty."""
    text = f"{value:g}"
    return text if text.strip("0.") in {"1", "2", "5"} else ""


def save(figure: Figure, path: Path) -> Path:
    """Write a figure to a file and close it."""
    figure.tight_layout()
    figure.savefig(path, dpi=130)
    pyplot.close(figure)
    return path


def least_losses(runs: Mapping[str, Sequence[float]], title: str, path: Path) -> Path:
    """Plot, for each network, the mean of the lowest loss so far against the iteration."""
    figure, axes = labelled(title, "iteration", "least loss so far, mean of the sets")
    for label, losses in runs.items():
        axes.plot(losses, label=label, linewidth=1.6)
    axes.set_yscale("log")
    # The losses often stay within one decade, where a logarithmic locator finds hardly any ticks.
    axes.yaxis.set_major_locator(MaxNLocator(7))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.minorticks_off()
    axes.legend(fontsize=8)
    return save(figure, path)
