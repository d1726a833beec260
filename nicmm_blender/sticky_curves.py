# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes a curve as a hair curves object that follows its mesh through every deformation.

Each point has the polygon that it lies on, the three vertices of its triangle and its barycentric
coordinates as attributes; a Geometry Nodes group reads the vertices' places after all modifiers.
"""

import bpy
import numpy as np

GROUP_NAME = "NICMM Sticky Curve"
CORNERS = ("vertex_1", "vertex_2", "vertex_3")


def add(mesh_object, surface, curves, radius: float):
    """Make the object, not yet in any collection."""
    name = f"{mesh_object.name} Curve"
    data = bpy.data.hair_curves.new(name)
    write(data, surface, curves, radius)
    curves_object = bpy.data.objects.new(name, data)
    modifier = curves_object.modifiers.new(GROUP_NAME, "NODES")
    modifier.node_group = node_group()
    _set_input(modifier, "Surface", mesh_object)
    return curves_object


def write(data, surface, curves, radius: float | None = None) -> None:
    """Replace the curves of a hair curves data-block; without a radius they keep that of before."""
    if radius is None:
        before = data.attributes.get("radius")
        radius = before.data[0].value if before is not None and len(before.data) else 0.0
    if len(data.curves):
        data.remove_curves()
    data.add_curves([len(curve.faces) for curve in curves])
    faces = np.concatenate([curve.faces for curve in curves])
    barycentric = np.concatenate([curve.barycentric for curve in curves])
    points = surface.points(faces, barycentric)
    data.points.foreach_set("position", points.astype(np.float32).ravel())
    _set(data, "radius", "FLOAT", "POINT", np.full(len(faces), radius))
    _set(data, "cyclic", "BOOLEAN", "CURVE", np.array([curve.closed for curve in curves]))
    _set(data, "face", "INT", "POINT", surface.polygons[faces])
    for corner, attribute in enumerate(CORNERS):
        _set(data, attribute, "INT", "POINT", surface.faces[faces, corner])
    _set(data, "barycentric", "FLOAT_VECTOR", "POINT", barycentric)


def node_group():
    """The group that keeps points on their triangles; made once a file."""
    found = bpy.data.node_groups.get(GROUP_NAME)
    if found is not None and found.bl_idname == "GeometryNodeTree":
        return found
    group = bpy.data.node_groups.new(GROUP_NAME, "GeometryNodeTree")
    group.is_modifier = True
    group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    group.interface.new_socket("Surface", in_out="INPUT", socket_type="NodeSocketObject")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    column = _Column(group)
    inputs = column.node("NodeGroupInput", 0)
    surface = column.node("GeometryNodeObjectInfo", 1)
    surface.transform_space = "RELATIVE"
    column.link(_output(inputs, "Surface"), surface.inputs["Object"])
    position = column.node("GeometryNodeInputPosition", 1)
    corners = []
    for attribute in CORNERS:
        index = column.named_attribute(attribute, "INT")
        sample = column.node("GeometryNodeSampleIndex", 2)
        sample.data_type, sample.domain = "FLOAT_VECTOR", "POINT"
        column.link(_output(surface, "Geometry"), _input(sample, "Geometry"))
        column.link(_output(position, "Position"), _input(sample, "Value"))
        column.link(index, _input(sample, "Index"))
        corners.append(_output(sample, "Value"))
    weights = column.node("ShaderNodeSeparateXYZ", 2)
    column.link(column.named_attribute("barycentric", "FLOAT_VECTOR"), weights.inputs[0])
    # From the last corner on, so that rounding of the weights' sum moves nothing.
    place = corners[2]
    for corner, weight in zip(corners[:2], weights.outputs, strict=False):
        place = column.moved_towards(place, corner, corners[2], weight)
    target = column.node("GeometryNodeSetPosition", 5)
    # Hair curves are Catmull-Rom splines, and Blender lets only nodes change that safely.
    straight = column.node("GeometryNodeCurveSplineType", 4)
    straight.spline_type = "POLY"
    column.link(_output(inputs, "Geometry"), straight.inputs["Curve"])
    column.link(_output(straight, "Curve"), target.inputs["Geometry"])
    column.link(place, target.inputs["Position"])
    outputs = column.node("NodeGroupOutput", 6)
    column.link(_output(target, "Geometry"), outputs.inputs[0])
    return group


class _Column:
    """Adds nodes in columns from left to right."""

    def __init__(self, group) -> None:
        self.group = group
        self.heights: dict = {}

    def node(self, kind: str, column: int):
        node = self.group.nodes.new(kind)
        self.heights[column] = self.heights.get(column, 0) + 1
        node.location = (220 * column, -220 * self.heights[column])
        return node

    def link(self, source, target) -> None:
        self.group.links.new(source, target)

    def named_attribute(self, name: str, data_type: str):
        node = self.node("GeometryNodeInputNamedAttribute", 1)
        node.data_type = data_type
        node.inputs["Name"].default_value = name
        return _output(node, "Attribute")

    def moved_towards(self, place, corner, base, weight):
        """Place + weight · (corner - base)."""
        step = self._vector("SUBTRACT", 3, corner, base)
        scaled = self.node("ShaderNodeVectorMath", 4)
        scaled.operation = "SCALE"
        self.link(step, scaled.inputs[0])
        self.link(weight, scaled.inputs["Scale"])
        return self._vector("ADD", 4, place, scaled.outputs[0])

    def _vector(self, operation: str, column: int, one, other):
        node = self.node("ShaderNodeVectorMath", column)
        node.operation = operation
        self.link(one, node.inputs[0])
        self.link(other, node.inputs[1])
        return node.outputs[0]


def _output(node, name: str):
    """The socket in use; before Blender 5 a node has one of each name for every data type."""
    return next(socket for socket in node.outputs if socket.name == name and socket.enabled)


def _input(node, name: str):
    return next(socket for socket in node.inputs if socket.name == name and socket.enabled)


def _set_input(modifier, name: str, value) -> None:
    tree = modifier.node_group.interface.items_tree
    identifier = next(
        item.identifier for item in tree if item.name == name and item.in_out == "INPUT"
    )
    if hasattr(modifier, "properties"):  # since Blender 5.2
        getattr(modifier.properties.inputs, identifier).value = value
    else:
        modifier[identifier] = value


def _set(data, name: str, data_type: str, domain: str, values: np.ndarray) -> None:
    attribute = data.attributes.get(name) or data.attributes.new(name, data_type, domain)
    kinds = {"INT": np.int32, "BOOLEAN": bool}
    values = np.ascontiguousarray(values, dtype=kinds.get(data_type, np.float32))
    attribute.data.foreach_set("vector" if data_type == "FLOAT_VECTOR" else "value", values.ravel())
