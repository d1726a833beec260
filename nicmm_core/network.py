"""The network (section 3.2, Fig. 2): an MLP with Efficient Channel Attention and Light GLU.

It sees one vertex at a time, except that the attention's weights come from the mean over the
surface. The paper gives neither widths nor kernels; what is chosen here stands in
`NetworkConfig`, each with its reason.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor, nn

from .features import BASE_CHANNELS

NORMAL_CHANNELS, INDICATOR_CHANNEL, DISTANCE_CHANNEL = slice(3, 6), 6, 7
"""Places of N, φ_p and φ₀ among the input channels."""


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


class EfficientChannelAttention(nn.Module):
    """Scale channels by weights from their surface means and those of neighbouring channels."""

    def __init__(self, kernel: int) -> None:
        super().__init__()
        self.across = nn.Conv1d(1, 1, kernel, padding=kernel // 2, bias=False)

    def forward(self, hidden: Tensor, area_share: Tensor) -> Tensor:
        """Weigh channels; ``hidden`` (n, C), ``area_share`` (n,) summing to 1."""
        mean = area_share @ hidden  # (C,)
        weight = torch.sigmoid(self.across(mean[None, None])[0, 0])  # (C,)
        return hidden * weight


class LightGatedLinearUnit(nn.Module):
    """A linear layer times a sigmoid gate of low rank."""

    def __init__(self, width: int, rank: int) -> None:
        super().__init__()
        self.value = nn.Linear(width, width)
        self.gate_down = nn.Linear(width, rank, bias=False)
        self.gate_up = nn.Linear(rank, width)

    def forward(self, hidden: Tensor) -> Tensor:
        """Map (n, C) to (n, C)."""
        gate = torch.sigmoid(self.gate_up(self.gate_down(hidden)))  # (n, C)
        return self.value(hidden) * gate


class Block(nn.Module):
    """Linear, tanh, attention, and a residual step through the gated unit."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        self.linear = nn.Linear(config.width, config.width)
        self.attention = (
            EfficientChannelAttention(config.attention_kernel) if config.attention else None
        )
        self.gated = (
            LightGatedLinearUnit(config.width, config.gate_rank)
            if config.gating
            else nn.Linear(config.width, config.width)
        )

    def forward(self, hidden: Tensor, area_share: Tensor) -> Tensor:
        """Map (n, C) to (n, C)."""
        inner = torch.tanh(self.linear(hidden))  # (n, C)
        if self.attention is not None:
            inner = self.attention(inner, area_share)  # (n, C)
        return hidden + self.gated(inner)  # (n, C)


class NetworkInput(NamedTuple):
    """What the network sees of a problem with n vertices and k control points.

    Attributes
    ----------
    features : (n, channels) tensor
    initial_distance : (n,) tensor
        φ₀, zero at the control vertices.
    area_share : (n,) tensor
        Share of the surface's area that belongs to each vertex; sums to 1.
    response : (n, k) tensor
        Column j is a smooth field that is 1 at control vertex j and 0 at the others.
    control_vertices : (k,) int tensor
    """

    features: Tensor
    initial_distance: Tensor
    area_share: Tensor
    response: Tensor
    control_vertices: Tensor


class CurveNetwork(nn.Module):
    """φ = φ₀ + a correction that the network gives at every vertex, zero at the control points.

    Starting from φ₀, "the foundation for network initialization" (section 3.1), the last layer
    begins at zero, so the untrained network returns φ₀ itself. What the layers give at the
    control points is taken off again by smooth fields, so that φ is exactly zero there. The paper
    asks for that by its large λ_int alone; with that weight AdamW spends its steps on the
    interpolation term, and on a great circle 200 of them hardly moved the curve, where with exact
    zeros they brought it there.
    """

    seen: Tensor

    def __init__(self, config: NetworkConfig, channels: int = BASE_CHANNELS) -> None:
        super().__init__()
        self.config = config
        self.stem = nn.Linear(channels, config.width)
        self.blocks = nn.ModuleList(Block(config) for _ in range(config.depth))
        self.head = nn.Linear(config.width, 1)
        # No part of the stored weights: it follows from the configuration.
        self.register_buffer("seen", _channels_seen(config, channels), persistent=False)
        with torch.no_grad():
            self.stem.weight[:, :3] *= config.position_gain
            if config.distance:
                self.head.weight.zero_()
                self.head.bias.zero_()

    def forward(self, given: NetworkInput) -> Tensor:
        """Level-set values φ, shape (n,)."""
        hidden = torch.tanh(self.stem(given.features * self.seen))  # (n, C)
        for block in self.blocks:
            hidden = block(hidden, given.area_share)  # (n, C)
        correction = self.head(hidden)[:, 0]  # (n,)
        at_controls = correction[given.control_vertices]  # (k,)
        phi = correction - given.response @ at_controls  # (n,)
        return given.initial_distance + phi if self.config.distance else phi


def _channels_seen(config: NetworkConfig, channels: int) -> Tensor:
    """1 for each input channel that the network sees and 0 for those switched off."""
    seen = torch.ones(channels)
    seen[NORMAL_CHANNELS] *= config.normals
    seen[INDICATOR_CHANNEL] *= config.control_indicator
    seen[DISTANCE_CHANNEL] *= config.distance
    return seen
