"""Makes the file of a version with every kind of curve, record, map and output.

    BLENDER_USER_RESOURCES=FOLDER python tests/blender/kept/make.py FILE.blend

FOLDER contains the extension of that version. The files of released versions are never made again:
`test_kept_files.py` opens, edits and updates them.
"""

import sys

import bpy
import numpy as np

import addon_utils

EXTENSION = "bl_ext.user_default.nicmm_curves"
SUBDIVISIONS = 3


def ball(name):
    bpy.ops.object.select_all(action="DESELECT")
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=SUBDIVISIONS)
    made = bpy.context.active_object
    made.name = made.data.name = name
    return made


def nearest(mesh_object, places):
    vertices = np.array([vertex.co for vertex in mesh_object.data.vertices])
    return [int(np.linalg.norm(vertices - place, axis=1).argmin()) for place in places]


def ring(mesh_object, count=4, height=0.2):
    angles = 2 * np.pi * np.arange(count) / count
    return nearest(mesh_object, [(np.cos(a), np.sin(a), height) for a in angles])


def paint(mesh_object, name, place, radius, weight):
    group = mesh_object.vertex_groups.new(name=name)
    for vertex in mesh_object.data.vertices:
        if (vertex.co - type(vertex.co)(place)).length < radius:
            group.add([vertex.index], weight, "REPLACE")


def draw(mesh_object, name, vertices, **settings):
    bpy.ops.object.select_all(action="DESELECT")
    bpy.context.view_layer.objects.active = mesh_object
    points = ", ".join(map(str, vertices))
    settings = {"spline": "EXACT", **settings}
    assert bpy.ops.nicmm.design_curve(points=points, **settings) == {"FINISHED"}
    made = bpy.context.active_object
    if made != mesh_object:
        made.name = name
    return made


def make(path):
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    addon_utils.extensions_refresh()
    assert addon_utils.enable(EXTENSION, default_set=True) is not None
    body = ball("Body")
    paint(body, "Wall", (0.7, 0.7, 0.2), 0.25, 1.0)
    paint(body, "Lane", (-0.7, 0.7, 0.3), 0.3, 0.8)
    around = ring(body)
    draw(body, "Closed", around)
    draw(body, "Open", around, closed=False, smoothness=2.0)
    draw(body, "Maps", around, obstacle_group="Wall", clearance=0.05, alignment_group="Lane")
    draw(body, "Variational", around, method="VARIATIONAL", thickness=0.0)
    draw(body, "Sticky", around, output="STICKY", thickness=0.01)
    draw(body, "Tube", around, output="STICKY", tube=True, closed=False)
    # Points inside faces, as mouse clicks create them.
    bpy.ops.object.select_all(action="DESELECT")
    bpy.context.view_layer.objects.active = body
    places = [(0.9, 0.1, 0.4), (0.1, 0.9, -0.4), (-0.9, 0.1, 0.4), (-0.1, -0.9, -0.4)]
    places = [tuple(body.closest_point_on_mesh(place)[1]) for place in places]
    points = [{"name": "", "position": place} for place in places]
    assert bpy.ops.nicmm.edit_curve(points=points, spline="EXACT") == {"FINISHED"}
    bpy.context.active_object.name = "Placed"
    # Outputs that change their mesh, each on a separate mesh.
    for number, (name, settings) in enumerate(
        {
            "Edges": {"output": "EDGES", "mark_seam": True, "mark_sharp": True},
            "Group": {"output": "REGION", "region_as": "VERTEX_GROUP"},
            "Face Set": {"output": "REGION", "region_as": "FACE_SET", "region_cut": True},
            "Loose": {"output": "PARTS", "parts_as": "LOOSE"},
            "Objects": {"output": "PARTS", "parts_as": "OBJECTS"},
        }.items()
    ):
        changed = ball(name)
        changed.location.x = 3.0 * (number + 1)
        draw(changed, name, ring(changed), **settings)
    panel = bpy.context.scene.nicmm_curves
    panel.smoothness, panel.obstacle_group, panel.alignment_group = 3.0, "Wall", "Lane"
    bpy.ops.wm.save_as_mainfile(filepath=path, compress=True)
    addon_utils.disable(EXTENSION, default_set=True)


if __name__ == "__main__":
    make(sys.argv[1])
