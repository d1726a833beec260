"""The network as a torch module, for pretraining and fine-tuning."""

from __future__ import annotations

import math
from pathlib import Path

import torch
from torch import Tensor, nn

from ..level_set.features import BASE_CHANNELS
from .forward_pass import (
    NetworkConfig,
    NetworkInput,
    NetworkWeights,
    Operations,
    level_set,
    parameter_shapes,
)
from .weights_file import SHIPPED, load_weights


class CurveNetwork(nn.Module):
    """The parameters of a network, with `forward_pass.level_set` as its forward pass.

    Parameters are initialised as in torch: uniformly within the inverse square root of the number
    of inputs. But the first layer's weights for positions are larger by
    `NetworkConfig.position_gain`, and the last layer is zero if φ₀ is added to its output.

    Parameters
    ----------
    config : NetworkConfig
    channels : int
        Number of input channels.
    """

    def __init__(self, config: NetworkConfig, channels: int = BASE_CHANNELS) -> None:
        super().__init__()
        self.config = config
        shapes = dict(parameter_shapes(config, channels))
        # The parameters are kept in a list, since torch allows no dots in their names.
        self.names = tuple(shapes)
        self.arrays = nn.ParameterList(torch.empty(shape) for shape in shapes.values())
        parameters = self.weights.parameters
        with torch.no_grad():
            for name, parameter in parameters.items():
                # The range of a bias is that of its weight.
                inputs = math.prod(shapes[name.replace("bias", "weight")][1:])
                parameter.uniform_(-1.0 / math.sqrt(inputs), 1.0 / math.sqrt(inputs))
            parameters["stem.weight"][:, :3] *= config.position_gain
            if config.distance:
                parameters["head.weight"].zero_()
                parameters["head.bias"].zero_()

    @property
    def weights(self) -> NetworkWeights:
        """Configuration and parameters by name; these are the trained tensors, not copies."""
        return NetworkWeights(self.config, dict(zip(self.names, self.arrays, strict=True)))

    def forward(self, inputs: NetworkInput) -> Tensor:
        """Level-set values φ, shape (n,)."""
        return level_set(self.weights, inputs, TORCH)


def build_network(weights: NetworkWeights) -> CurveNetwork:
    """Build a network with a copy of the given weights."""
    network = CurveNetwork(weights.config, weights.parameters["stem.weight"].shape[1])
    with torch.no_grad():
        for name, parameter in network.weights.parameters.items():
            parameter.copy_(torch.as_tensor(weights.parameters[name]))
    return network


def network_weights(network: CurveNetwork) -> NetworkWeights:
    """Copy the weights of a network to NumPy arrays."""
    return NetworkWeights(
        network.config,
        {
            name: tensor.detach().cpu().numpy().copy()
            for name, tensor in network.weights.parameters.items()
        },
    )


def load_network(path: str | Path = SHIPPED, channels: int = BASE_CHANNELS) -> CurveNetwork:
    """Read a network for further training; see `weights_file.load_weights`."""
    return build_network(load_weights(path, channels))


def _correlate(values: Tensor, kernel: Tensor) -> Tensor:
    reach = len(kernel) // 2
    return nn.functional.conv1d(values[None, None], kernel[None, None], padding=reach)[0, 0]


TORCH = Operations(
    linear=nn.functional.linear,
    tanh=torch.tanh,
    sigmoid=torch.sigmoid,
    correlate=_correlate,
    ones_like=torch.ones_like,
)
"""The network's operations on tensors."""
