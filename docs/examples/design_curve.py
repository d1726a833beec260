# SPDX-License-Identifier: GPL-3.0-or-later
"""Draw a closed curve through vertices of a mesh, in the order given, without a window.

    blender -b head.blend --python-exit-code 1 --python design_curve.py -- \
        Suzanne 73,365,74,366 out.blend
"""

import sys

import bpy

import bmesh

mesh_name, indices, output = sys.argv[sys.argv.index("--") + 1 :]
mesh_object = bpy.data.objects[mesh_name]
bpy.context.view_layer.objects.active = mesh_object
if bpy.context.mode != "OBJECT":
    bpy.ops.object.mode_set(mode="OBJECT")

# Select the vertices one by one: the operator visits them in the order of Blender's history.
edited = bmesh.new()
edited.from_mesh(mesh_object.data)
edited.verts.ensure_lookup_table()
for element in (*edited.verts, *edited.edges, *edited.faces):
    element.select_set(False)
edited.select_history.clear()
for index in map(int, indices.split(",")):
    edited.verts[index].select_set(True)
    edited.select_history.add(edited.verts[index])
edited.to_mesh(mesh_object.data)
edited.free()

bpy.ops.nicmm.design_curve(closed=True)
curve_object = bpy.context.active_object
print(f"{curve_object.name}: {len(curve_object.data.splines[0].points)} points")
bpy.ops.wm.save_as_mainfile(filepath=output)
