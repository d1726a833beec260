"""Network weights on disk: a NumPy archive of the parameters and the configuration."""

from __future__ import annotations

import json
import lzma
import struct
import tokenize
import warnings
import zipfile
import zlib
from dataclasses import asdict
from functools import cache
from pathlib import Path

import numpy as np

from ..errors import ArgumentError
from ..geometry.array_types import Array
from .features import BASE_CHANNELS
from .network import Network, NetworkConfig, parameter_shapes

SHIPPED = Path(__file__).parent / "weights" / "nicmm.npz"
"""Weights shipped with the package; `docs/pretraining.md` gives the command that produced them."""

SHIPPED_WITH_MAPS = SHIPPED.with_name("nicmm-maps.npz")
"""Shipped weights of the network with φ_fea as its ninth channel."""

MOST_BYTES = 2**28
"""Maximum number of bytes of all arrays in a file; a small archive could unpack to any size."""


def save_weights(path: str | Path, network: Network) -> None:
    """Write configuration and parameters of a network, as NumPy arrays, to a file."""
    config = np.array(json.dumps(asdict(network.config)))
    with Path(path).open("wb") as file:
        np.savez_compressed(file, config=config, **network.parameters)


def load_network(path: str | Path = SHIPPED, channels: int = BASE_CHANNELS) -> Network:
    """Read a network.

    If a file has weights for the eight base channels only, the ninth channel, φ_fea, gets zero
    weights. Settings missing from a file get their defaults.

    Parameters
    ----------
    path : path
        A file written by `save_weights`.
    channels : int
        Number of input channels.

    Raises
    ------
    ArgumentError
        If the file is missing, or does not contain valid weights for this number of channels.
    """
    try:
        arrays = _read_arrays(path)
        config = NetworkConfig(**json.loads(str(arrays.pop("config"))))
        if not 1 <= config.depth <= len(arrays):
            raise ValueError(f"its number of blocks is {config.depth}")
        extra = channels - arrays["stem.weight"].shape[1]
        arrays["stem.weight"] = np.pad(arrays["stem.weight"], ((0, 0), (0, extra)))
        shapes = parameter_shapes(config, channels)
        if arrays.keys() != shapes.keys():
            raise ValueError(f"it has the parameters {', '.join(sorted(arrays))}")
        for name, shape in shapes.items():
            if arrays[name].shape != shape:
                raise ValueError(f"{name} has the shape {arrays[name].shape} instead of {shape}")
            arrays[name] = arrays[name].astype(np.float32, casting="same_kind")
            if not np.isfinite(arrays[name]).all():
                raise ValueError(f"{name} has values that are NaN or infinite")
    except _UNREADABLE as error:
        raise ArgumentError(
            f"{path} cannot be read as network weights ({error}); create the file with "
            "'nicmm pretrain'"
        ) from error
    return Network(config, arrays)


def _read_arrays(path: str | Path) -> dict[str, Array]:
    """The arrays of an archive by name. Pickles are refused, so a file cannot execute code."""
    with Path(path).open("rb") as file, warnings.catch_warnings():
        warnings.simplefilter("error")  # NumPy only warns about ambiguous headers
        with np.load(file, allow_pickle=False) as archive:
            size = sum(member.file_size for member in archive.zip.infolist())
            if size > MOST_BYTES:
                raise ValueError(f"it would unpack to {size} bytes, more than {MOST_BYTES}")
            return dict(archive)


@cache
def shipped_network(channels: int) -> Network:
    """The shipped network for a number of input channels, cached; do not modify it."""
    return load_network(SHIPPED if channels == BASE_CHANNELS else SHIPPED_WITH_MAPS, channels)


# Errors raised for a missing file, another kind of file, or weights of another network.
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
    OverflowError,
    SyntaxError,
    UserWarning,
    tokenize.TokenError,
    struct.error,
    lzma.LZMAError,
    zipfile.BadZipFile,
    zlib.error,
)
