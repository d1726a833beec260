# SPDX-License-Identifier: GPL-3.0-or-later
"""Preferences of the extension, with a report of the libraries that were found."""

import functools
import importlib.metadata
import importlib.util
from typing import TypeVar

import bpy
from bpy.props import FloatProperty, IntProperty

PACKAGE = __package__.rpartition(".")[0]
"""Module name under which Blender knows the extension."""

Number = TypeVar("Number", int, float)

PATIENCE = 0.4
KEPT_MESHES = 2
LIVE_DELAY = 0.3


class _Limits:
    """Preferences that threads read, which must not access Blender's data."""

    kept_meshes = KEPT_MESHES


def _note_limits(
    _preferences: bpy.types.AddonPreferences | None = None,
    _context: bpy.types.Context | None = None,
) -> None:
    _Limits.kept_meshes = _get("kept_meshes", KEPT_MESHES)


class NICMM_AP_preferences(bpy.types.AddonPreferences):
    bl_idname = PACKAGE

    patience: FloatProperty(
        name="Wait Time",
        description="How long Blender waits for a curve before it shows progress. A longer "
        "computation continues while the window responds, and Esc cancels it",
        default=PATIENCE,
        min=0.0,
        max=10.0,
        subtype="TIME_ABSOLUTE",
    )
    kept_meshes: IntProperty(
        name="Meshes Kept in Memory",
        description="Number of recently used meshes to keep in memory, so that further curves "
        "on them are faster. Each mesh takes about 400 bytes per vertex",
        default=KEPT_MESHES,
        min=1,
        max=64,
        update=_note_limits,
    )
    live_delay: FloatProperty(
        name="Live Update Delay",
        description="How long a mesh must stay unchanged before its curves are updated",
        default=LIVE_DELAY,
        min=0.05,
        max=10.0,
        subtype="TIME_ABSOLUTE",
    )

    def draw(self, _context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        column = layout.column()
        for name in ("patience", "kept_meshes", "live_delay"):
            column.prop(self, name)
        box = layout.box()
        for line in library_report():
            box.label(text=line)


LIBRARIES = (("scipy", "SciPy"), ("igl", "libigl"), ("threadpoolctl", "threadpoolctl"))
"""Modules from the wheels of the extension, and their names."""


@functools.cache
def library_report() -> tuple[str, ...]:
    """Lines that list the libraries found, without loading them."""
    lines = []
    for module, name in LIBRARIES:
        version = _version(module, name)
        missing = f"{name} is missing. Install the zip for this platform and Blender version"
        lines.append(f"{name} {version}" if version else missing)
    return (*lines, "The extension does not access the internet")


def _version(module: str, distribution: str) -> str:
    """The version of a package, or an empty string if it cannot be imported."""
    if importlib.util.find_spec(module) is None:
        return ""
    try:
        return importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        return "of unknown version"


def _get(name: str, default: Number) -> Number:
    """The value of a preference, or its default if the extension is not registered as an add-on."""
    addon = bpy.context.preferences.addons.get(PACKAGE)
    found = None if addon is None else addon.preferences
    return default if found is None else getattr(found, name)


def patience() -> float:
    """Seconds that Blender waits for a curve before the work continues in time slices."""
    return _get("patience", PATIENCE)


def kept_meshes() -> int:
    """Number of meshes whose designers are kept in memory; threads may call this."""
    return _Limits.kept_meshes


def live_delay() -> float:
    """Seconds that a mesh must stay unchanged before its curves are updated."""
    return _get("live_delay", LIVE_DELAY)


def register() -> None:
    bpy.utils.register_class(NICMM_AP_preferences)
    _note_limits()


def unregister() -> None:
    bpy.utils.unregister_class(NICMM_AP_preferences)
