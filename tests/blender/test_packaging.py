"""The build script and the contents of its zips."""

import re
import subprocess
import sys
import tomllib
import zipfile

import pytest

import build


def test_manifest_follows_blenders_rules():
    manifest = build.manifest()
    assert manifest["id"] == "nicmm_curves"
    assert re.fullmatch(r"\d+\.\d+\.\d+", manifest["version"])
    assert len(manifest["tagline"]) <= 64
    assert not manifest["tagline"].endswith(".")
    assert set(manifest["permissions"]) == {"files"}  # no network
    for reason in manifest["permissions"].values():
        assert len(reason) <= 64
        assert not reason.endswith(".")


def test_version_stands_in_the_manifest_only():
    project = tomllib.loads((build.ROOT / "pyproject.toml").read_text())
    assert project["project"]["dynamic"] == ["version"]
    version = build.manifest()["version"]
    for package in ("nicmm_core", "nicmm_blender"):
        for source in (build.ROOT / package).rglob("*.py"):
            assert f'"{version}"' not in source.read_text(), source


def test_every_requirement_is_pinned_and_justified():
    lines = build.REQUIREMENTS.read_text().splitlines()[1:]
    for line in lines:
        assert re.fullmatch(r"[a-z-]+==[\d.]+  # .+", line)
    assert build.pinned("scipy") == next(line for line in lines if "scipy" in line).split()[0]
    with pytest.raises(build.BuildError, match="no pin of blas"):
        build.pinned("blas")


def test_kernels_are_compiled_by_the_pinned_compiler():
    for project in (build.ROOT, build.KERNELS):
        settings = tomllib.loads((project / "pyproject.toml").read_text())
        assert build.pinned("ziglang") in settings["build-system"]["requires"]


@pytest.mark.slow
def test_wheel_of_the_kernels_holds_one_library():
    wheel = build.kernel_wheel("linux-arm64")
    assert wheel.name.endswith("-py3-none-manylinux_2_28_aarch64.whl")
    with zipfile.ZipFile(wheel) as opened:
        files = [name for name in opened.namelist() if ".dist-info/" not in name]
    binary = [name for name in files if not name.endswith((".py", "/py.typed"))]
    assert binary == ["nicmm_kernels/libnicmm_kernels.so"]
    assert {"nicmm_kernels/__init__.py", "nicmm_kernels/library.py"} <= set(files)


def test_staged_folder_is_clean(tmp_path):
    build.stage(tmp_path / "stage")
    staged = {path.relative_to(tmp_path / "stage").as_posix() for path in tmp_path.rglob("*")}
    assert {"__init__.py", "LICENSE", build.MANIFEST, "nicmm_core", "nicmm_blender"} <= staged
    assert not [name for name in staged if "__pycache__" in name or name.startswith("tests")]
    assert not [name for name in staged if "numpy" in name]


def test_zip_holds_the_wheels_of_every_blender(archive):
    assert archive.name.startswith(f"nicmm_curves-{build.manifest()['version']}-")
    with zipfile.ZipFile(archive) as opened:
        names = opened.namelist()
        manifest = tomllib.loads(opened.read(build.MANIFEST).decode())
    wheels = [name for name in names if name.endswith(".whl")]
    assert sorted(manifest["wheels"]) == sorted(f"./{wheel}" for wheel in wheels)
    assert manifest["platforms"] == [build.this_platform()]
    packages = {wheel.split("/")[1].split("-")[0] for wheel in wheels}
    assert packages == {"libigl", "nicmm_kernels", "scipy", "threadpoolctl"}
    assert [wheel for wheel in wheels if "nicmm_kernels" in wheel and "-py3-none-" in wheel]
    assert not [name for name in names if name.endswith((".so", ".dll", ".dylib"))]
    for python in build.BLENDER_PYTHONS:
        assert [wheel for wheel in wheels if f"-cp{python.replace('.', '')}-" in wheel]
    assert {"__init__.py", "nicmm_core/__init__.py", "nicmm_blender/__init__.py"} <= set(names)


@pytest.mark.slow
def test_zip_is_small_enough_for_the_platform(archive, monkeypatch, tmp_path):
    assert archive.stat().st_size <= build.LARGEST_ZIP == 120e6
    monkeypatch.setattr(build, "LARGEST_ZIP", 1e3)
    monkeypatch.setattr(build, "collect_wheels", lambda *given: [])  # the other files suffice
    with pytest.raises(build.BuildError, match="more than 0 MB"):
        build.package(build.this_platform(), output=tmp_path)


@pytest.mark.slow
def test_missing_wheel_says_what_to_do(capfd):
    with pytest.raises(build.BuildError, match=r"no wheel of scipy==0\.0\.1 .*--platform"):
        build.download("scipy==0.0.1", "linux-x64", "3.11")


def test_wrong_python_says_what_to_do(monkeypatch):
    monkeypatch.setattr(build, "PYTHON", (3, 99))
    with pytest.raises(build.BuildError, match=r"Python 3\.99 is needed.*python3\.99 build\.py"):
        build.check_python()


def test_missing_venv_says_what_to_do(monkeypatch):
    monkeypatch.setitem(sys.modules, "ensurepip", None)
    with pytest.raises(build.BuildError, match="lacks its module ensurepip.*apt install"):
        build.check_python()


def test_help_without_arguments():
    ran = subprocess.run(
        [sys.executable, build.ROOT / "build.py"], capture_output=True, text=True, check=True
    )
    for command in ("demo", "test", "package"):
        assert command in ran.stdout
