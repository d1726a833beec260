# SPDX-License-Identifier: GPL-3.0-or-later
"""Adds the compiled library to a wheel, whose tag then names its platform."""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

sys.path.insert(0, str(Path(__file__).resolve().parent))
from compile_library import PLATFORMS, compile_library, this_platform  # noqa: E402

VARIABLE = "NICMM_KERNELS_PLATFORM"
"""Environment variable with the platform of the wheel; by default it is the platform here."""


class CompiledLibrary(BuildHookInterface):
    """Compiles the library for one platform, and includes it in the wheel."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile before the wheel is made."""
        if self.target_name != "wheel":
            return
        name = os.environ.get(VARIABLE) or this_platform()
        self._folder = tempfile.TemporaryDirectory()
        library = compile_library(name, Path(self._folder.name))
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-{PLATFORMS[name][1]}"
        build_data["force_include"][str(library)] = f"nicmm_kernels/{library.name}"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove the library, which the wheel contains by now."""
        if self.target_name == "wheel":
            self._folder.cleanup()
