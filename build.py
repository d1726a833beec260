#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs the demo and the tests of NICMM Curves and builds its packages; needs only Python 3.11.

    python3 build.py demo      draw curves on Suzanne in headless Blender and render them
    python3 build.py test      run every check; --quick leaves out the slow tests
    python3 build.py package   build the installable zips

Each command makes `.venv/` on its first run and installs requirements.txt into it.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import platform
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parent
KERNELS = ROOT / "kernels"
VENV = ROOT / ".venv"
VENV_PYTHON = VENV / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
DIST = ROOT / "dist"
REQUIREMENTS = ROOT / "requirements.txt"
MANIFEST = "blender_manifest.toml"

PYTHON = (3, 11)  # the Python of Blender 4.5 and its bpy module
BLENDER_PYTHONS = ("3.11", "3.13")  # of Blender 4.5 and 5.0, and of later versions

# The wheel tags that each of Blender's platforms accepts, in order of preference.
PLATFORMS = {
    "linux-x64": ("manylinux_2_28_x86_64", "manylinux_2_27_x86_64", "manylinux2014_x86_64"),
    "windows-x64": ("win_amd64",),
    "macos-arm64": ("macosx_12_0_arm64",),
}

LARGEST_ZIP = 120e6
"""Largest size of a zip, in bytes."""

ONE_THREAD = {
    **{f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL")},
    "NICMM_THREADS": "1",
}
"""Environment of the tests: there is a process per core, and more threads only slow them down."""

KERNEL_PLATFORMS = ("linux-x64", "linux-arm64", "windows-x64", "macos-arm64", "macos-x64")
"""Platforms for which the wheel of the compiled kernels is built, with a zip or without."""

# NumPy is not bundled: all extensions share the NumPy that Blender includes.
BUNDLED = ("libigl", "scipy", "threadpoolctl")

EXTENSION_INIT = '''\
# SPDX-License-Identifier: GPL-3.0-or-later
"""NICMM Curves: smooth curves on meshes through selected vertices."""

from .nicmm_blender import register, unregister

__all__ = ["register", "unregister"]
'''


class BuildError(Exception):
    """A step has failed; the message says why and what to do."""


def say(text: str) -> None:
    print(f"-- {text}", flush=True)


def run(
    arguments: Sequence[str | Path], environment: dict[str, str] | None = None, folder: Path = ROOT
) -> int:
    """Run a command in a folder, show its output and return its exit status."""
    return subprocess.run(
        [str(argument) for argument in arguments],
        cwd=folder,
        env={**os.environ, **(environment or {})},
        check=False,
    ).returncode


# The environment


def pinned(name: str) -> str:
    """The pin of a package in requirements.txt, such as "scipy==1.17.1"."""
    for line in REQUIREMENTS.read_text(encoding="utf-8").splitlines():
        requirement = line.split("#")[0].strip()
        if requirement.startswith(f"{name}=="):
            return requirement
    raise BuildError(f"{REQUIREMENTS.name} has no pin of {name}. Add a line {name}==VERSION")


def check_python() -> None:
    needed = ".".join(map(str, PYTHON))
    if sys.version_info[:2] != PYTHON:
        raise BuildError(
            f"Python {needed} is needed, as Blender 4.5 is built with it; this is Python "
            f"{platform.python_version()}. Install Python {needed} and run: "
            f"python{needed} build.py {' '.join(sys.argv[1:])}"
        )
    for module in ("venv", "ensurepip"):
        try:
            __import__(module)
        except ImportError:
            raise BuildError(
                f"This Python lacks its module {module}. On Debian and Ubuntu run: "
                f"apt install python{needed}-venv; elsewhere install Python {needed} in full"
            ) from None


def ensure_environment() -> None:
    """Create `.venv/` with the pinned packages, unless it already contains them."""
    check_python()
    fingerprint = hashlib.sha256(REQUIREMENTS.read_bytes()).hexdigest()
    stamp = VENV / "installed.sha256"
    if VENV_PYTHON.exists() and stamp.is_file() and stamp.read_text() == fingerprint:
        compile_kernels()
        return
    if VENV.is_symlink():
        raise BuildError(
            f"{VENV.name}/ is a symbolic link without the packages in {REQUIREMENTS.name}. It is "
            "not overwritten, since another project may use it: remove the link, or update its "
            "target"
        )
    say(f"Making {VENV.name}/ and installing {REQUIREMENTS.name} (some minutes, once)")
    if run([sys.executable, "-m", "venv", "--clear", VENV]) != 0:
        raise BuildError(f"{VENV.name}/ could not be created; see the output above")
    if run([VENV_PYTHON, "-m", "pip", "install", "-r", REQUIREMENTS]) != 0:
        raise BuildError(
            "A package could not be installed; see pip's output above, check the network "
            "connection and run the same command again"
        )
    stamp.write_text(fingerprint)
    compile_kernels()


def compile_kernels() -> None:
    """Compile the kernels unless their sources are unchanged, and let `.venv/` import them."""
    if run([VENV_PYTHON, KERNELS / "compile_library.py"]) != 0:
        raise BuildError("The kernels could not be compiled; see the output above")
    if VENV.is_symlink():
        return  # the environment of another copy of the sources, which has its own kernels
    pattern = "Lib/site-packages" if os.name == "nt" else "lib/python*/site-packages"
    for packages in VENV.glob(pattern):
        (packages / "nicmm_kernels.pth").write_text(f"{KERNELS}\n", encoding="utf-8")


# The extension


def manifest() -> dict:
    import tomllib  # imported here, so that an older Python gets as far as check_python

    return tomllib.loads((ROOT / MANIFEST).read_text(encoding="utf-8"))


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
        command = [str(VENV_PYTHON), "-m", "pip", "download", "--quiet", "--no-deps"]
        command += ["--only-binary=:all:", "--python-version", python, "--dest", str(folder)]
        for tag in PLATFORMS[blender_platform]:
            command += ["--platform", tag]
        if run([*command, requirement]) != 0 or not list(folder.glob(pattern)):
            raise BuildError(
                f"There is no wheel of {requirement} for {blender_platform} and Python {python} "
                "where pip looks. Check the network connection, or choose other platforms or "
                "Pythons (--platform, --python)"
            )
    return next(folder.glob(pattern))


def kernel_wheel(name: str) -> Path:
    """The wheel of the compiled kernels for a platform, built anew; it serves every Python."""
    folder = DIST / "wheels" / f"{name}-kernels"
    shutil.rmtree(folder, ignore_errors=True)
    say(f"Building the wheel of the kernels for {name}")
    command: list[str | Path] = [VENV_PYTHON, "-m", "pip", "wheel", "--quiet", "--no-deps"]
    command += ["--no-build-isolation", "--wheel-dir", folder, KERNELS]
    if run(command, {"NICMM_KERNELS_PLATFORM": name}) != 0:
        raise BuildError(f"The kernels could not be built for {name}; see the output above")
    return next(folder.glob("nicmm_kernels-*.whl"))


def collect_wheels(blender_platform: str, pythons: Sequence[str]) -> list[Path]:
    """The wheels that a zip contains, each once."""
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
    kernels = kernel_wheel(blender_platform)
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
    wheels = collect_wheels(blender_platform, pythons)
    tool, tags = blender_tool()
    facts = manifest()
    name = f"{facts['id']}-{facts['version']}-{blender_platform.replace('-', '_')}"
    archive = output / f"{name}.zip"
    output.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as temporary:
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
    system = {"Linux": "linux", "Windows": "windows", "Darwin": "macos"}.get(platform.system())
    machine = {"x86_64": "x64", "amd64": "x64", "arm64": "arm64"}.get(platform.machine().lower())
    name = f"{system}-{machine}"
    if name not in PLATFORMS:
        raise BuildError(
            f"No zip is built for {platform.system()} on {platform.machine()}; there are "
            + ", ".join(PLATFORMS)
        )
    return name


# The commands


def command_demo(arguments: argparse.Namespace) -> int:
    ensure_environment()
    script = "close_ups.py" if arguments.close_ups else "suzanne.py"
    with tempfile.TemporaryDirectory() as user_folder:
        # Blender finds the extension where it installs extensions; its wheels are in .venv.
        stage(Path(user_folder) / "extensions" / "user_default" / manifest()["id"])
        return run([VENV_PYTHON, ROOT / "demo" / script], {"BLENDER_USER_RESOURCES": user_folder})


def command_test(arguments: argparse.Namespace) -> int:
    ensure_environment()
    if arguments.sanitize:
        return test_sanitized(arguments.pytest_arguments)
    if arguments.platforms:
        return run([VENV_PYTHON, "-m", "tests.kernels.platforms.compare"], ONE_THREAD)
    extension = DIST / "checked" / manifest()["id"]  # in the zip's layout, its imports are valid
    shutil.rmtree(extension, ignore_errors=True)
    stage(extension)
    typed = ("mypy", "--config-file", ROOT / "pyproject.toml", "--cache-dir", ROOT / ".mypy_cache")
    checks: tuple[tuple[str, Path, Sequence[str | Path]], ...] = (
        ("ruff check", ROOT, ("ruff", "check")),
        ("ruff format", ROOT, ("ruff", "format", "--check")),
        ("mypy", ROOT, ("mypy",)),
        ("mypy of the extension", extension, (*typed, "__init__.py", "nicmm_blender")),
        (
            "pytest",
            ROOT,
            (
                *("pytest", "--durations=10", "--numprocesses=auto", "--dist=worksteal"),
                *(("-m", "not slow") if arguments.quick else ()),
                *arguments.pytest_arguments,
            ),
        ),
    )
    failed = []
    for name, folder, command in checks:
        say(name)
        if run([VENV_PYTHON, "-m", *command], ONE_THREAD, folder) != 0:
            failed.append(name)
    if failed:
        say(f"Failed: {', '.join(failed)}")
    return 1 if failed else 0


def test_sanitized(arguments: Sequence[str]) -> int:
    """Run the quick tests of the core with kernels that check themselves, compiled by gcc."""
    if run([VENV_PYTHON, KERNELS / "compile_library.py", "sanitized"]) != 0:
        raise BuildError("gcc with its sanitizers is needed; see the output above")
    # Without the library of C++, the runtime aborts where a library throws an exception.
    runtime = [
        subprocess.run(
            ["gcc", f"-print-file-name={name}"], capture_output=True, text=True, check=True
        ).stdout.strip()
        for name in ("libasan.so", "libstdc++.so")
    ]
    environment = {
        **ONE_THREAD,
        "NICMM_KERNELS_LIBRARY": str(KERNELS / "nicmm_kernels/libnicmm_kernels_sanitized.so"),
        "LD_PRELOAD": " ".join(runtime),
        # Python itself frees little at its end, and tests ask for more memory than there is.
        "ASAN_OPTIONS": "detect_leaks=0:allocator_may_return_null=1",
    }
    options = ["--numprocesses=auto", "--dist=worksteal", "-m", "not slow"]
    where = arguments or ["tests/core", "tests/kernels"]
    return run([VENV_PYTHON, "-m", "pytest", *options, *where], environment)


def command_package(arguments: argparse.Namespace) -> int:
    for blender_platform in arguments.platform or PLATFORMS:
        archive = package(
            blender_platform,
            arguments.python or BLENDER_PYTHONS,
            arguments.output.resolve(),
        )
        say(f"{archive} ({archive.stat().st_size / 1e6:.0f} MB)")
    if not arguments.platform:
        for name in KERNEL_PLATFORMS:
            if name not in PLATFORMS:  # those of the zips have been built with them
                say(f"{kernel_wheel(name)}")
    return 0


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="build.py", description="Demo, tests and packages of NICMM Curves."
    )
    commands = parser.add_subparsers(title="commands", metavar="COMMAND")

    demo = commands.add_parser("demo", help="draw curves on Suzanne in headless Blender")
    demo.add_argument("--close-ups", action="store_true", help="render tubes close up instead")
    demo.set_defaults(command=command_demo)

    test = commands.add_parser("test", help="run every check")
    test.add_argument("--quick", action="store_true", help="leave out the slow tests")
    test.add_argument(
        "--sanitize",
        action="store_true",
        help="run the quick tests of the core with memory checks of the kernels (Linux, gcc)",
    )
    test.add_argument(
        "--platforms",
        action="store_true",
        help="compare the results of the kernels of all platforms, bit by bit (qemu-user, wine)",
    )
    test.add_argument(
        "pytest_arguments", nargs=argparse.REMAINDER, help="passed to pytest, such as tests/blender"
    )
    test.set_defaults(command=command_test)

    pack = commands.add_parser("package", help="build the installable zips in dist/")
    pack.add_argument(
        "--platform", action="append", choices=PLATFORMS, help="default: every platform; repeatable"
    )
    pack.add_argument(
        "--python",
        action="append",
        metavar="X.Y",
        help=f"Python of Blender; default: {' and '.join(BLENDER_PYTHONS)}; repeatable",
    )
    pack.add_argument("--output", type=Path, default=DIST, help="folder of the zips; default: dist")
    pack.set_defaults(command=command_package)

    parsed = parser.parse_args(arguments)
    if "command" not in parsed:
        parser.print_help()
        parser.exit()
    return parsed


def main() -> int:
    arguments = parse(sys.argv[1:])
    try:
        return arguments.command(arguments)
    except BuildError as error:
        print(f"build.py: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
