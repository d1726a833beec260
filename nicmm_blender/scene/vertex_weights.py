# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads the weights of a vertex group as an array.

Blender's Python interface gives weights only one vertex at a time. Geometry Nodes, however, see a
vertex group as an attribute, so a temporary node group copies it to an attribute that can be read
in one call.
"""

import bpy
import numpy as np

from .isolation import evaluated_in_isolation

STORED = "nicmm_weights"


def weights_on(mesh: bpy.types.Mesh, groups: list[str], group: str) -> np.ndarray:
    """Weights (V,) of all vertices of a mesh in a vertex group; 0 outside the group.

    `mesh` may be the evaluated mesh of an object. It is not changed. `groups` are the names of all
    vertex groups of the object.
    """
    nodes = _new_node_group(group)
    try:
        temporary = bpy.data.objects.new("NICMM weights", mesh.copy())
        add_missing_groups(temporary, groups)
        temporary.modifiers.new("NICMM weights", "NODES").node_group = nodes
        with evaluated_in_isolation(temporary) as stored:
            weights = np.zeros(len(stored.vertices), dtype=np.float32)
            stored.attributes[STORED].data.foreach_get("value", weights)
    finally:
        bpy.data.node_groups.remove(nodes)
    return weights.astype(np.float64)


def add_missing_groups(copy: bpy.types.Object, groups: list[str]) -> None:
    """Name all vertex groups of a copy; that of an edited mesh has weights without names."""
    for name in groups[len(copy.vertex_groups) :]:
        copy.vertex_groups.new(name=name)


def _new_node_group(group: str) -> bpy.types.NodeTree:
    """A new node group that stores a vertex group as an attribute."""
    tree = bpy.data.node_groups.new("NICMM weights", "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
    read = tree.nodes.new("GeometryNodeInputNamedAttribute")
    store = tree.nodes.new("GeometryNodeStoreNamedAttribute")
    read.data_type = store.data_type = "FLOAT"
    store.domain = "POINT"
    read.inputs["Name"].default_value = group
    store.inputs["Name"].default_value = STORED
    first, last = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    for start, end in (
        (first.outputs[0], store.inputs["Geometry"]),
        (read.outputs["Attribute"], store.inputs["Value"]),
        (store.outputs["Geometry"], last.inputs[0]),
    ):
        tree.links.new(start, end)
    return tree
