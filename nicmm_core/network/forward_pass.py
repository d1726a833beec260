"""The network (section 3.2, Fig. 2): an MLP with Efficient Channel Attention and Light GLU.

It sees one vertex at a time, except that the attention's weights come from the mean over the
surface. The paper gives neither widths nor kernels; what is chosen here stands in
`NetworkConfig`, each with its reason.

The network is functions of arrays and of parameters by name, written once for NumPy arrays, where
it only runs (`single_pass`), and for tensors, where it is trained (`trainable_network`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from ..geometry.array_types import Array
from ..progress import checkpoint

POSITION_CHANNELS, NORMAL_CHANNELS = slice(0, 3), slice(3, 6)
INDICATOR_CHANNEL, DISTANCE_CHANNEL = 6, 7
"""Places of P, N, φ_p and φ₀ among the input channels."""


@dataclass(frozen=True)
class NetworkConfig:
    """Sizes and switches of the network.

    Attributes
    ----------
    width : int
        Channels C of every hidden layer. 64 is where the loss after pretraining stops falling
        for its cost.
    depth : int
        Hidden blocks.
    attention : bool
        Efficient Channel Attention in every block; off for the ablation of Table 3.
    attention_kernel : int
        Neighbouring channels that interact, odd; 3 is what ECA-Net's rule gives for 64 channels.
    gating : bool
        Light GLU in every block; off for the ablation of Table 3.
    gate_rank : int
        Rank of the gate's matrix, the "light" of Light GLU: a full gate would double the
        parameters of a block, rank 8 of 64 adds a quarter.
    position_gain : float
        Factor on the first layer's initial weights for positions. Coordinates lie within about
        ±0.5 and a plain layer would see them as almost linear; 5 resolves a tenth of the surface.
    normals : bool
        Normals N among the input; off for the ablation of Table 4, where zeros replace them.
    control_indicator : bool
        φ_p among the input; off for Table 4 likewise.
    distance : bool
        φ₀ among the input and under the correction that the network gives; off for Table 4. The
        last layer then begins at random, because φ = 0 is a place where the energy has no slope.
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
    """What the network sees of a problem with n vertices and k control points.

    Attributes
    ----------
    features : (n, channels) array
    initial_distance : (n,) array
        φ₀, zero at the control vertices.
    area_share : (n,) array
        Share of the surface's area that belongs to each vertex; sums to 1.
    response : (n, k) array
        Column j is a smooth field that is 1 at control vertex j and 0 at the others.
    control_vertices : (k,) int array
    """

    features: Array
    initial_distance: Array
    area_share: Array
    response: Array
    control_vertices: Array


Parameters = Mapping[str, Array]
"""Arrays by name, in the shapes of `parameter_shapes`."""


@dataclass(frozen=True)
class NetworkWeights:
    """A network: its configuration and its parameters, as arrays of one kind."""

    config: NetworkConfig
    parameters: Parameters


def parameter_shapes(config: NetworkConfig, channels: int) -> Iterator[tuple[str, tuple[int, ...]]]:
    """Name and shape of every parameter, for a number of input channels."""
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
    """What NumPy and torch do not have under one name.

    Attributes
    ----------
    linear : callable
        Maps values (n, inputs), a weight (outputs, inputs) and a bias (outputs,) or None to
        (n, outputs).
    tanh, sigmoid : callable
        Of every value.
    correlate : callable
        Maps values (C,) and an odd kernel (kernel,) to (C,), with zeros beyond the ends.
    ones_like : callable
    """

    linear: Callable[[Array, Array, Array | None], Array]
    tanh: Callable[[Array], Array]
    sigmoid: Callable[[Array], Array]
    correlate: Callable[[Array, Array], Array]
    ones_like: Callable[[Array], Array]


def level_set(weights: NetworkWeights, given: NetworkInput, operations: Operations) -> Array:
    """φ = φ₀ + a correction that the network gives at every vertex, zero at the control points.

    Starting from φ₀, "the foundation for network initialization" (section 3.1), the last layer
    begins at zero, so the untrained network returns φ₀ itself. What the layers give at the
    control points is taken off again by smooth fields, so that φ is exactly zero there. The paper
    asks for that by its large λ_int alone; with that weight AdamW spends its steps on the
    interpolation term, and on a great circle 200 of them hardly moved the curve, where with exact
    zeros they brought it there.

    Parameters
    ----------
    weights : NetworkWeights
    given : NetworkInput
        Arrays of the kind and precision of the parameters.
    operations : Operations
        For arrays of that kind.

    Returns
    -------
    (n,) array
    """
    config, parameters = weights.config, weights.parameters
    seen = channels_seen(config, given.features, operations)  # (channels,)
    hidden = linear(parameters, "stem", given.features * seen, operations)  # (n, C)
    hidden = operations.tanh(hidden)  # (n, C)
    for number in range(config.depth):
        checkpoint()
        hidden = block(weights, f"blocks.{number}", hidden, given.area_share, operations)  # (n, C)
    correction = linear(parameters, "head", hidden, operations)[:, 0]  # (n,)
    at_controls = correction[given.control_vertices]  # (k,)
    phi = correction - given.response @ at_controls  # (n,)
    return given.initial_distance + phi if config.distance else phi


def channels_seen(config: NetworkConfig, features: Array, operations: Operations) -> Array:
    """1 for each input channel that the network sees and 0 for those switched off."""
    seen = operations.ones_like(features[0])  # (channels,)
    seen[NORMAL_CHANNELS] *= config.normals
    seen[INDICATOR_CHANNEL] *= config.control_indicator
    seen[DISTANCE_CHANNEL] *= config.distance
    return seen


def block(
    weights: NetworkWeights, name: str, hidden: Array, area_share: Array, operations: Operations
) -> Array:
    """Linear, tanh, attention, and a residual step through the gated unit; (n, C) to (n, C)."""
    config, parameters = weights.config, weights.parameters
    inner = operations.tanh(linear(parameters, f"{name}.linear", hidden, operations))  # (n, C)
    if config.attention:
        inner = attended(parameters, f"{name}.attention", inner, area_share, operations)  # (n, C)
    unit = gated_unit if config.gating else linear
    return hidden + unit(parameters, f"{name}.gated", inner, operations)  # (n, C)


def attended(
    parameters: Parameters, name: str, inner: Array, area_share: Array, operations: Operations
) -> Array:
    """Efficient Channel Attention: scale channels by weights from their means and neighbours'.

    Parameters
    ----------
    inner : (n, C) array
    area_share : (n,) array
        Sums to 1.
    """
    kernel = parameters[f"{name}.across.weight"][0, 0]  # (kernel,)
    mean = area_share @ inner  # (C,)
    return inner * operations.sigmoid(operations.correlate(mean, kernel))  # (n, C)


def gated_unit(parameters: Parameters, name: str, inner: Array, operations: Operations) -> Array:
    """Light GLU: a linear layer times a sigmoid gate of low rank; (n, C) to (n, C)."""
    low = operations.linear(inner, parameters[f"{name}.gate_down.weight"], None)  # (n, rank)
    gate = operations.sigmoid(linear(parameters, f"{name}.gate_up", low, operations))  # (n, C)
    return linear(parameters, f"{name}.value", inner, operations) * gate  # (n, C)


def linear(parameters: Parameters, name: str, values: Array, operations: Operations) -> Array:
    """A linear layer, (n, inputs) to (n, outputs)."""
    return operations.linear(values, parameters[f"{name}.weight"], parameters[f"{name}.bias"])
