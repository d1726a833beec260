# SPDX-License-Identifier: GPL-3.0-or-later
"""The command `blender -c nicmm`: designs a curve on an object of a file and writes another file.

Its options are the properties of *Design Curve on Surface*, read from their Blender definitions.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import bpy

from . import settings
from .scene.lookup import is_in
from .scene.messages import InputError

COMMAND = "nicmm"
FAILED = 2

_registered: list[object] = []


def main(arguments: list[str]) -> int:
    """Run the command; return 0, or 2 after a message on standard error if it failed."""
    try:
        options = parser().parse_args(arguments)
    except SystemExit as stopped:  # argparse has printed the reason; Blender expects a number
        return 0 if not stopped.code else FAILED
    try:
        run(options)
    except (InputError, RuntimeError, ValueError, OSError) as error:
        print(f"{COMMAND}: {str(error).removeprefix('Error: ').strip()}", file=sys.stderr)
        return FAILED
    return 0


def run(options: argparse.Namespace) -> None:
    """Open the file, design the curve and write the other file."""
    source, target = Path(options.file).absolute(), Path(options.output_file).absolute()
    if not source.is_file():
        raise InputError(f"--file: there is no file {source}")
    if not target.parent.is_dir():
        raise InputError(f"--output-file: there is no folder {target.parent}")
    if target.exists() and target.samefile(source):
        raise InputError("--output-file is the same file as --file. Choose another file")
    bpy.ops.wm.open_mainfile(filepath=str(source), load_ui=False)
    activate(options.object)
    chosen = {name: getattr(options, name) for name in settings.PROPERTY_NAMES}
    bpy.ops.nicmm.design_curve(
        **{name: value for name, value in chosen.items() if value is not None},
        **_points(options),
    )
    bpy.ops.wm.save_as_mainfile(filepath=str(target), copy=True, check_existing=False)


def activate(name: str | None) -> None:
    """Make the named object, or the file's active object, active in Object Mode."""
    context = bpy.context
    if name is not None:
        chosen = bpy.data.objects.get(name)
        if chosen is None:
            meshes = [found.name for found in bpy.data.objects if found.type == "MESH"]
            raise InputError(
                f'--object: there is no object "{name}" in the file. Its meshes are '
                + ", ".join(f'"{mesh}"' for mesh in meshes)
            )
        if not is_in(context.view_layer, chosen):
            raise InputError(
                f'--object: "{name}" is not in the active view layer of the file, '
                f'"{context.view_layer.name}"'
            )
        if context.mode != "OBJECT":
            bpy.ops.object.mode_set(mode="OBJECT")
        context.view_layer.objects.active = chosen
    if context.active_object is None:
        raise InputError("no object is active in the file; name one with --object")
    if context.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")


def _points(options: argparse.Namespace) -> dict[str, str]:
    """The control points, and which of them are corners, as arguments of the operator."""
    for name in ("group", "points"):
        if getattr(options, name) == "":
            raise InputError(
                f"--{name} is empty. Leave it out for the vertices selected in the file"
            )
    given = {
        "point_group": options.group,
        "points": options.points,
        "corners": options.corners,
    }
    return {name: value for name, value in given.items() if value is not None}


def parser() -> argparse.ArgumentParser:
    """The argument parser of the command."""
    command_parser = argparse.ArgumentParser(
        prog=f"blender -c {COMMAND}",
        description="Draw a smooth curve on a mesh of a Blender file and write another file.",
    )
    command_parser.add_argument("--file", required=True, metavar="IN.blend")
    command_parser.add_argument("--output-file", required=True, metavar="OUT.blend")
    command_parser.add_argument(
        "--object", metavar="NAME", help="default: the active object of the file"
    )
    control_points = command_parser.add_argument_group(
        "control points", "By default, the vertices that are selected in the file."
    )
    points = control_points.add_mutually_exclusive_group()
    points.add_argument("--group", metavar="NAME", help="the vertices of a vertex group")
    points.add_argument(
        "--points",
        metavar="A,B,C",
        help='vertex indices from 0, or positions in local space: "0.5 0 1, 0 0 2, 41"',
    )
    control_points.add_argument(
        "--corners",
        metavar="I,J",
        help="control points at which the curve may turn freely, by their indices among the "
        "points, from 0",
    )
    described = bpy.ops.nicmm.design_curve.get_rna_type().properties
    options = command_parser.add_argument_group("settings", "The same as in the sidebar.")
    for name in settings.PROPERTY_NAMES:
        options.add_argument(f"--{name.replace('_', '-')}", dest=name, **_option(described[name]))
    return command_parser


def _option(described: bpy.types.Property) -> dict[str, Any]:
    """The argparse keywords for a Blender property."""
    # argparse expands % in help texts.
    words = {"help": described.description.replace("%", "%%"), "default": None}
    if described.type == "BOOLEAN":
        return {"action": argparse.BooleanOptionalAction, **words}
    if described.type == "ENUM":
        identifiers = [item.identifier for item in described.enum_items]
        return {"type": str.upper, "choices": identifiers, **words}
    return {"type": {"FLOAT": float, "INT": int, "STRING": str}[described.type], **words}


def register() -> None:
    _registered.append(bpy.utils.register_cli_command(COMMAND, main))


def unregister() -> None:
    bpy.utils.unregister_cli_command(_registered.pop())
