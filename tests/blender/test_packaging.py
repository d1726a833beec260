"""The build script and the contents of its zips."""

import re
import subprocess
import sys
import tomllib
import zipfile

import pytest

from building import environment, extension, release, reviewed


def test_manifest_follows_blenders_rules():
    manifest = environment.manifest()
    assert manifest["id"] == "nicmm_curves"
    assert re.fullmatch(r"\d+\.\d+\.\d+", manifest["version"])
    assert len(manifest["tagline"]) <= 64
    assert not manifest["tagline"].endswith(".")
    assert set(manifest["permissions"]) == {"files"}  # no network
    for reason in manifest["permissions"].values():
        assert len(reason) <= 64
        assert not reason.endswith(".")


def test_version_stands_in_the_manifest_only():
    project = tomllib.loads((environment.ROOT / "pyproject.toml").read_text())
    assert "version" in project["project"]["dynamic"]
    version = environment.manifest()["version"]
    for package in ("nicmm_core", "nicmm_blender"):
        for source in (environment.ROOT / package).rglob("*.py"):
            assert f'"{version}"' not in source.read_text(), source


def test_every_requirement_is_pinned_and_justified():
    lines = environment.REQUIREMENTS.read_text().splitlines()[1:]
    for line in lines:
        assert re.fullmatch(r"[a-z-]+==[\d.]+  # .+", line)
    assert environment.pinned("scipy") == next(line for line in lines if "scipy" in line).split()[0]
    with pytest.raises(environment.BuildError, match="no pin of blas"):
        environment.pinned("blas")


def test_kernels_are_compiled_by_the_pinned_compiler():
    for project in (environment.ROOT, environment.KERNELS):
        settings = tomllib.loads((project / "pyproject.toml").read_text())
        assert environment.pinned("ziglang") in settings["build-system"]["requires"]


@pytest.mark.slow
def test_wheel_of_the_kernels_holds_one_library(tmp_path):
    wheel = extension.kernel_wheel("linux-arm64", tmp_path)
    assert wheel.name.endswith("-py3-none-manylinux_2_28_aarch64.whl")
    with zipfile.ZipFile(wheel) as opened:
        files = [name for name in opened.namelist() if ".dist-info/" not in name]
    binary = [name for name in files if not name.endswith((".py", "/py.typed"))]
    assert binary == ["nicmm_kernels/libnicmm_kernels.so"]
    assert {"nicmm_kernels/__init__.py", "nicmm_kernels/library.py"} <= set(files)


def test_staged_folder_is_clean(tmp_path):
    extension.stage(tmp_path / "stage")
    staged = {path.relative_to(tmp_path / "stage").as_posix() for path in tmp_path.rglob("*")}
    assert {"__init__.py", "LICENSE", environment.MANIFEST, "nicmm_core", "nicmm_blender"} <= staged
    assert not [name for name in staged if "__pycache__" in name or name.startswith("tests")]
    assert not [name for name in staged if "numpy" in name]


def test_zip_holds_the_wheels_of_every_blender(archive):
    assert archive.name.startswith(f"nicmm_curves-{environment.manifest()['version']}-")
    with zipfile.ZipFile(archive) as opened:
        names = opened.namelist()
        manifest = tomllib.loads(opened.read(environment.MANIFEST).decode())
    wheels = [name for name in names if name.endswith(".whl")]
    assert sorted(manifest["wheels"]) == sorted(f"./{wheel}" for wheel in wheels)
    assert manifest["platforms"] == [extension.this_platform()]
    packages = {wheel.split("/")[1].split("-")[0] for wheel in wheels}
    assert packages == {"libigl", "nicmm_kernels", "scipy", "threadpoolctl"}
    assert [wheel for wheel in wheels if "nicmm_kernels" in wheel and "-py3-none-" in wheel]
    assert not [name for name in names if name.endswith((".so", ".dll", ".dylib"))]
    for python in extension.BLENDER_PYTHONS:
        assert [wheel for wheel in wheels if f"-cp{python.replace('.', '')}-" in wheel]
    assert {"__init__.py", "nicmm_core/__init__.py", "nicmm_blender/__init__.py"} <= set(names)


@pytest.mark.slow
def test_zip_is_small_enough_for_the_platform(archive, monkeypatch, tmp_path):
    assert archive.stat().st_size <= extension.LARGEST_ZIP == 120e6
    monkeypatch.setattr(extension, "LARGEST_ZIP", 1e3)
    monkeypatch.setattr(extension, "collect_wheels", lambda *given: [])  # the other files suffice
    with pytest.raises(environment.BuildError, match="more than 0 MB"):
        extension.package(extension.this_platform(), output=tmp_path)


@pytest.mark.slow
def test_missing_wheel_says_what_to_do(capfd):
    with pytest.raises(environment.BuildError, match=r"no wheel of scipy==0\.0\.1 .*--platform"):
        extension.download("scipy==0.0.1", "linux-x64", "3.11")


def test_wrong_python_says_what_to_do(monkeypatch):
    monkeypatch.setattr(environment, "PYTHON", (3, 99))
    with pytest.raises(
        environment.BuildError, match=r"Python 3\.99 is needed.*python3\.99 build\.py"
    ):
        environment.check_python()


def test_missing_venv_says_what_to_do(monkeypatch):
    monkeypatch.setitem(sys.modules, "ensurepip", None)
    with pytest.raises(environment.BuildError, match="lacks its module ensurepip.*apt install"):
        environment.check_python()


def test_help_without_arguments():
    ran = subprocess.run(
        [sys.executable, environment.ROOT / "build.py"], capture_output=True, text=True, check=True
    )
    for command in ("demo", "test", "docs", "package", "release"):
        assert command in ran.stdout


@pytest.mark.slow
def test_zip_passes_our_review(archive):
    assert reviewed.faults(archive) == []


@pytest.mark.slow
def test_review_finds_what_platforms_refuse(archive, tmp_path):
    bad = tmp_path / "bad.zip"
    with zipfile.ZipFile(archive) as old, zipfile.ZipFile(bad, "w") as new:
        for name in old.namelist():
            if name.endswith(".whl") or name == "LICENSE":
                continue
            text = old.read(name)
            if name == environment.MANIFEST:
                text = text.replace(b"website", b"no_website")
            new.writestr(name, text)
        new.writestr("nicmm_core/loose.so", b"")
        new.writestr("nicmm_core/__pycache__/x.pyc", b"")
        new.writestr("nicmm_core/fetch.py", b"import urllib.request\neval('1')\n")
    assert sorted(reviewed.faults(bad)) == [
        "nicmm_core/__pycache__/x.pyc is no part of an extension",
        "nicmm_core/fetch.py imports urllib, which needs the permission network",
        "nicmm_core/fetch.py runs code from text",
        "nicmm_core/loose.so is outside a wheel",
        "the licence is missing",
        "the manifest lacks website",
        "the wheels are not those of the manifest",
    ]


@pytest.mark.slow
@pytest.mark.parametrize("released", [False, True])
def test_wheel_of_the_core(monkeypatch, tmp_path, released):
    """The wheel of a release is pure and needs that of the kernels; another one includes them."""
    monkeypatch.setenv("NICMM_RELEASE", str(int(released)))
    pip = [environment.VENV_PYTHON, "-m", "pip", "wheel", "--quiet", "--no-deps"]
    command = [*pip, "--no-build-isolation", "--wheel-dir", tmp_path, environment.ROOT]
    assert environment.run(command) == 0
    (wheel,) = tmp_path.glob("*.whl")
    assert wheel.name.endswith("-py3-none-any.whl") is released
    with zipfile.ZipFile(wheel) as opened:
        names = opened.namelist()
        metadata = opened.read(next(name for name in names if name.endswith("/METADATA"))).decode()
    assert {"nicmm_core/py.typed", "nicmm_core/design.py"} <= set(names)
    version = environment.manifest()["version"]
    assert (f"Requires-Dist: nicmm-kernels=={version}" in metadata) is released
    libraries = [name for name in names if name.endswith((".so", ".dll", ".dylib"))]
    assert len(libraries) == (0 if released else 1)
    assert ("nicmm_kernels/library.py" in names) is not released


def test_list_of_a_release():
    text = release.report([("zips", True, "99 MB"), ("tests", False, "a | b\nc")])
    assert "| zips | passed | 99 MB |" in text
    assert "| tests | **failed** | a \\| b c |" in text
    assert "1 of 2 passed." in text
