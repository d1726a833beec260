"""Network weights on disk: one NumPy archive with the arrays and the configuration."""

from __future__ import annotations

import json
import zipfile
from dataclasses import asdict
from pathlib import Path

import numpy as np
import torch

from .errors import ArgumentError
from .features import BASE_CHANNELS
from .network import CurveNetwork, NetworkConfig

SHIPPED = Path(__file__).parent / "weights" / "nicmm.npz"
"""Weights that come with the package; `docs/pretraining.md` names the command that made them."""


def save_network(path: str | Path, network: CurveNetwork) -> None:
    """Write configuration and parameters."""
    arrays = {name: value.cpu().numpy() for name, value in network.state_dict().items()}
    config = np.array(json.dumps(asdict(network.config)))
    with Path(path).open("wb") as file:
        np.savez_compressed(file, config=config, **arrays)


def load_network(path: str | Path = SHIPPED, channels: int = BASE_CHANNELS) -> CurveNetwork:
    """Read a network for a number of input channels.

    The weights are stored for the eight base channels. A ninth one, φ_fea, starts with zero
    weight, so the same weights serve with and without maps. Settings that a file does not name
    have their defaults.

    Raises
    ------
    ArgumentError
        If the file is missing or is no weights file.
    """
    try:
        with np.load(path, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        network = CurveNetwork(NetworkConfig(**json.loads(str(arrays.pop("config")))), channels)
        extra = channels - arrays["stem.weight"].shape[1]
        arrays["stem.weight"] = np.pad(arrays["stem.weight"], ((0, 0), (0, extra)))
        network.load_state_dict({name: torch.as_tensor(value) for name, value in arrays.items()})
    except _UNREADABLE as error:
        raise ArgumentError(
            f"{path} cannot be read as network weights ({error}); make the file with "
            "'python -m nicmm_core pretrain'"
        ) from error
    return network


# What a missing file, another kind of file and weights of another network raise.
_UNREADABLE = (
    OSError,
    EOFError,
    ValueError,
    KeyError,
    IndexError,
    TypeError,
    RuntimeError,
    zipfile.BadZipFile,
)
