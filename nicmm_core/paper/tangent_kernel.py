"""The tangent kernel of the network (Jacot et al., "Neural tangent kernel", 2018).

To first order, a step Δθ of the parameters changes the output by J Δθ, with J = ∂φ/∂θ. The kernel
K = J Jᵀ then tells how a step along the derivatives at some vertices changes φ at others. In a
linear layer, the derivative with respect to the weight (i, j) is δᵢ aⱼ, where a is the input of the
layer and δ the derivative of the output of the network with respect to the output of the layer. So
K is the sum over the layers of (δ δᵀ) ∘ (a aᵀ), with 1 added to a aᵀ if there is a bias, and J is
never formed. The weights of the
attention are held.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..geometry.array_types import FloatArray, IntArray
from .matrix_product import product
from .network import Attention, BlockValues, Network, blocks, head


class Layer(NamedTuple):
    """A linear layer at r vertices.

    Attributes
    ----------
    name : str
        Name of the layer among the parameters.
    inputs : (r, in) array
        a, the input of the layer.
    derivatives : (r, out) array
        δ, the derivative of the correction with respect to the output of the layer.
    """

    name: str
    inputs: FloatArray
    derivatives: FloatArray


class Tangent(NamedTuple):
    """The network's correction at r vertices and its derivatives in all linear layers."""

    correction: FloatArray
    layers: list[Layer]


def tangent(network: Network, features: FloatArray, attention: Attention) -> Tangent:
    """Evaluate the network at r vertices and propagate derivatives back through its layers.

    Parameters
    ----------
    network : Network
    features : (r, channels) array
    attention : callable
        Weights of the channels, which are held.
    """
    parameters = network.parameters
    values = list(blocks(network, features, attention))
    hidden = values[-1].output
    derivative = np.ones((len(hidden), 1), dtype=hidden.dtype)
    layers = [Layer("head", hidden, derivative)]
    derivative = product(derivative, parameters["head.weight"])  # (r, C)
    for block in reversed(range(network.config.depth)):
        derivative = _through_block(network, block, values[block], derivative, layers)
    derivative = derivative * (1.0 - values[0].hidden ** 2)
    layers.append(Layer("stem", features, derivative))
    return Tangent(head(network, hidden), layers)


def _through_block(
    network: Network, block: int, values: BlockValues, derivative: FloatArray, layers: list[Layer]
) -> FloatArray:
    """Derivative (r, C) with respect to the input of a block, from that for its output.

    The layers of the block are appended to ``layers``.
    """
    parameters, name = network.parameters, f"blocks.{block}"
    scaled = values.activated * values.attention
    for_value = derivative * values.gate
    layers.append(Layer(f"{name}.value", scaled, for_value))
    for_scaled = product(for_value, parameters[f"{name}.value.weight"])
    if values.lowered is not None:
        for_gate = derivative * values.value * values.gate * (1.0 - values.gate)
        for_lowered = product(for_gate, parameters[f"{name}.gate_up.weight"])
        layers.append(Layer(f"{name}.gate_down", scaled, for_lowered))
        layers.append(Layer(f"{name}.gate_up", values.lowered, for_gate))
        for_scaled = for_scaled + product(for_lowered, parameters[f"{name}.gate_down.weight"])
    for_linear = for_scaled * values.attention * (1.0 - values.activated**2)
    layers.append(Layer(f"{name}.linear", values.hidden, for_linear))
    return derivative + product(for_linear, parameters[f"{name}.linear.weight"])


def kernel(network: Network, tangent: Tangent, columns: IntArray) -> FloatArray:
    """Columns of the tangent kernel, shape (r, s), for s of the r vertices."""
    result = np.zeros((len(tangent.correction), len(columns)), dtype=tangent.correction.dtype)
    shared, of_inputs = None, result
    for name, inputs, derivatives in tangent.layers:
        if inputs is not shared:  # two layers may have one input
            shared, of_inputs = inputs, product(inputs, inputs[columns].T)
        of_derivatives = product(derivatives, derivatives[columns].T)
        if f"{name}.bias" in network.parameters:
            result += of_derivatives
        of_derivatives *= of_inputs
        result += of_derivatives
    return result


def moved(
    network: Network, tangent: Tangent, columns: IntArray, coefficients: FloatArray
) -> Network:
    """The network after the step Δθ = Jᵀ α, with coefficients α (s,) at s of the r vertices."""
    parameters = dict(network.parameters)
    alpha = coefficients.astype(tangent.correction.dtype)
    for name, inputs, derivatives in tangent.layers:
        weighted = derivatives[columns] * alpha[:, None]  # (s, out)
        change = product(weighted.T, inputs[columns])
        parameters[f"{name}.weight"] = parameters[f"{name}.weight"] + change
        if f"{name}.bias" in parameters:
            parameters[f"{name}.bias"] = parameters[f"{name}.bias"] + weighted.sum(axis=0)
    return Network(network.config, parameters)
