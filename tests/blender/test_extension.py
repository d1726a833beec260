"""Installing, enabling and disabling the extension."""

import os
import subprocess
import sys
from dataclasses import asdict
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

import addon_utils

from building import extension as packaging
from tests.blender import scenes

MENUS = (
    "VIEW3D_MT_edit_mesh_vertices",
    "VIEW3D_MT_edit_mesh_context_menu",
    "VIEW3D_MT_curve_add",
)
HANDLERS = ("depsgraph_update_post", "undo_post", "redo_post", "load_pre", "load_post")
ENABLE = """
import sys
import bpy
import addon_utils
addon_utils.extensions_refresh()
assert addon_utils.enable("bl_ext.user_default.nicmm_curves", default_set=True) is not None
"""
DESIGN = """
bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=3)
bpy.context.object.data.vertices.foreach_set("select", [i in (3, 60, 100) for i in range(162)])
assert bpy.ops.nicmm.design_curve() == {"FINISHED"}
"""
REPORT = """
loaded = {name.partition(".")[0] for name in sys.modules}
core = [
    name
    for name in sys.modules
    if ".nicmm_core." in name and not name.endswith(".nicmm_core.options")
]
print("loaded:", *sorted(loaded & {"igl", "scipy", "torch"}), *(["core"] if core else []))
"""
DISABLE = """
addon_utils.disable("bl_ext.user_default.nicmm_curves", default_set=True)
"""


def entries(menu):
    """Modules of the functions appended to a menu."""
    return [draw.__module__ for draw in getattr(bpy.types, menu).draw._draw_funcs]


@pytest.mark.usefixtures("bpy_module")
def test_runs_from_the_installed_zip(extension):
    user_folder = os.environ["BLENDER_USER_RESOURCES"]
    assert extension.folder.startswith(user_folder)
    assert extension.core.__file__.startswith(extension.folder)
    (libraries,) = Path(user_folder, "extensions", ".local").rglob("site-packages")
    assert (libraries / "scipy").is_dir()
    assert (libraries / "igl").is_dir()
    assert not (libraries / "numpy").exists()


@pytest.mark.slow
@pytest.mark.usefixtures("bpy_module")
def test_libraries_are_loaded_late_and_torch_not_at_all(tmp_path):
    packaging.stage(tmp_path / "extensions" / "user_default" / "nicmm_curves")
    environment = {**os.environ, "BLENDER_USER_RESOURCES": str(tmp_path)}
    ran = subprocess.run(
        [sys.executable, "-c", ENABLE + REPORT + DESIGN + REPORT + DISABLE],
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert ran.returncode == 0, ran.stderr
    reports = [line for line in ran.stdout.splitlines() if line.startswith("loaded:")]
    assert reports == ["loaded:", "loaded: igl scipy core"]


def test_menus_and_panel(extension):
    for menu in MENUS:
        assert f"{extension.name}.nicmm_blender.interface.menus" in entries(menu)
    assert bpy.types.NICMM_PT_design_curve.bl_category == "NICMM"


class Layout:
    """Records the operator context of menu entries; it starts with one that skips `invoke`."""

    def __init__(self):
        self.operator_context, self.entries = "EXEC_REGION_WIN", []

    def separator(self):
        pass

    def operator(self, name, **_options):
        self.entries.append((name, self.operator_context))

    def operator_menu_enum(self, name, _property, **options):
        self.operator(name, **options)


def test_entries_of_menus_call_operators_as_the_window_does(empty_scene):
    menus = import_module(f"{empty_scene.name}.nicmm_blender.interface.menus")
    sphere = scenes.sphere()
    scenes.select(sphere, scenes.ring(sphere, 3))
    bpy.ops.nicmm.design_curve()
    entries = ((menus.draw_in_menu, 2), (menus.draw_conversions, 1), (menus.draw_for_curve, 3))
    for draw, count in entries:
        layout = Layout()
        draw(SimpleNamespace(layout=layout), bpy.context)
        assert len(layout.entries) == count
        assert {how for _, how in layout.entries} == {"INVOKE_REGION_WIN"}


def test_labels_and_tooltips_follow_blender(extension):
    for name, found in bpy.types.Scene.bl_rna.properties[
        "nicmm_curves"
    ].fixed_type.properties.items():
        if name in ("rna_type", "name"):
            continue
        assert found.name[0].isupper()
        assert found.description
        assert not found.description.endswith(".")
    tooltip = bpy.ops.nicmm.design_curve.get_rna_type().description
    assert tooltip and not tooltip.endswith(".")


def test_methods_keep_the_numbers_that_files_store(extension):
    settings = bpy.types.Scene.bl_rna.properties["nicmm_curves"].fixed_type
    items = settings.properties["method"].enum_items
    # The same numbers as when they were called NICMM, NICMM_PAPER and VARIATIONAL.
    numbers = {"ELASTIC": 0, "NICMM": 1, "VARIATIONAL": 2}
    assert {item.identifier: item.value for item in items} == numbers


def test_panel_hands_its_settings_to_the_operator(extension):
    operator = bpy.ops.nicmm.design_curve.get_rna_type().properties.keys()
    settings = bpy.context.scene.nicmm_curves.bl_rna.properties.keys()
    of_scripts = {"points", "point_group", "corners", "via_points"}
    of_tool = {"tool_action", "stroke_tolerance"}
    assert (
        set(settings) - {"rna_type", "name"} - of_tool == set(operator) - {"rna_type"} - of_scripts
    )


@pytest.mark.slow
def test_disabling_removes_everything(extension):
    addon_utils.disable(extension.name, default_set=True)
    try:
        assert not hasattr(bpy.types, "NICMM_OT_design_curve")
        assert not hasattr(bpy.types, "NICMM_PT_design_curve")
        assert not hasattr(bpy.types, "NICMM_PG_settings")
        assert not hasattr(bpy.types.Scene, "nicmm_curves")
        assert not hasattr(bpy.types.Scene, "nicmm_live_update")
        assert not hasattr(bpy.types.WindowManager, "nicmm_active_curve")
        assert not [name for name in dir(bpy.types) if name.startswith("NICMM_")]
        for handlers in (getattr(bpy.app.handlers, name) for name in HANDLERS):
            assert not [one for one in handlers if one.__module__.startswith(extension.name)]
        for menu in MENUS:
            assert not [name for name in entries(menu) if name.startswith(extension.name)]
    finally:
        addon_utils.enable(extension.name, default_set=True)


@pytest.mark.slow
def test_works_after_enabling_again(empty_scene):
    addon_utils.disable(empty_scene.name, default_set=True)
    addon_utils.enable(empty_scene.name, default_set=True)
    sphere = scenes.sphere()
    scenes.select(sphere, scenes.ring(sphere, 3))
    assert bpy.ops.nicmm.design_curve() == {"FINISHED"}
    assert np.isfinite(scenes.points(scenes.curves()[0])).all()


def test_properties_follow_the_options_of_the_core(empty_scene):
    """Every option in the table is a property of the operators, and so is an added option."""
    table = import_module(f"{empty_scene.name}.nicmm_core.options")
    settings = import_module(f"{empty_scene.name}.nicmm_blender.settings")
    record = import_module(f"{empty_scene.name}.nicmm_blender.scene.curve_record")
    designing = bpy.ops.nicmm.design_curve.get_rna_type().properties
    editing = bpy.ops.nicmm.edit_curve.get_rna_type().properties
    recorded = {}
    for option in table.OPTIONS:
        if option.kind in table.COMPOUND_KINDS:
            continue
        name = record.property_name(option)
        assert designing[name].name == option.label
        is_new_curve_option = option.name in ("order", "alternatives")
        assert (name in editing) == (not is_new_curve_option and option.name != "method")
        if not is_new_curve_option:
            recorded[name] = designing[name].default
    found = asdict(record.CurveSettings())
    of_blender = {
        "avoid_others": False,
        "use_modifiers": True,
        "mirror_axis": "NONE",
        "mirror_as": "JOINED",
    }
    assert list(found) == [*recorded, *of_blender]  # the digest depends on the order
    assert recorded["normal_bending"] == pytest.approx(scenes.NORMAL_BENDING)
    # Records from before there was this setting keep the curve as it is.
    assert found == {**recorded, "normal_bending": 0.0, **of_blender}
    added = table.Option("torsion", table.Kind.NUMBER, 2.0, "Torsion", "Twist", limits=(0.0, 5.0))
    whole = table.Option("turns", table.Kind.COUNT, 1, "Turns", "Winds", limits=(0.0, 9.0))
    made = settings.properties_of((*table.OPTIONS, added, whole))
    assert made["torsion"].keywords["default"] == 2.0 and made["torsion"].keywords["max"] == 5.0
    assert made["turns"].keywords["max"] == 9
