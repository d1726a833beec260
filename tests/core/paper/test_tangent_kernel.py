"""Tests the tangent kernel against the Jacobian that PyTorch computes, and by differences."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from nicmm_core.paper.network import (
    Network,
    NetworkConfig,
    blocks,
    head,
    parameter_shapes,
    surface_attention,
)
from nicmm_core.paper.tangent_kernel import kernel, moved, tangent
from nicmm_core.paper.tensors import trainable

SMALL = NetworkConfig(width=8, depth=2, gate_rank=2)
CONFIGS = {
    "all": SMALL,
    "deep": replace(SMALL, depth=3),
    "without attention": replace(SMALL, attention=False),
    "without gates": replace(SMALL, gating=False),
    "plain": replace(SMALL, attention=False, gating=False),
}
ROWS, CHANNELS = 30, 8


class Case:
    """A random network in double precision, and its tangent at random vertices."""

    def __init__(self, config):
        generator = np.random.default_rng(4)
        shapes = parameter_shapes(config, CHANNELS)
        self.network = Network(
            config, {name: generator.normal(0.0, 0.5, shape) for name, shape in shapes.items()}
        )
        self.features = generator.normal(size=(ROWS, CHANNELS))
        weigh = surface_attention(self.network, np.full(ROWS, 1.0 / ROWS))
        kept = [values.attention for values in blocks(self.network, self.features, weigh)]
        self.attention = lambda block, activated: kept[block]
        self.tangent = tangent(self.network, self.features, self.attention)
        self.columns = generator.choice(ROWS, 9, replace=False)
        self.coefficients = generator.normal(size=9)
        self.tensors = trainable(self.network, torch.device("cpu"))
        held = [torch.as_tensor(weights) for weights in kept]
        self.output = self.forward(torch.as_tensor(self.features), lambda block, _: held[block])

    def forward(self, features, attention):
        *_, last = blocks(self.tensors, features, attention, torch)
        return head(self.tensors, last.output)

    def jacobian(self):
        """Derivatives (r, p) of the output with respect to all parameters but the attention's."""
        wanted = [v for k, v in self.tensors.parameters.items() if "attention" not in k]
        rows = [
            torch.cat(
                [part.ravel() for part in torch.autograd.grad(one, wanted, retain_graph=True)]
            )
            for one in self.output
        ]
        return torch.stack(rows).numpy()

    def step(self, size):
        """Network after the step Jᵀ α, multiplied by a size."""
        return moved(self.network, self.tangent, self.columns, size * self.coefficients)


@pytest.fixture(scope="module", params=CONFIGS)
def case(request):
    return Case(CONFIGS[request.param])


def test_correction_is_that_of_the_forward_pass(case):
    *_, last = blocks(case.network, case.features, case.attention)
    np.testing.assert_array_equal(case.tangent.correction, head(case.network, last.output))
    np.testing.assert_allclose(case.tangent.correction, case.output.detach(), rtol=0, atol=1e-12)


def test_every_layer_takes_part(case):
    layers = {
        name.rpartition(".")[0] for name in case.network.parameters if "attention" not in name
    }
    names = [layer.name for layer in case.tangent.layers]
    assert sorted(names) == sorted(layers)


def test_columns_are_those_of_the_jacobian(case):
    jacobian = case.jacobian()
    expected = jacobian @ jacobian[case.columns].T
    found = kernel(case.network, case.tangent, case.columns)
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max())


def test_kernel_is_symmetric_and_positive_semidefinite(case):
    """Also with a vertex twice, where it is singular."""
    columns = np.append(case.columns, case.columns[0])
    at_columns = kernel(case.network, case.tangent, columns)[columns]
    scale = np.abs(at_columns).max()
    np.testing.assert_allclose(at_columns, at_columns.T, rtol=0, atol=1e-12 * scale)
    eigenvalues = np.linalg.eigvalsh(at_columns)
    assert eigenvalues[0] > -1e-12 * scale
    assert eigenvalues[1] > 1e-9 * scale


def test_step_is_that_of_the_transposed_jacobian(case):
    step = case.jacobian()[case.columns].T @ case.coefficients
    after = case.step(1.0)
    names = [name for name in case.network.parameters if "attention" not in name]
    change = [after.parameters[name] - case.network.parameters[name] for name in names]
    flat = np.concatenate([part.ravel() for part in change])
    np.testing.assert_allclose(flat, step, rtol=1e-6, atol=1e-9 * np.abs(step).max())


def test_attention_stays(case):
    after = case.step(1.0)
    held = [name for name in case.network.parameters if "attention" in name]
    assert len(held) == case.network.config.depth * case.network.config.attention
    for name in held:
        np.testing.assert_array_equal(after.parameters[name], case.network.parameters[name])


def test_change_of_the_output_is_that_of_the_kernel_to_first_order(case):
    """Compared with central differences."""
    expected = kernel(case.network, case.tangent, case.columns) @ case.coefficients
    size = 1e-6
    ahead, behind = (
        tangent(case.step(sign * size), case.features, case.attention).correction
        for sign in (1, -1)
    )
    difference = (ahead - behind) / (2 * size)
    np.testing.assert_allclose(difference, expected, rtol=0, atol=1e-6 * np.abs(expected).max())


def test_network_given_is_not_changed(case):
    before = {name: array.copy() for name, array in case.network.parameters.items()}
    case.step(1.0)
    for name, array in case.network.parameters.items():
        np.testing.assert_array_equal(array, before[name])


def test_precision_is_that_of_the_network():
    case = Case(SMALL)
    single = Network(
        SMALL, {name: array.astype(np.float32) for name, array in case.network.parameters.items()}
    )
    held = [case.attention(block, None).astype(np.float32) for block in range(SMALL.depth)]
    found = tangent(single, case.features.astype(np.float32), lambda block, _: held[block])
    columns = kernel(single, found, case.columns)
    assert columns.dtype == np.float32
    expected = kernel(case.network, case.tangent, case.columns)
    np.testing.assert_allclose(columns, expected, rtol=0, atol=1e-4 * np.abs(expected).max())
    after = moved(single, found, case.columns, case.coefficients)
    assert all(array.dtype == np.float32 for array in after.parameters.values())
