"""Tests the network that sees the neutral value of φ_fea everywhere."""

import numpy as np

from benchmarks.ninth_channel import CHANNEL, blind
from nicmm_core import shapes
from nicmm_core.geometry.surface_points import locate_control_points
from nicmm_core.maps.guidance import BASELINE
from nicmm_core.paper.network import NetworkConfig, level_set, network_input
from nicmm_core.paper.problem import build_problem
from nicmm_core.paper.weights_file import shipped_network


def test_blinded_it_is_what_it_was_where_the_channel_is_neutral():
    mesh = shapes.sphere(2)
    points = locate_control_points(mesh, np.array([3, 50, 120]), closed=True)
    given = network_input(build_problem(mesh, points, "shortest"), NetworkConfig())
    size = (len(given.features), 1)
    ninth = np.random.default_rng(5).random(size, dtype=np.float32)
    painted, neutral = (
        given._replace(features=np.concatenate([given.features, channel], axis=1))
        for channel in (ninth, np.full(size, BASELINE, dtype=np.float32))
    )
    assert painted.features.shape[1] == CHANNEL + 1
    network = shipped_network(CHANNEL + 1)
    expected = level_set(network, neutral)
    assert np.abs(level_set(network, painted) - expected).max() > 1e-3
    for inputs in (painted, neutral):
        np.testing.assert_allclose(level_set(blind(network), inputs), expected, rtol=0, atol=1e-4)
