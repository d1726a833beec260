"""The network (section 3.2, Fig. 2): an MLP with Efficient Channel Attention and Light GLU.

It processes one vertex at a time, except that the attention weights depend on means over the
surface. The paper gives neither widths nor kernel sizes; `NetworkConfig` has the values chosen
here, with reasons.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor, nn

from .features import BASE_CHANNELS

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
    features : (n, channels) tensor
        Input features of every vertex, see `features`.
    initial_distance : (n,) tensor
        φ₀, zero at the control vertices.
    area_share : (n,) tensor
        Fraction of the surface's area at each vertex; sums to 1.
    response : (n, k) tensor
        Smooth fields, one per control point. Column j is 1 at control vertex j and 0 at all other
        control vertices.
    control_vertices : (k,) int tensor
    """

    features: Tensor
    initial_distance: Tensor
    area_share: Tensor
    response: Tensor
    control_vertices: Tensor


class CurveNetwork(nn.Module):
    """Computes φ = φ₀ + a correction that is zero at the control points.

    φ₀ is "the foundation for network initialization" (section 3.1): the last layer starts at zero,
    so the untrained network returns φ₀. Smooth fields cancel the output of the layers at the
    control points, so that φ is exactly zero there. The paper relies on a large λ_int instead, but
    then AdamW spends its steps on the interpolation term: in 200 steps, a curve that reached a
    great circle with exact zeros hardly moved.

    Parameters
    ----------
    config : NetworkConfig
    channels : int
        Number of input channels.
    """

    def __init__(self, config: NetworkConfig, channels: int = BASE_CHANNELS) -> None:
        super().__init__()
        self.config = config
        self.stem = nn.Linear(channels, config.width)
        self.blocks = nn.ModuleList(Block(config) for _ in range(config.depth))
        self.head = nn.Linear(config.width, 1)
        with torch.no_grad():
            self.stem.weight[:, POSITION_CHANNELS] *= config.position_gain
            if config.distance:
                self.head.weight.zero_()
                self.head.bias.zero_()

    def forward(self, inputs: NetworkInput) -> Tensor:
        """Level-set values φ, shape (n,)."""
        hidden = torch.tanh(self.stem(inputs.features * self._channel_mask(inputs)))  # (n, C)
        for block in self.blocks:
            hidden = block(hidden, inputs.area_share)
        correction = self.head(hidden)[:, 0]  # (n,)
        at_controls = correction[inputs.control_vertices]  # (k,)
        phi = correction - inputs.response @ at_controls  # (n,)
        return inputs.initial_distance + phi if self.config.distance else phi

    def _channel_mask(self, inputs: NetworkInput) -> Tensor:
        """Factors of the input channels: 0 for channels switched off, 1 for all others."""
        mask = torch.ones_like(inputs.features[0])  # (channels,)
        mask[NORMAL_CHANNELS] *= self.config.normals
        mask[INDICATOR_CHANNEL] *= self.config.control_indicator
        mask[DISTANCE_CHANNEL] *= self.config.distance
        return mask


class Block(nn.Module):
    """Linear layer, tanh, attention and a residual step through the gated unit, on (n, C)."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        width = config.width
        self.linear = nn.Linear(width, width)
        self.attention = ChannelAttention(config.attention_kernel) if config.attention else None
        self.gated = (
            GatedUnit(width, config.gate_rank) if config.gating else nn.Linear(width, width)
        )

    def forward(self, hidden: Tensor, area_share: Tensor) -> Tensor:
        """Values of the next block from values at the vertices and their shares of the area."""
        inner = torch.tanh(self.linear(hidden))
        if self.attention is not None:
            inner = self.attention(inner, area_share)
        return hidden + self.gated(inner)


class ChannelAttention(nn.Module):
    """Efficient Channel Attention: scale each channel by a weight from its neighbours' means.

    The means are taken over the surface, and the weight is the sigmoid of a correlation with the
    attention kernel.
    """

    def __init__(self, kernel: int) -> None:
        super().__init__()
        self.across = nn.Conv1d(1, 1, kernel, padding=kernel // 2, bias=False)

    def forward(self, inner: Tensor, area_share: Tensor) -> Tensor:
        """Scaled values, from values (n, C) and the shares of the area, (n,), which sum to 1."""
        mean = area_share @ inner  # (C,)
        return inner * torch.sigmoid(self.across(mean[None, None])[0, 0])


class GatedUnit(nn.Module):
    """Light GLU: a linear layer multiplied by a sigmoid gate of low rank, on (n, C)."""

    def __init__(self, width: int, rank: int) -> None:
        super().__init__()
        self.value = nn.Linear(width, width)
        self.gate_down = nn.Linear(width, rank, bias=False)
        self.gate_up = nn.Linear(rank, width)

    def forward(self, inner: Tensor) -> Tensor:
        """Gated values, (n, C)."""
        return self.value(inner) * torch.sigmoid(self.gate_up(self.gate_down(inner)))
