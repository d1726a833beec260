# SPDX-License-Identifier: GPL-3.0-or-later
"""The Geometry Nodes group that keeps points on their triangles, and can give the strands a tube.

A file keeps the group that it was saved with. A group without a tube is extended when it is used
again.
"""

import bpy

GROUP_NAME = "NICMM Sticky Curve"
CORNERS = ("vertex_1", "vertex_2", "vertex_3")
"""Attributes of a point: the vertices of its triangle."""

SURFACE, TUBE = "Surface", "Tube"
"""Inputs of the group: the mesh object, and whether to make a tube."""
SIDES = 12
"""Sides of the tube: as many as Blender's default bevel of curves."""


def add_modifier(curves_object, mesh_object, tube: bool) -> None:
    """Add the modifier with which a hair curves object follows a mesh object."""
    modifier = curves_object.modifiers.new(GROUP_NAME, "NODES")
    modifier.node_group = node_group()
    _set_input(modifier, SURFACE, mesh_object)
    _set_input(modifier, TUBE, tube)


def node_group():
    """The group of the file, created if it is missing or incomplete."""
    group = bpy.data.node_groups.get((GROUP_NAME, None))  # not one that is linked
    if group is None or not _is_whole(group):
        group = _new_group()
    if _interface_input(group, TUBE) is None:
        _add_tube(group)
    return group


def _new_group():
    """The group without the tube."""
    group = bpy.data.node_groups.new(GROUP_NAME, "GeometryNodeTree")
    group.is_modifier = True
    group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    group.interface.new_socket(SURFACE, in_out="INPUT", socket_type="NodeSocketObject")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    column = _Column(group)
    inputs = column.node("NodeGroupInput", 0)
    surface = column.node("GeometryNodeObjectInfo", 1)
    surface.transform_space = "RELATIVE"
    column.link(_output(inputs, SURFACE), surface.inputs["Object"])
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
    # Relative to the last corner, so that rounding in the sum of the weights has no effect.
    place = corners[2]
    for corner, weight in zip(corners[:2], weights.outputs, strict=False):
        place = column.moved_towards(place, corner, corners[2], weight)
    target = column.node("GeometryNodeSetPosition", 5)
    # Hair curves are Catmull-Rom splines; only nodes change the type reliably.
    straight = column.node("GeometryNodeCurveSplineType", 4)
    straight.spline_type = "POLY"
    column.link(_output(inputs, "Geometry"), straight.inputs["Curve"])
    column.link(_output(straight, "Curve"), target.inputs["Geometry"])
    column.link(place, target.inputs["Position"])
    outputs = column.node("NodeGroupOutput", 6)
    column.link(_output(target, "Geometry"), outputs.inputs[0])
    return group


def _add_tube(group) -> None:
    """Insert a tube, and the switch for it, before the output of a group."""
    socket = group.interface.new_socket(TUBE, in_out="INPUT", socket_type="NodeSocketBool")
    socket.description = "Show the strands as a mesh with their radius"
    curves = _made(group)
    column = _Column(group)
    radius = _output(column.node("GeometryNodeInputRadius", 6), "Radius")
    widest = column.node("GeometryNodeAttributeStatistic", 6)
    widest.data_type, widest.domain = "FLOAT", "POINT"
    column.link(curves, widest.inputs["Geometry"])
    column.link(radius, _input(widest, "Attribute"))
    circle = column.node("GeometryNodeCurvePrimitiveCircle", 6)
    circle.inputs["Resolution"].default_value = SIDES
    # Strands without a radius are lines; without a profile, the tube consists of edges only.
    profile = column.switch(7, _output(widest, "Max"), None, _output(circle, "Curve"))
    mesh = column.node("GeometryNodeCurveToMesh", 8)
    mesh.inputs["Fill Caps"].default_value = True
    column.link(curves, mesh.inputs["Curve"])
    column.link(profile, mesh.inputs["Profile Curve"])
    if "Scale" in mesh.inputs:  # Blender 4.3 always scales the profile by the radius of the curve
        column.link(radius, mesh.inputs["Scale"])
    inputs = column.node("NodeGroupInput", 8)
    chosen = column.switch(9, _output(inputs, TUBE), curves, _output(mesh, "Mesh"))
    outputs = _group_output(group)
    outputs.location.x = column.x(10)
    column.link(chosen, outputs.inputs[0])


def _is_whole(group) -> bool:
    """Whether a group with this name has the parts that the modifier needs."""
    return (
        group.bl_idname == "GeometryNodeTree"
        and _interface_input(group, SURFACE) is not None
        and _made(group) is not None
    )


def _made(group):
    """The socket linked to the output of a group, or None."""
    outputs = _group_output(group)
    links = () if outputs is None else outputs.inputs[0].links
    return links[0].from_socket if links else None


def _group_output(group):
    found = [node for node in group.nodes if node.bl_idname == "NodeGroupOutput"]
    return next((node for node in found if node.is_active_output), None)


class _Column:
    """Adds nodes in columns from left to right."""

    def __init__(self, group) -> None:
        self.group = group
        self.heights: dict = {}

    def node(self, kind: str, column: int):
        node = self.group.nodes.new(kind)
        self.heights[column] = self.heights.get(column, 0) + 1
        node.location = (self.x(column), -220 * self.heights[column])
        return node

    @staticmethod
    def x(column: int) -> float:
        return 220.0 * column

    def link(self, source, target) -> None:
        self.group.links.new(source, target)

    def named_attribute(self, name: str, data_type: str):
        node = self.node("GeometryNodeInputNamedAttribute", 1)
        node.data_type = data_type
        node.inputs["Name"].default_value = name
        return _output(node, "Attribute")

    def switch(self, column: int, condition, if_false, if_true):
        """Switch between two geometries, of which either may be None (empty)."""
        node = self.node("GeometryNodeSwitch", column)
        node.input_type = "GEOMETRY"
        for name, source in (("Switch", condition), ("False", if_false), ("True", if_true)):
            if source is not None:
                self.link(source, _input(node, name))
        return _output(node, "Output")

    def moved_towards(self, place, corner, base, weight):
        """Add weight · (corner - base) to a position."""
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
    """The enabled socket; before Blender 5 a node has one of each name for every data type."""
    return next(socket for socket in node.outputs if socket.name == name and socket.enabled)


def _input(node, name: str):
    return next(socket for socket in node.inputs if socket.name == name and socket.enabled)


def _interface_input(group, name: str):
    """An input of a group by its name, or None."""
    sockets = [item for item in group.interface.items_tree if item.item_type == "SOCKET"]
    return next((item for item in sockets if item.name == name and item.in_out == "INPUT"), None)


def _set_input(modifier, name: str, value) -> None:
    identifier = _interface_input(modifier.node_group, name).identifier
    if hasattr(modifier, "properties"):  # since Blender 5.2
        getattr(modifier.properties.inputs, identifier).value = value
    else:
        modifier[identifier] = value
