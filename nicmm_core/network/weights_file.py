"""Network weights on disk: one NumPy archive with the arrays and the configuration."""

from __future__ import annotations

import json
import zipfile
import zlib
from dataclasses import asdict
from functools import cache
from pathlib import Path

import numpy as np

from ..errors import ArgumentError
from ..level_set.features import BASE_CHANNELS
from .forward_pass import NetworkConfig, NetworkWeights, parameter_shapes

SHIPPED = Path(__file__).parent / "weights" / "nicmm.npz"
"""Weights that come with the package; `docs/pretraining.md` names the command that made them."""


def save_weights(path: str | Path, weights: NetworkWeights) -> None:
    """Write configuration and parameters, which are NumPy arrays."""
    config = np.array(json.dumps(asdict(weights.config)))
    with Path(path).open("wb") as file:
        np.savez_compressed(file, config=config, **weights.parameters)


def load_weights(path: str | Path = SHIPPED, channels: int = BASE_CHANNELS) -> NetworkWeights:
    """Read the weights of a network for a number of input channels, as NumPy arrays.

    The weights are stored for the eight base channels. A ninth one, φ_fea, starts with zero
    weight, so the same weights serve with and without maps. Settings that a file does not name
    have their defaults.

    Raises
    ------
    ArgumentError
        If the file is missing or is no weights file.
    """
    try:
        # Without pickles nothing in a file is executed.
        with np.load(path, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        config = NetworkConfig(**json.loads(str(arrays.pop("config"))))
        extra = channels - arrays["stem.weight"].shape[1]
        arrays["stem.weight"] = np.pad(arrays["stem.weight"], ((0, 0), (0, extra)))
        parameters = {}
        for name, shape in parameter_shapes(config, channels):
            parameters[name] = arrays.pop(name).astype(np.float32, casting="same_kind")
            if parameters[name].shape != shape:
                raise ValueError(f"{name} has shape {parameters[name].shape}, not {shape}")
        if arrays:
            raise ValueError(f"{', '.join(arrays)} belongs to another network")
    except _UNREADABLE as error:
        raise ArgumentError(
            f"{path} cannot be read as network weights ({error}); make the file with "
            "'python -m nicmm_core pretrain'"
        ) from error
    return NetworkWeights(config, parameters)


@cache
def shipped_weights(channels: int) -> NetworkWeights:
    """The weights that come with the package, read once; nobody may change them."""
    return load_weights(SHIPPED, channels)


# What a missing file, another kind of file and weights of another network raise.
_UNREADABLE = (
    OSError,
    EOFError,
    ValueError,
    KeyError,
    IndexError,
    TypeError,
    AttributeError,
    RuntimeError,
    MemoryError,
    zipfile.BadZipFile,
    zlib.error,
)
