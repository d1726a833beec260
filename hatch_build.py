# SPDX-License-Identifier: GPL-3.0-or-later
"""Decides what the wheel of nicmm-curves contains.

Built from the sources, as by ``pip install .``, it includes the compiled kernels for this platform.
The wheel of a release is the same for every platform and depends on the package nicmm-kernels; it
is built when the environment variable NICMM_RELEASE is 1.
"""

from __future__ import annotations

import os
import sys
import tomllib
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from hatchling.metadata.plugin.interface import MetadataHookInterface

ROOT = Path(__file__).resolve().parent
sys.path.insert(0, str(ROOT / "kernels"))
from compile_library import PACKAGE  # noqa: E402
from library_in_wheel import CompiledLibrary  # noqa: E402

DEPENDENCIES = ["libigl", "numpy>=1.26", "plyfile", "scipy", "threadpoolctl", "tqdm"]


def _is_release() -> bool:
    return os.environ.get("NICMM_RELEASE") == "1"


class Dependencies(MetadataHookInterface):
    """Adds the kernels of the same version to the dependencies of a release."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Set the dependencies."""
        manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))
        kernels = [f"nicmm-kernels=={manifest['version']}"] if _is_release() else []
        metadata["dependencies"] = DEPENDENCIES + kernels


class IncludedKernels(CompiledLibrary):
    """Includes the kernels, except in a release."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile the library and include it with its package."""
        if self.target_name != "wheel" or _is_release():
            return
        super().initialize(version, build_data)
        for source in (*PACKAGE.glob("*.py"), PACKAGE / "py.typed"):
            build_data["force_include"][str(source)] = f"nicmm_kernels/{source.name}"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove the library, which the wheel contains by now."""
        if not _is_release():
            super().finalize(version, build_data, artifact_path)


def get_build_hook() -> type[BuildHookInterface]:
    """The hook of this file, not the one that it imports."""
    return IncludedKernels


def get_metadata_hook() -> type[MetadataHookInterface]:
    """The hook that sets the dependencies."""
    return Dependencies
