"""Fixtures: Blender with the extension installed from the zip, never from the source tree.

By default Blender is the bpy module. A Blender application runs the same tests with a zip that was
built for it:

    NICMM_TEST_ZIP=nicmm_curves.zip BLENDER_USER_RESOURCES=$(mktemp -d) blender -b \\
        --python-exit-code 1 --python-expr "import sys, pytest; sys.path.insert(0, '.'); \\
        assert pytest.main(['tests/blender', '-q']) == 0"
"""

import os
import sys
import tempfile
from dataclasses import astuple
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from building import extension as packaging

IN_BLENDER = "bpy" in sys.modules
if not IN_BLENDER:
    # Blender reads this when bpy is first imported, so the tests do not touch the user's settings.
    _user_folder = tempfile.TemporaryDirectory(prefix="nicmm-blender-")
    os.environ["BLENDER_USER_RESOURCES"] = _user_folder.name

import bpy  # noqa: E402

import addon_utils  # noqa: E402

MODULE = "bl_ext.user_default.nicmm_curves"


@pytest.fixture
def bpy_module():
    """For tests that start another Python process with the bpy module, or build zips."""
    if IN_BLENDER:
        pytest.skip("this Python has no bpy module that another process could import")


@pytest.fixture(scope="session")
def archive(tmp_path_factory):
    """The zip for this platform, as users install it."""
    if "NICMM_TEST_ZIP" in os.environ:
        return Path(os.environ["NICMM_TEST_ZIP"])
    return packaging.package(packaging.this_platform(), output=tmp_path_factory.mktemp("package"))


@pytest.fixture(scope="session")
def extension(archive):
    """The installed extension: its `name`, `module`, `core` and `folder`.

    It makes only the first attempt at each curve, which is enough to test what becomes of it.
    """
    bpy.ops.extensions.package_install_files(
        filepath=str(archive), repo="user_default", enable_on_install=False
    )
    addon_utils.extensions_refresh()
    module = addon_utils.enable(MODULE, default_set=True)
    assert module is not None, "the extension was not installed or did not register"
    improvement = import_module(f"{MODULE}.nicmm_core.improvement")
    most_work, improvement.MOST_WORK = improvement.MOST_WORK, 0  # `all_attempts` undoes this
    yield SimpleNamespace(
        name=MODULE,
        module=module,
        core=import_module(f"{MODULE}.nicmm_core"),
        folder=os.path.dirname(module.__file__),
        improvement=improvement,
        most_work=most_work,
    )
    # Blender hangs at exit if classes of a script are still registered.
    addon_utils.disable(MODULE, default_set=True)


@pytest.fixture
def empty_scene(extension):
    """The extension, with a new file without objects and a new undo history."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.ed.undo_push(message="Start")
    return extension


@pytest.fixture
def all_attempts(extension, monkeypatch):
    """Make all attempts at a curve, as for users."""
    monkeypatch.setattr(extension.improvement, "MOST_WORK", extension.most_work)


_designs: dict = {}


@pytest.fixture
def remembered_designs(extension, monkeypatch):
    """Compute equal designs once, for tests of what becomes of a curve in Blender.

    That equal requests get equal curves is tested with the core. Bounded steps, as of a drag,
    designs that start from other ones and cancelled designs are not remembered.
    """
    plain = extension.core.Designer.design

    def design(self, points, *, progress=None, **options):
        continues = isinstance(options.get("start"), extension.core.Design)
        if continues or options.get("max_iterations") is not None:
            return plain(self, points, progress=progress, **options)
        key = _key((self.mesh.vertices, self.mesh.faces, points, sorted(options.items())))
        if key not in _designs:
            found = plain(self, points, progress=progress, **options)
            if found.status is extension.core.Status.CANCELLED:
                return found
            _designs[key] = found
        return _designs[key]

    monkeypatch.setattr(extension.core.Designer, "design", design)


def _key(value):
    """A hashable value that is the same for equal arguments of a design."""
    if isinstance(value, np.ndarray):
        return value.shape, value.dtype.str, value.tobytes()
    if isinstance(value, dict):
        return _key(sorted(value.items()))
    if isinstance(value, tuple | list):
        return tuple(_key(each) for each in value)
    if hasattr(value, "__dataclass_fields__"):
        return _key(astuple(value))
    return value
