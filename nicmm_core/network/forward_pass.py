"""The network (section 3.2, Fig. 2): an MLP with Efficient Channel Attention and Light GLU.

It processes one vertex at a time, except that the attention weights depend on means over the
surface. The paper gives neither widths nor kernel sizes; `NetworkConfig` has the values chosen
here, with reasons.

The parameters of the network are looked up by name. All functions accept NumPy arrays, for
inference (`single_pass`), and torch tensors, for training (`trainable_network`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from ..geometry.array_types import Array
from ..progress import checkpoint

POSITION_CHANNELS, NORMAL_CHANNELS = slice(0, 3), slice(3, 6)
INDICATOR_CHANNEL, DISTANCE_CHANNEL = 6, 7
"""Indices of P, N, φ_p and φ₀ among the input channels."""


@dataclass(frozen=True)
class NetworkConfig:
    """Sizes and switches of the network.

    Attributes
    ----------
    width : int
        Number of channels C of every hidden layer. Above 64 channels the loss after pretraining
        hardly decreases.
    depth : int
        Number of hidden blocks.
    attention : bool
        Whether every block has Efficient Channel Attention; False for the ablation of Table 3.
    attention_kernel : int
        Number of neighbouring channels that interact, odd. ECA-Net's rule gives 3 for 64 channels.
    gating : bool
        Whether every block has a Light GLU; False for the ablation of Table 3.
    gate_rank : int
        Rank of the gate's matrix in Light GLU. A gate of full rank would double the parameters of a
        block; rank 8 of 64 adds a quarter.
    position_gain : float
        Factor of the first layer's initial weights for positions. Coordinates lie within about
        ±0.5, where tanh of a plain layer is almost linear. A factor of 5 resolves a tenth of the
        surface.
    normals : bool
        Whether the input has normals N; False for the ablation of Table 4, where zeros replace
        them.
    control_indicator : bool
        Whether the input has φ_p; False for the ablation of Table 4, likewise with zeros.
    distance : bool
        Whether φ₀ is part of the input and is added to the output; False for the ablation of Table
        4. Without φ₀ the last layer starts from random weights, because the gradient of the energy
        vanishes at φ = 0.
    """

    width: int = 64
    depth: int = 3
    attention: bool = True
    attention_kernel: int = 3
    gating: bool = True
    gate_rank: int = 8
    position_gain: float = 5.0
    normals: bool = True
    control_indicator: bool = True
    distance: bool = True


class NetworkInput(NamedTuple):
    """The input of the network for a problem with n vertices and k control points.

    Attributes
    ----------
    features : (n, channels) array
        Input features of every vertex, see `level_set.features`.
    initial_distance : (n,) array
        φ₀, zero at the control vertices.
    area_share : (n,) array
        Fraction of the surface's area at each vertex; sums to 1.
    response : (n, k) array
        Smooth fields, one per control point. Column j is 1 at control vertex j and 0 at all other
        control vertices.
    control_vertices : (k,) int array
    """

    features: Array
    initial_distance: Array
    area_share: Array
    response: Array
    control_vertices: Array


Parameters = Mapping[str, Array]
"""Arrays of the network by name, with the shapes given by `parameter_shapes`."""


@dataclass(frozen=True)
class NetworkWeights:
    """A network: its configuration and its parameters, all NumPy arrays or all tensors."""

    config: NetworkConfig
    parameters: Parameters


def parameter_shapes(config: NetworkConfig, channels: int) -> Iterator[tuple[str, tuple[int, ...]]]:
    """Name and shape of every parameter of a network with a given number of input channels."""
    width, rank = config.width, config.gate_rank
    yield from _linear_shapes("stem", channels, width)
    for block in range(config.depth):
        yield from _linear_shapes(f"blocks.{block}.linear", width, width)
        if config.attention:
            yield f"blocks.{block}.attention.across.weight", (1, 1, config.attention_kernel)
        gated = f"blocks.{block}.gated"
        if config.gating:
            yield from _linear_shapes(f"{gated}.value", width, width)
            yield f"{gated}.gate_down.weight", (rank, width)
            yield from _linear_shapes(f"{gated}.gate_up", rank, width)
        else:
            yield from _linear_shapes(gated, width, width)
    yield from _linear_shapes("head", width, 1)


def _linear_shapes(name: str, inputs: int, outputs: int) -> Iterator[tuple[str, tuple[int, ...]]]:
    yield f"{name}.weight", (outputs, inputs)
    yield f"{name}.bias", (outputs,)


class Operations(NamedTuple):
    """Operations that NumPy and torch name differently.

    Attributes
    ----------
    linear : callable
        Linear layer: maps values (n, inputs), a weight (outputs, inputs) and a bias (outputs,) or
        None to (n, outputs).
    tanh, sigmoid : callable
        Elementwise functions.
    correlate : callable
        Correlation of values (C,) with a kernel of odd length to (C,), with zeros beyond the ends.
    ones_like : callable
        Function that returns ones in the shape of its argument.
    """

    linear: Callable[[Array, Array, Array | None], Array]
    tanh: Callable[[Array], Array]
    sigmoid: Callable[[Array], Array]
    correlate: Callable[[Array, Array], Array]
    ones_like: Callable[[Array], Array]


def level_set(weights: NetworkWeights, inputs: NetworkInput, operations: Operations) -> Array:
    """Compute φ = φ₀ + the network's correction, which is zero at the control points.

    φ₀ is "the foundation for network initialization" (section 3.1): the last layer starts at zero,
    so the untrained network returns φ₀. Smooth fields cancel the output of the layers at the
    control points, so that φ is exactly zero there. The paper relies on a large λ_int instead, but
    then AdamW spends its steps on the interpolation term: in 200 steps, a curve that reached a
    great circle with exact zeros hardly moved.

    Parameters
    ----------
    weights : NetworkWeights
    inputs : NetworkInput
        Input of the network, of the same array type and precision as the parameters.
    operations : Operations
        Operations for that array type.

    Returns
    -------
    (n,) array
        φ at the vertices.
    """
    config, parameters = weights.config, weights.parameters
    mask = channel_mask(config, inputs.features, operations)  # (channels,)
    hidden = linear(parameters, "stem", inputs.features * mask, operations)  # (n, C)
    hidden = operations.tanh(hidden)  # (n, C)
    for number in range(config.depth):
        checkpoint()
        hidden = block(weights, f"blocks.{number}", hidden, inputs.area_share, operations)  # (n, C)
    correction = linear(parameters, "head", hidden, operations)[:, 0]  # (n,)
    at_controls = correction[inputs.control_vertices]  # (k,)
    phi = correction - inputs.response @ at_controls  # (n,)
    return inputs.initial_distance + phi if config.distance else phi


def channel_mask(config: NetworkConfig, features: Array, operations: Operations) -> Array:
    """Factors of the input channels: 0 for channels switched off, 1 for all others."""
    mask = operations.ones_like(features[0])  # (channels,)
    mask[NORMAL_CHANNELS] *= config.normals
    mask[INDICATOR_CHANNEL] *= config.control_indicator
    mask[DISTANCE_CHANNEL] *= config.distance
    return mask


def block(
    weights: NetworkWeights, name: str, hidden: Array, area_share: Array, operations: Operations
) -> Array:
    """Linear layer, tanh, attention and a residual step through the gated unit, on (n, C)."""
    config, parameters = weights.config, weights.parameters
    inner = operations.tanh(linear(parameters, f"{name}.linear", hidden, operations))  # (n, C)
    if config.attention:
        inner = channel_attention(
            parameters, f"{name}.attention", inner, area_share, operations
        )  # (n, C)
    unit = gated_unit if config.gating else linear
    return hidden + unit(parameters, f"{name}.gated", inner, operations)  # (n, C)


def channel_attention(
    parameters: Parameters, name: str, inner: Array, area_share: Array, operations: Operations
) -> Array:
    """Efficient Channel Attention: scale each channel by a weight from its neighbours' means.

    The means are taken over the surface, and the weight is the sigmoid of a correlation with the
    attention kernel.

    Parameters
    ----------
    inner : (n, C) array
        Channel values at the vertices.
    area_share : (n,) array
        Fraction of the surface's area at each vertex; sums to 1.
    """
    kernel = parameters[f"{name}.across.weight"][0, 0]  # (kernel,)
    mean = area_share @ inner  # (C,)
    return inner * operations.sigmoid(operations.correlate(mean, kernel))  # (n, C)


def gated_unit(parameters: Parameters, name: str, inner: Array, operations: Operations) -> Array:
    """Light GLU: a linear layer multiplied by a sigmoid gate of low rank, on (n, C)."""
    low = operations.linear(inner, parameters[f"{name}.gate_down.weight"], None)  # (n, rank)
    gate = operations.sigmoid(linear(parameters, f"{name}.gate_up", low, operations))  # (n, C)
    return linear(parameters, f"{name}.value", inner, operations) * gate  # (n, C)


def linear(parameters: Parameters, name: str, values: Array, operations: Operations) -> Array:
    """Apply the linear layer with the given name, (n, inputs) to (n, outputs)."""
    return operations.linear(values, parameters[f"{name}.weight"], parameters[f"{name}.bias"])
