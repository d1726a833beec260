"""Plots: one look for all figures, written as PNG."""

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
    "nicmm-paper": "tab:orange",
    "nicmm": "tab:blue",
    "variational": "tab:green",
    "initial path": "0.55",
    "elastic curve": "black",
}
"""Of methods, in every plot the same."""

LEAST_LOSSES = "Least loss so far against the iteration, mean of the sets"
"""Caption of `least_losses`."""


def labelled(
    title: str, x: str, y: str, width: float = 7.0, height: float = 4.2
) -> tuple[Figure, Axes]:
    """A new figure and its axes, with title and labels."""
    figure, axes = pyplot.subplots(figsize=(width, height))
    axes.set_title(title)
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.grid(alpha=0.3)
    return figure, axes


def labelled_pair(
    titles: tuple[str, str], x: str, y: tuple[str, str]
) -> tuple[Figure, tuple[Axes, Axes]]:
    """A new figure with two axes side by side that share the meaning of x."""
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(10.0, 4.2))
    for axes, title, label in zip((left, right), titles, y, strict=True):
        axes.set_title(title)
        axes.set_xlabel(x)
        axes.set_ylabel(label)
        axes.grid(alpha=0.3)
    return figure, (left, right)


def labelled_row(x: str, labels: Mapping[str, str]) -> tuple[Figure, list[Axes]]:
    """A new figure with a row of axes that share the meaning of x; y labels by title."""
    figure, row = pyplot.subplots(1, len(labels), figsize=(4.0 * len(labels), 3.8))
    for axes, (title, y) in zip(row, labels.items(), strict=True):
        axes.set_title(title)
        axes.set_xlabel(x)
        axes.set_ylabel(y)
        axes.grid(alpha=0.3)
    return figure, list(row)


def plain_ticks(axis: Axis) -> None:
    """Write the ticks of a logarithmic axis as plain numbers."""
    for set_formatter in (axis.set_major_formatter, axis.set_minor_formatter):
        set_formatter(FuncFormatter(lambda value, _: _plain(value)))


def _plain(value: float) -> str:
    """1, 2 and 5 of each decade; labels of the ticks between them would overlap."""
    text = f"{value:g}"
    return text if text.strip("0.") in {"1", "2", "5"} else ""


def save(figure: Figure, path: Path) -> Path:
    """Write a figure and close it."""
    figure.tight_layout()
    figure.savefig(path, dpi=130)
    pyplot.close(figure)
    return path


def least_losses(runs: Mapping[str, Sequence[float]], title: str, path: Path) -> Path:
    """The mean of the least loss so far, against the iteration, on a log axis, for each network."""
    figure, axes = labelled(title, "iteration", "least loss so far, mean of the sets")
    for label, losses in runs.items():
        axes.plot(losses, label=label, linewidth=1.6)
    axes.set_yscale("log")
    # The losses often stay within one decade, where a logarithmic locator finds hardly any tick.
    axes.yaxis.set_major_locator(MaxNLocator(7))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.minorticks_off()
    axes.legend(fontsize=8)
    return save(figure, path)
