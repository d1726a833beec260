"""What the tool draws over the viewport, without a window."""

import numpy as np

from tests.blender.scenes import module


def test_a_line_with_a_problem_is_dashed(extension):
    """Half of its length is drawn, evenly along it, on its own segments."""
    overlay = module(extension, "tool.overlay")
    angle = np.linspace(0.0, 2.0 * np.pi, 2001)
    line = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    found = overlay.dashes(line)
    assert abs(len(found) / 2000 - 0.5) < 0.01
    in_quarters = np.histogram(np.arctan2(*found[:, 0, :2].T), 4)[0]
    assert in_quarters.max() <= 1.1 * in_quarters.min()
    gaps = (np.linalg.norm(found[1:, 0] - found[:-1, 1], axis=1) > 1e-9).sum()
    assert gaps == overlay.DASHES - 1
    assert len(overlay.dashes(line[:2])) == 1
