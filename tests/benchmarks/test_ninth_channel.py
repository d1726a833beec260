"""Tests the network that sees the neutral value of φ_fea everywhere."""

import numpy as np
import torch

from benchmarks.ninth_channel import CHANNEL, blind
from nicmm_core import shapes
from nicmm_core.geometry.surface_points import locate_control_points
from nicmm_core.maps.guidance import BASELINE
from nicmm_core.paper.problem import build_problem
from nicmm_core.paper.tensors import network_input
from nicmm_core.paper.weights_file import shipped_network


def test_blinded_it_is_what_it_was_where_the_channel_is_neutral():
    mesh = shapes.sphere(2)
    points = locate_control_points(mesh, np.array([3, 50, 120]), closed=True)
    given = network_input(build_problem(mesh, points, "shortest"), torch.device("cpu"))
    size = (len(given.features), 1)
    ninth = torch.rand(size, generator=torch.Generator().manual_seed(5))
    painted, neutral = (
        given._replace(features=torch.cat([given.features, channel], dim=1))
        for channel in (ninth, torch.full(size, BASELINE))
    )
    assert painted.features.shape[1] == CHANNEL + 1
    network = shipped_network(CHANNEL + 1)
    expected = network(neutral)
    for features in (painted, neutral):
        torch.testing.assert_close(blind(network)(features), expected, rtol=0, atol=1e-4)
