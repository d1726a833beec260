# SPDX-License-Identifier: GPL-3.0-or-later
"""Installs a zip of the extension in Blender and designs a curve, as a smoke test.

Runs in the module bpy or in a Blender:

    .venv/bin/python building/try_extension.py ZIP
    blender -b --factory-startup --python-exit-code 1 --python building/try_extension.py -- ZIP

Set BLENDER_USER_RESOURCES to an empty folder, since the extension is installed there.
"""

import sys

import bpy

MODULE = "bl_ext.user_default.nicmm_curves"

given = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.extensions.package_install_files(
    filepath=given[0], repo="user_default", enable_on_install=True
)
if MODULE not in bpy.context.preferences.addons:
    sys.exit(f"{given[0]} was not installed or not enabled")
bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=4)
bpy.ops.nicmm.design_curve(points="3, 60, 100, 140", order="SHORTEST")
curve = bpy.context.active_object
points = len(curve.data.splines[0].points)
print(f"Blender {bpy.app.version_string}: {curve.name} with {points} points")
if curve.type != "CURVE" or points < 20:
    sys.exit("no curve was designed")
