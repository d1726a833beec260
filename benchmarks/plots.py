"""Plots: one look for all figures, written as PNG."""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")

from matplotlib import pyplot  # noqa: E402 - the backend is chosen first
from matplotlib.axes import Axes  # noqa: E402
from matplotlib.axis import Axis  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402
from matplotlib.ticker import FuncFormatter  # noqa: E402

METHOD_COLOURS = {
    "nicmm-paper": "tab:orange",
    "nicmm": "tab:blue",
    "variational": "tab:green",
    "initial path": "0.55",
    "elastic curve": "black",
}
"""Of methods, in every plot the same."""


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


def plain_ticks(axis: Axis) -> None:
    """Write the ticks of a logarithmic axis as plain numbers."""
    for set_formatter in (axis.set_major_formatter, axis.set_minor_formatter):
        set_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def save(figure: Figure, path: Path) -> Path:
    """Write a figure and close it."""
    figure.tight_layout()
    figure.savefig(path, dpi=130)
    pyplot.close(figure)
    return path
