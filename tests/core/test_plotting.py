"""Tests of pictures of meshes and curves."""

import sys

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

import nicmm_core as nicmm


@pytest.fixture(scope="module")
def design(small_ball):
    return nicmm.design_curve(small_ball, [3, 60, 100])


def colours(figure):
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].reshape(-1, 3)


@pytest.mark.slow
def test_the_curve_is_in_the_picture(small_ball, design, tmp_path):
    blue = np.array([0x00, 0x72, 0xB2])
    path = tmp_path / "curve.png"
    with_curve = nicmm.plot(small_ball, design, path)
    assert path.stat().st_size > 10_000
    without = nicmm.plot(small_ball)

    def blue_share(figure):
        return (np.abs(colours(figure) - blue).max(axis=1) < 30).mean()

    assert blue_share(with_curve) > 1e-3 and blue_share(without) == 0.0
    # Seen from the opposite side, the curve is hidden by the ball.
    towards = design.curves[0].points.mean(axis=0)
    assert blue_share(nicmm.plot(small_ball, design.curves, view=-towards)) < 1e-4


@pytest.mark.slow
def test_unusable_arguments(small_ball, design, tmp_path):
    with pytest.raises(nicmm.ArgumentError, match="curves is a str"):
        nicmm.plot(small_ball, "curve")
    with pytest.raises(nicmm.ArgumentError, match="view is"):
        nicmm.plot(small_ball, design, view=(0, 0, 0))
    with pytest.raises(nicmm.ArgumentError, match="up is not a vector"):
        nicmm.plot(small_ball, design, up=("a", "b", "c"))
    with pytest.raises(nicmm.ArgumentError, match="cannot be written"):
        nicmm.plot(small_ball, design, tmp_path / "missing" / "curve.png")
    with pytest.raises(nicmm.ArgumentError, match="cannot be written"):
        nicmm.plot(small_ball, design, tmp_path / "curve.unknown")


def test_without_matplotlib(small_ball, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(nicmm.MissingPackageError, match="pip install matplotlib"):
        nicmm.plot(small_ball)
