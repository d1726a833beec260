"""Tests the network that sees the neutral value of φ_fea everywhere."""

import numpy as np

from benchmarks.ninth_channel import CHANNEL, blind
from nicmm_core import shapes
from nicmm_core.geometry.surface_points import locate_control_points
from nicmm_core.level_set.problem import build_problem
from nicmm_core.maps.guidance import BASELINE
from nicmm_core.network.forward_pass import level_set
from nicmm_core.network.single_pass import NUMPY, network_input
from nicmm_core.network.weights_file import shipped_weights


def test_blinded_it_is_what_it_was_where_the_channel_is_neutral():
    mesh = shapes.sphere(2)
    points = locate_control_points(mesh, np.array([3, 50, 120]), closed=True)
    given = network_input(build_problem(mesh, points, "shortest"))
    size = (len(given.features), 1)
    ninth = np.random.default_rng(5).random(size, dtype=np.float32)
    painted, neutral = (
        given._replace(features=np.concatenate([given.features, channel], axis=1))
        for channel in (ninth, np.full(size, BASELINE, dtype=np.float32))
    )
    assert painted.features.shape[1] == CHANNEL + 1
    weights = shipped_weights(CHANNEL + 1)
    expected = level_set(weights, neutral, NUMPY)
    for features in (painted, neutral):
        np.testing.assert_allclose(level_set(blind(weights), features, NUMPY), expected, atol=1e-4)
