# SPDX-License-Identifier: GPL-3.0-or-later
"""The Geometry Nodes group that keeps points on their surface and can turn strands into tubes.

As long as the surface has the same number of vertices as when the curve was drawn, each point stays
at the same position in the same triangle. Otherwise, for example at another subdivision level, its
position is estimated from three vertices of the cage, which most modifiers keep at the start of the
vertex list, and then moved to the nearest point of the surface.

A file keeps the group that it was saved with.
"""

from __future__ import annotations

import bpy

GROUP_NAME = "NICMM Surface Curve"

CORNERS = ("vertex_1", "vertex_2", "vertex_3")
"""Attributes of a point: the three vertices of its triangle."""

CAGE_CORNERS = ("cage_1", "cage_2", "cage_3")
"""Attributes of a point: three vertices of its face of the cage; -1 if unknown."""

BARYCENTRIC, CAGE_OFFSET = "barycentric", "cage_offset"
"""Attributes of a point: its barycentric coordinates, and its offset from the three cage vertices.

The offset is given along two sides and along the normal, as `sticky_curves.on_cage` computes it.
"""

VERTICES, OFFSET = "surface_vertices", "offset"
"""Attributes of a point: the surface's number of vertices, and the point's distance from it."""

SURFACE, TUBE = "Surface", "Tube"
"""Inputs of the group: the mesh object, and whether to make a tube."""

SIDES = 12
"""Number of sides of the tube, the same as for Blender's default bevel of curves."""


def add_modifier(
    curves_object: bpy.types.Object, mesh_object: bpy.types.Object, tube: bool
) -> None:
    """Add the modifier that makes a hair curves object follow a mesh object."""
    modifier = curves_object.modifiers.new(GROUP_NAME, "NODES")
    modifier.node_group = node_group()
    _set_input(modifier, SURFACE, mesh_object)
    _set_input(modifier, TUBE, tube)


def node_group() -> bpy.types.NodeTree:
    """The node group of the file, created if it is missing or incomplete."""
    group = bpy.data.node_groups.get((GROUP_NAME, None))  # None: no group linked from a library
    return group if group is not None and _is_complete(group) else _new_group()


def _new_group() -> bpy.types.NodeTree:
    group = bpy.data.node_groups.new(GROUP_NAME, "GeometryNodeTree")
    group.is_modifier = True
    group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    group.interface.new_socket(SURFACE, in_out="INPUT", socket_type="NodeSocketObject")
    socket = group.interface.new_socket(TUBE, in_out="INPUT", socket_type="NodeSocketBool")
    socket.description = "Show the strands as a tube mesh with their radius"
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    column = _Column(group)
    inputs = column.node("NodeGroupInput", 0)
    info = column.node("GeometryNodeObjectInfo", 1)
    info.transform_space = "RELATIVE"
    column.link(_output(inputs, SURFACE), info.inputs["Object"])
    surface = _output(info, "Geometry")
    place, normal = _in_triangle(column, surface)
    place = column.choose(_is_unchanged(column, surface), _nearest(column, surface), place)
    lifted = column.vectors("NORMALIZE", normal)
    lifted = column.scaled(lifted, column.attribute(OFFSET, "FLOAT"))
    target = column.node("GeometryNodeSetPosition", 7)
    # Hair curves are Catmull-Rom splines, and only a node changes their type reliably.
    straight = column.node("GeometryNodeCurveSplineType", 6)
    straight.spline_type = "POLY"
    column.link(_output(inputs, "Geometry"), straight.inputs["Curve"])
    column.link(_output(straight, "Curve"), target.inputs["Geometry"])
    column.link(place, target.inputs["Position"])
    column.link(lifted, target.inputs["Offset"])
    outputs = column.node("NodeGroupOutput", 11)
    column.link(_with_tube(column, _output(target, "Geometry"), inputs), outputs.inputs[0])
    return group


def _in_triangle(column: _Column, surface: bpy.types.NodeSocket) -> list[bpy.types.NodeSocket]:
    """The position and normal of each point in its triangle."""
    position = column.node("GeometryNodeInputPosition", 1)
    normal = column.node("GeometryNodeInputNormal", 1)
    corners = [column.attribute(name, "INT") for name in CORNERS]
    weights = column.node("ShaderNodeSeparateXYZ", 2)
    column.link(column.attribute(BARYCENTRIC, "FLOAT_VECTOR"), weights.inputs[0])
    found = []
    for field in (_output(position, "Position"), _output(normal, "Normal")):
        first, second, last = (column.sample(surface, field, corner) for corner in corners)
        # Relative to the last corner, because rounded weights may not sum to exactly 1.
        value = last
        for corner, weight in zip((first, second), weights.outputs, strict=False):
            value = column.added(value, column.vectors("SUBTRACT", corner, last), weight)
        found.append(value)
    return found


def _is_unchanged(column: _Column, surface: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
    """Whether the surface has the same number of vertices as when the curve was drawn."""
    size = column.node("GeometryNodeAttributeDomainSize", 2)
    column.link(surface, size.inputs["Geometry"])
    same = column.node("FunctionNodeCompare", 3)
    same.data_type, same.operation = "INT", "EQUAL"
    column.link(size.outputs["Point Count"], _input(same, "A"))
    column.link(column.attribute(VERTICES, "INT"), _input(same, "B"))
    return same.outputs["Result"]


def _nearest(column: _Column, surface: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
    """The point of the surface nearest to the position estimated from the cage."""
    position = _output(column.node("GeometryNodeInputPosition", 1), "Position")
    corners = [column.attribute(name, "INT") for name in CAGE_CORNERS]
    first, second, last = (column.sample(surface, position, corner) for corner in corners)
    along = column.vectors("SUBTRACT", second, first)
    across = column.vectors("SUBTRACT", last, first)
    normal = column.vectors("NORMALIZE", column.vectors("CROSS_PRODUCT", along, across))
    length = column.node("ShaderNodeVectorMath", 4)
    length.operation = "LENGTH"
    column.link(along, length.inputs[0])
    normal = column.scaled(normal, length.outputs["Value"])
    amounts = column.node("ShaderNodeSeparateXYZ", 2)
    column.link(column.attribute(CAGE_OFFSET, "FLOAT_VECTOR"), amounts.inputs[0])
    estimate = first
    for axis, amount in zip((along, across, normal), amounts.outputs, strict=True):
        estimate = column.added(estimate, axis, amount)
    known = column.node("FunctionNodeCompare", 3)
    known.data_type, known.operation = "INT", "GREATER_EQUAL"
    column.link(corners[0], _input(known, "A"))
    estimate = column.choose(known.outputs["Result"], position, estimate)
    nearest = column.node("GeometryNodeProximity", 6)
    nearest.target_element = "FACES"
    column.link(surface, nearest.inputs[0])
    column.link(estimate, nearest.inputs["Sample Position"])
    return nearest.outputs["Position"]


def _with_tube(
    column: _Column, curves: bpy.types.NodeSocket, inputs: bpy.types.Node
) -> bpy.types.NodeSocket:
    """The curves, or the tube if that is chosen."""
    radius = _output(column.node("GeometryNodeInputRadius", 8), "Radius")
    widest = column.node("GeometryNodeAttributeStatistic", 8)
    widest.data_type, widest.domain = "FLOAT", "POINT"
    column.link(curves, widest.inputs["Geometry"])
    column.link(radius, _input(widest, "Attribute"))
    circle = column.node("GeometryNodeCurvePrimitiveCircle", 8)
    circle.inputs["Resolution"].default_value = SIDES
    # If all radii are zero, no profile is used, and the mesh consists of edges only.
    profile = column.switch(8, _output(widest, "Max"), None, _output(circle, "Curve"))
    mesh = column.node("GeometryNodeCurveToMesh", 9)
    mesh.inputs["Fill Caps"].default_value = True
    column.link(curves, mesh.inputs["Curve"])
    column.link(profile, mesh.inputs["Profile Curve"])
    if "Scale" in mesh.inputs:  # Blender 4.3 always scales the profile by the radius of the curve
        column.link(radius, mesh.inputs["Scale"])
    return column.switch(10, _output(inputs, TUBE), curves, _output(mesh, "Mesh"))


def _is_complete(group: bpy.types.NodeTree) -> bool:
    """Whether a group has the parts that the modifier needs."""
    return (
        group.bl_idname == "GeometryNodeTree"
        and {SURFACE, TUBE} <= _input_identifiers(group).keys()
        and _output_source(group) is not None
    )


def _output_source(group: bpy.types.NodeTree) -> bpy.types.NodeSocket | None:
    """The socket linked to the output of a group, or None."""
    outputs = _group_output(group)
    links = () if outputs is None else outputs.inputs[0].links
    return links[0].from_socket if links else None


def _group_output(group: bpy.types.NodeTree) -> bpy.types.Node | None:
    found = [node for node in group.nodes if node.bl_idname == "NodeGroupOutput"]
    return next((node for node in found if node.is_active_output), None)


class _Column:
    """Adds nodes and links to a group, and places the nodes in columns from left to right."""

    def __init__(self, group: bpy.types.NodeTree) -> None:
        self.group = group
        self.heights: dict[int, int] = {}

    def node(self, kind: str, column: int) -> bpy.types.Node:
        node = self.group.nodes.new(kind)
        self.heights[column] = self.heights.get(column, 0) + 1
        node.location = (self.x(column), -220 * self.heights[column])
        return node

    @staticmethod
    def x(column: int) -> float:
        return 220.0 * column

    def link(self, source: bpy.types.NodeSocket, target: bpy.types.NodeSocket) -> None:
        self.group.links.new(source, target)

    def attribute(self, name: str, data_type: str) -> bpy.types.NodeSocket:
        node = self.node("GeometryNodeInputNamedAttribute", 1)
        node.data_type = data_type
        node.inputs["Name"].default_value = name
        return _output(node, "Attribute")

    def sample(
        self,
        geometry: bpy.types.NodeSocket,
        field: bpy.types.NodeSocket,
        index: bpy.types.NodeSocket,
    ) -> bpy.types.NodeSocket:
        """The value of a vector field at one vertex of a geometry."""
        node = self.node("GeometryNodeSampleIndex", 2)
        node.data_type, node.domain = "FLOAT_VECTOR", "POINT"
        self.link(geometry, _input(node, "Geometry"))
        self.link(field, _input(node, "Value"))
        self.link(index, _input(node, "Index"))
        return _output(node, "Value")

    def switch(
        self,
        column: int,
        condition: bpy.types.NodeSocket,
        if_false: bpy.types.NodeSocket | None,
        if_true: bpy.types.NodeSocket | None,
        kind: str = "GEOMETRY",
    ) -> bpy.types.NodeSocket:
        """Switch between two values; None leaves an input empty."""
        node = self.node("GeometryNodeSwitch", column)
        node.input_type = kind
        for name, source in (("Switch", condition), ("False", if_false), ("True", if_true)):
            if source is not None:
                self.link(source, _input(node, name))
        return _output(node, "Output")

    def choose(
        self,
        condition: bpy.types.NodeSocket,
        if_false: bpy.types.NodeSocket,
        if_true: bpy.types.NodeSocket,
    ) -> bpy.types.NodeSocket:
        """Switch between two vectors."""
        return self.switch(5, condition, if_false, if_true, "VECTOR")

    def vectors(self, operation: str, *operands: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        """The result of a vector operation."""
        node = self.node("ShaderNodeVectorMath", 3)
        node.operation = operation
        for operand, socket in zip(operands, node.inputs, strict=False):
            self.link(operand, socket)
        return node.outputs[0]

    def scaled(
        self, vector: bpy.types.NodeSocket, factor: bpy.types.NodeSocket
    ) -> bpy.types.NodeSocket:
        """A vector times a factor."""
        node = self.node("ShaderNodeVectorMath", 4)
        node.operation = "SCALE"
        self.link(vector, node.inputs[0])
        self.link(factor, node.inputs["Scale"])
        return node.outputs[0]

    def added(
        self,
        vector: bpy.types.NodeSocket,
        other: bpy.types.NodeSocket,
        factor: bpy.types.NodeSocket,
    ) -> bpy.types.NodeSocket:
        """A vector plus a multiple of another vector."""
        return self.vectors("ADD", vector, self.scaled(other, factor))


def _output(node: bpy.types.Node, name: str) -> bpy.types.NodeSocket:
    """The enabled output with a name; before Blender 5 a node has one for each data type."""
    return next(socket for socket in node.outputs if socket.name == name and socket.enabled)


def _input(node: bpy.types.Node, name: str) -> bpy.types.NodeSocket:
    """The enabled input with a name."""
    return next(socket for socket in node.inputs if socket.name == name and socket.enabled)


def _input_identifiers(group: bpy.types.NodeTree) -> dict[str, str]:
    """The identifiers of the inputs of a group, by their names."""
    sockets = [item for item in group.interface.items_tree if item.item_type == "SOCKET"]
    return {item.name: item.identifier for item in sockets if item.in_out == "INPUT"}


def _set_input(modifier: bpy.types.Modifier, name: str, value: bpy.types.Object | bool) -> None:
    identifier = _input_identifiers(modifier.node_group)[name]
    if hasattr(modifier, "properties"):  # since Blender 5.2
        getattr(modifier.properties.inputs, identifier).value = value
    else:
        modifier[identifier] = value
