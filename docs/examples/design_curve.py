# SPDX-License-Identifier: GPL-3.0-or-later
"""Draw a closed curve through vertices of a mesh, in the order given, without a window.

    blender -b head.blend --python-exit-code 1 --python design_curve.py -- \
        Suzanne 73,365,74,366 out.blend
"""

import sys

import bpy

mesh_name, indices, output = sys.argv[sys.argv.index("--") + 1 :]
bpy.context.view_layer.objects.active = bpy.data.objects[mesh_name]
if bpy.context.mode != "OBJECT":
    bpy.ops.object.mode_set(mode="OBJECT")

bpy.ops.nicmm.design_curve(points=indices, closed=True)
curve_object = bpy.context.active_object
print(f"{curve_object.name}: {len(curve_object.data.splines[0].points)} points")
bpy.ops.wm.save_as_mainfile(filepath=output)
