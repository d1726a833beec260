"""The network (section 3.2, Fig. 2): an MLP with Efficient Channel Attention and Light GLU.

It processes one vertex at a time, except that the attention weights depend on means over the
surface. The paper gives neither widths nor kernel sizes; `NetworkConfig` has the values chosen
here, with reasons. The functions accept NumPy arrays, with which curves are designed, and torch
tensors, with which networks are pretrained.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from types import ModuleType
from typing import NamedTuple

import numpy as np

from ..geometry.array_types import Array
from .features import BASE_CHANNELS
from .matrix_product import product
from .problem import Problem

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
        Input features of every vertex, see `features`; zero in channels that are switched off.
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


def network_input(
    problem: Problem, config: NetworkConfig, precision: type[np.floating] = np.float32
) -> NetworkInput:
    """The input of a network for a problem.

    In single precision φ differs by about 1e-7, in units of the problem, from φ in double
    precision.
    """
    features = problem.features.astype(precision)
    features[:, NORMAL_CHANNELS] *= config.normals
    features[:, INDICATOR_CHANNEL] *= config.control_indicator
    features[:, DISTANCE_CHANNEL] *= config.distance
    areas = problem.elements.vertex_areas
    return NetworkInput(
        features=features,
        initial_distance=problem.initial_distance.astype(precision),
        area_share=(areas / areas.sum()).astype(precision),
        response=problem.smoother.response.astype(precision),
        control_vertices=problem.loop.control_vertices,
    )


@dataclass(frozen=True)
class Network:
    """A network with C channels in its hidden layers.

    Attributes
    ----------
    config : NetworkConfig
    parameters : dict of str to array
        Weights and biases of all layers by name: ``stem``, ``head`` and, for block b,
        ``blocks.b.linear``, ``.value``, ``.gate_down`` and ``.gate_up``, with a weight (out, in)
        and a bias (out,) each, and ``blocks.b.attention.weight``. The layers ``gate_down`` have no
        bias.
    """

    config: NetworkConfig
    parameters: dict[str, Array]

    @property
    def channels(self) -> int:
        """Number of input channels."""
        return int(self.parameters["stem.weight"].shape[1])


class BlockValues(NamedTuple):
    """Values in a block at r vertices.

    Attributes
    ----------
    hidden : (r, C) array
        Input of the block.
    activated : (r, C) array
        Output of its linear layer, after tanh.
    attention : (C,) array or 1
        Weights of the channels, by which ``activated`` is multiplied.
    lowered : (r, rank) array or None
        Output of the first layer of the gate.
    gate : (r, C) array or 1
    value : (r, C) array
        The gated unit returns ``gate * value``, which is added to ``hidden``.
    """

    hidden: Array
    activated: Array
    attention: Array
    lowered: Array | None
    gate: Array
    value: Array

    @property
    def output(self) -> Array:
        """Output of the block, (r, C)."""
        return self.hidden + self.gate * self.value


Attention = Callable[[int, Array], Array]
"""Weights (C,) of the channels from the index of a block and its activated values (r, C)."""


def parameter_shapes(config: NetworkConfig, channels: int) -> dict[str, tuple[int, ...]]:
    """Shapes of the parameters of a network by name."""
    width, rank = config.width, config.gate_rank
    layers = {"stem": (width, channels)}
    for block in range(config.depth):
        layers[f"blocks.{block}.linear"] = (width, width)
        layers[f"blocks.{block}.value"] = (width, width)
        if config.gating:
            layers[f"blocks.{block}.gate_down"] = (rank, width)
            layers[f"blocks.{block}.gate_up"] = (width, rank)
    layers["head"] = (1, width)
    shapes: dict[str, tuple[int, ...]] = {}
    for name, shape in layers.items():
        shapes[f"{name}.weight"] = shape
        if not name.endswith("gate_down"):
            shapes[f"{name}.bias"] = shape[:1]
    if config.attention:
        for block in range(config.depth):
            shapes[f"blocks.{block}.attention.weight"] = (config.attention_kernel,)
    return shapes


def initial_network(
    config: NetworkConfig | None = None, channels: int = BASE_CHANNELS, seed: int = 0
) -> Network:
    """The network from which pretraining starts, in single precision.

    Weights and biases are uniform within ±1/√in. The last layer is zero, so that φ is φ₀: "the
    foundation for network initialization" (section 3.1).
    """
    config = config or NetworkConfig()
    generator = np.random.default_rng(seed)
    shapes = parameter_shapes(config, channels)
    parameters = {}
    for name, shape in shapes.items():
        layer, _, _ = name.rpartition(".")
        bound = shapes[f"{layer}.weight"][-1] ** -0.5
        parameters[name] = generator.uniform(-bound, bound, shape).astype(np.float32)
    parameters["stem.weight"][:, POSITION_CHANNELS] *= config.position_gain
    if config.distance:
        parameters["head.weight"][:] = 0.0
        parameters["head.bias"][:] = 0.0
    return Network(config, parameters)


def level_set(
    network: Network,
    inputs: NetworkInput,
    attention: Attention | None = None,
    xp: ModuleType = np,
) -> Array:
    """Level-set values φ, shape (n,): φ₀ plus a correction that is zero at the control points.

    Smooth fields cancel the correction at the control points. The paper relies on a large λ_int
    instead.

    Parameters
    ----------
    network : Network
    inputs : NetworkInput
    attention : callable, optional
        Weights of the channels, if they are not those of `surface_attention`.
    xp : module, optional
        ``numpy`` or ``torch``, whichever the arrays belong to.
    """
    attention = attention or surface_attention(network, inputs.area_share, xp)
    correction = corrections(network, inputs.features, attention, xp)  # (n,)
    correction = correction - inputs.response @ correction[inputs.control_vertices]
    return inputs.initial_distance + correction if network.config.distance else correction


def corrections(
    network: Network, features: Array, attention: Attention, xp: ModuleType = np
) -> Array:
    """Corrections of φ₀ at r vertices, shape (r,), not yet zero at the control points.

    The parameters are those of `blocks`.
    """
    for values in blocks(network, features, attention, xp):
        hidden = values.output
    return head(network, hidden)


def surface_attention(network: Network, area_share: Array, xp: ModuleType = np) -> Attention:
    """Efficient Channel Attention, which needs the values at all vertices of the surface.

    The weight of a channel is the sigmoid of a correlation of the attention kernel with the means
    of neighbouring channels over the surface.
    """

    def weights(block: int, activated: Array) -> Array:
        kernel = network.parameters[f"blocks.{block}.attention.weight"]
        mean = area_share @ activated  # (C,)
        reach = len(kernel) // 2
        padding = xp.zeros_like(mean[:reach])
        padded = xp.concatenate([padding, mean, padding])  # (C + 2 reach,)
        correlation = sum(
            weight * padded[shift : shift + len(mean)] for shift, weight in enumerate(kernel)
        )
        return _sigmoid(correlation, xp)

    return weights


def held_attention(network: Network, inputs: NetworkInput) -> Attention:
    """The weights that `surface_attention` gives with the present parameters, kept for later."""
    weigh = surface_attention(network, inputs.area_share)
    if not network.config.attention:
        return weigh
    kept = [values.attention for values in blocks(network, inputs.features, weigh)]
    return lambda block, activated: kept[block]


def blocks(
    network: Network, features: Array, attention: Attention, xp: ModuleType = np
) -> Iterator[BlockValues]:
    """Values in each block in turn.

    Parameters
    ----------
    network : Network
    features : (r, channels) array
        Input features of r vertices.
    attention : callable
        Weights of the channels; not used without attention.
    xp : module, optional
        ``numpy`` or ``torch``.
    """
    config, parameters = network.config, network.parameters
    hidden = xp.tanh(_linear(parameters, "stem", features))  # (r, C)
    for block in range(config.depth):
        name = f"blocks.{block}"
        activated = xp.tanh(_linear(parameters, f"{name}.linear", hidden))  # (r, C)
        weights = attention(block, activated) if config.attention else 1.0  # (C,)
        scaled = activated * weights  # (r, C)
        lowered, gate = None, 1.0
        if config.gating:
            lowered = product(scaled, parameters[f"{name}.gate_down.weight"].T)  # (r, rank)
            gate = _sigmoid(_linear(parameters, f"{name}.gate_up", lowered), xp)  # (r, C)
        value = _linear(parameters, f"{name}.value", scaled)  # (r, C)
        yield (values := BlockValues(hidden, activated, weights, lowered, gate, value))
        hidden = values.output


def head(network: Network, hidden: Array) -> Array:
    """Output (r,) of the last layer, from the output (r, C) of the last block."""
    return _linear(network.parameters, "head", hidden)[:, 0]


def _linear(parameters: dict[str, Array], name: str, values: Array) -> Array:
    """A linear layer, from (r, in) to (r, out)."""
    return product(values, parameters[f"{name}.weight"].T) + parameters[f"{name}.bias"]


def _sigmoid(values: Array, xp: ModuleType) -> Array:
    """1 / (1 + exp(-x)), without overflow."""
    return 0.5 * (1.0 + xp.tanh(0.5 * values))
