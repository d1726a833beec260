# SPDX-License-Identifier: GPL-3.0-or-later
"""The extension for Blender: its files, its wheels and its zips."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from .environment import (
    DIST,
    KERNELS,
    MANIFEST,
    ROOT,
    VENV_PYTHON,
    BuildError,
    ensure_environment,
    manifest,
    pinned,
    run,
    say,
)

sys.path.insert(0, str(KERNELS))
import compile_library  # noqa: E402

BLENDER_PYTHONS = ("3.11", "3.13")
"""Python of Blender 4.5 and 5.0, and of later versions."""

PLATFORMS = {
    "linux-x64": ("manylinux_2_28_x86_64", "manylinux_2_27_x86_64", "manylinux2014_x86_64"),
    "linux-arm64": ("manylinux_2_28_aarch64", "manylinux_2_27_aarch64", "manylinux2014_aarch64"),
    "windows-x64": ("win_amd64",),
    "macos-arm64": ("macosx_12_0_arm64",),
    "macos-x64": ("macosx_12_0_x86_64",),
}
"""The wheel tags that each of Blender's platforms accepts, in order of preference.

Blender also runs on windows-arm64, for which libigl has no wheels.
"""

KERNEL_PLATFORMS = tuple(compile_library.PLATFORMS)
"""The platforms for which the kernels are compiled."""

LARGEST_ZIP = 120e6
"""Largest size of a zip, in bytes."""

BUNDLED = ("libigl", "scipy", "threadpoolctl")
"""Packages in the zip. NumPy is not bundled: all extensions share the one that Blender includes."""

EXTENSION_INIT = '''\
# SPDX-License-Identifier: GPL-3.0-or-later
"""NICMM Curves: smooth curves on meshes through selected vertices."""

from .nicmm_blender import register, unregister

__all__ = ["register", "unregister"]
'''


def stage(folder: Path, wheels: Sequence[Path] = (), blender_platform: str = "") -> None:
    """Copy the extension to a new folder, laid out as in the zip."""
    folder.mkdir(parents=True)
    for package in ("nicmm_blender", "nicmm_core"):
        shutil.copytree(
            ROOT / package, folder / package, ignore=shutil.ignore_patterns("__pycache__", ".*")
        )
    shutil.copy(ROOT / "LICENSE", folder)
    (folder / "__init__.py").write_text(EXTENSION_INIT, encoding="utf-8")
    text = (ROOT / MANIFEST).read_text(encoding="utf-8")
    if blender_platform:
        text += f'\nplatforms = ["{blender_platform}"]\n'
    if wheels:
        (folder / "wheels").mkdir()
        text += "wheels = [\n"
        for wheel in wheels:
            shutil.copy(wheel, folder / "wheels")
            text += f'    "./wheels/{wheel.name}",\n'
        text += "]\n"
    (folder / MANIFEST).write_text(text, encoding="utf-8")


def download(requirement: str, blender_platform: str, python: str) -> Path:
    """The wheel of a package for a platform and a Python version, downloaded on first use."""
    name, version = requirement.split("==")
    folder = DIST / "wheels" / f"{blender_platform}-python{python}"
    pattern = f"{name}-{version}-*.whl"
    if not list(folder.glob(pattern)):
        say(f"Downloading {requirement} for {blender_platform}, Python {python}")
        folder.mkdir(parents=True, exist_ok=True)
        # Other processes may be looking for the same wheel, and must not find a part of it.
        with tempfile.TemporaryDirectory(dir=folder) as temporary:
            command = [str(VENV_PYTHON), "-m", "pip", "download", "--quiet", "--no-deps"]
            command += ["--only-binary=:all:", "--python-version", python, "--dest", temporary]
            for tag in PLATFORMS[blender_platform]:
                command += ["--platform", tag]
            downloaded = run([*command, requirement]) == 0 and list(Path(temporary).glob(pattern))
            if not downloaded:
                raise BuildError(
                    f"There is no wheel of {requirement} for {blender_platform} and Python "
                    f"{python} where pip looks. Check the network connection, or choose other "
                    "platforms or Pythons (--platform, --python)"
                )
            os.replace(downloaded[0], folder / downloaded[0].name)
    return next(folder.glob(pattern))


def kernel_wheel(name: str, folder: Path) -> Path:
    """Write the wheel of a platform's kernels, which serves every Python, to a folder."""
    say(f"Building the wheel of the kernels for {name}")
    command: list[str | Path] = [VENV_PYTHON, "-m", "pip", "wheel", "--quiet", "--no-deps"]
    command += ["--no-build-isolation", "--wheel-dir", folder, KERNELS]
    if run(command, {"NICMM_KERNELS_PLATFORM": name}) != 0:
        raise BuildError(f"The kernels could not be built for {name}; see the output above")
    return next(folder.glob(f"nicmm_kernels-*-{compile_library.PLATFORMS[name][1]}.whl"))


def collect_wheels(blender_platform: str, pythons: Sequence[str], folder: Path) -> list[Path]:
    """The wheels that a zip contains, each once; those that are built are written to a folder."""
    requirements = [pinned(name) for name in BUNDLED]
    wheels = {}
    for python in pythons:
        found = [download(requirement, blender_platform, python) for requirement in requirements]
        # For Blender, a wheel for the stable ABI supports the major Python version only. It refuses
        # an extension if no wheel names the minor version.
        tag = f"-cp{python.replace('.', '')}-"
        if not any(tag in wheel.name for wheel in found):
            raise BuildError(f"No wheel is built for Python {python} itself ({tag.strip('-')})")
        wheels.update({wheel.name: wheel for wheel in found})
    kernels = kernel_wheel(blender_platform, folder)
    wheels[kernels.name] = kernels
    return sorted(wheels.values(), key=lambda wheel: wheel.name)


def blender_tool() -> tuple[Path, Path]:
    """Paths of Blender's packaging tool and its list of tags, from the installed bpy module."""
    # The module is located without importing it, since an import would start Blender.
    search = "import importlib.util as u; print(u.find_spec('bpy').submodule_search_locations[0])"
    bpy = subprocess.run([VENV_PYTHON, "-c", search], capture_output=True, text=True, check=True)
    scripts = next(Path(bpy.stdout.strip()).glob("*/scripts"))
    return (
        scripts / "addons_core/bl_pkg/cli/blender_ext.py",
        scripts / "modules/_bpy_internal/extensions/tags.py",
    )


def package(
    blender_platform: str,
    pythons: Sequence[str] = BLENDER_PYTHONS,
    output: Path = DIST,
) -> Path:
    """Build the zip of one platform, validate it with Blender's own tool, and return its path."""
    ensure_environment()
    tool, tags = blender_tool()
    facts = manifest()
    name = f"{facts['id']}-{facts['version']}-{blender_platform.replace('-', '_')}"
    archive = output / f"{name}.zip"
    output.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as temporary:
        wheels = collect_wheels(blender_platform, pythons, Path(temporary) / "wheels")
        source = Path(temporary) / facts["id"]
        stage(source, wheels, blender_platform)
        for arguments in (
            ["build", "--source-dir", str(source), "--output-filepath", str(archive)],
            ["validate", str(archive)],
        ):
            if run([VENV_PYTHON, tool, *arguments, "--valid-tags", tags]) != 0:
                raise BuildError("Blender's tool rejected the extension; see the output above")
    size = archive.stat().st_size
    if size > LARGEST_ZIP:
        raise BuildError(
            f"{archive.name} is {size / 1e6:.0f} MB large, more than {LARGEST_ZIP / 1e6:.0f} MB. "
            "Build it for fewer versions of Python (--python)"
        )
    return archive


def this_platform() -> str:
    """Blender's name for the platform on which this script runs."""
    try:
        return compile_library.this_platform()
    except compile_library.CompileError as error:
        raise BuildError(str(error)) from None
