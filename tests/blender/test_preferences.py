"""Preferences, and rules that all operators and panels follow."""

import gc
import importlib.metadata
import importlib.util
import weakref
from importlib import import_module

import bpy
import numpy as np
import pytest

from tests.blender import scenes

OPERATORS = (
    "design_curve",
    "convert_curve",
    "edit_curve",
    "update_curves",
    "move_curve",
    "next_course",
    "choose_course",
    "new_map",
    "paint_map",
    "add_point",
    "insert_point",
    "move_point",
    "remove_point",
    "toggle_corner",
    "add_via_point",
    "move_via_point",
    "remove_via_point",
    "activate_curve",
    "end_curve",
    "draw_on_surface",
    "draw_stroke",
    "stroke_curve",
    "feature_curve",
    "strokes_to_curves",
)
PANELS = ("NICMM_PT_design_curve", "NICMM_PT_measures", "NICMM_PT_maps", "NICMM_PT_curves")


@pytest.fixture
def preferences(empty_scene):
    module = import_module(f"{empty_scene.name}.nicmm_blender.preferences")
    module.library_report.cache_clear()
    yield module
    module.library_report.cache_clear()


def test_all_operators_are_known_here(extension):
    assert sorted(dir(bpy.ops.nicmm)) == sorted(OPERATORS)
    assert {name for name in dir(bpy.types) if name.startswith("NICMM_PT_")} == set(PANELS)


@pytest.mark.parametrize("name", OPERATORS)
def test_labels_and_tooltips_follow_blender(extension, name):
    described = getattr(bpy.ops.nicmm, name).get_rna_type()
    for found in (described, *described.properties):
        if found.identifier == "rna_type":
            continue
        assert found.name[0].isupper(), found.identifier
        assert found.description and not found.description.endswith("."), found.identifier
        for item in getattr(found, "enum_items", ()):
            assert item.name and not item.description.endswith("."), item.identifier
    options = getattr(bpy.types, f"NICMM_OT_{name}").bl_options
    assert "UNDO" in options or "INTERNAL" in options


def test_preferences_take_effect_and_are_described(empty_scene, preferences):
    found = bpy.context.preferences.addons[empty_scene.name].preferences
    for name, value in (("patience", 1.5), ("kept_meshes", 5), ("live_delay", 2.5)):
        try:
            setattr(found, name, value)
            assert getattr(preferences, name)() == value
        finally:
            found.property_unset(name)
    for name, described in found.bl_rna.properties.items():
        if name not in ("rna_type", "bl_idname"):
            assert described.description and not described.description.endswith(".")


@pytest.mark.slow
def test_number_of_meshes_in_memory(empty_scene, preferences):
    surface_cache = scenes.module(empty_scene, "scene.surface_cache")
    read = scenes.module(empty_scene, "scene.surface").read
    found = bpy.context.preferences.addons[empty_scene.name].preferences
    try:
        for wanted, left in ((3, 3), (1, 1), (0, 1)):  # the tool needs one
            found.kept_meshes = wanted
            meshes = []
            for _ in range(4):
                sphere = scenes.sphere()
                place = scenes.positions(sphere) * (1, 1, 1 + np.random.default_rng().random())
                sphere.data.vertices.foreach_set("co", place.astype(np.float32).ravel())
                scenes.select(sphere, scenes.ring(sphere, 3))
                bpy.ops.nicmm.design_curve()
                meshes.append(weakref.ref(surface_cache.core_mesh(read(sphere, True))))
            gc.collect()
            assert [mesh() is not None for mesh in meshes] == [False] * (4 - left) + [True] * left
    finally:
        found.property_unset("kept_meshes")


def test_libraries_are_reported(preferences, monkeypatch):
    (scipy, igl, pools, network) = preferences.library_report()
    assert scipy == f"SciPy {importlib.metadata.version('scipy')}"
    assert igl == f"libigl {importlib.metadata.version('libigl')}"
    assert pools == f"threadpoolctl {importlib.metadata.version('threadpoolctl')}"
    assert "internet" in network
    preferences.library_report.cache_clear()
    found = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name: None if name == "igl" else found(name)
    )
    (_, igl, _, _) = preferences.library_report()
    assert igl.startswith("libigl is missing. Install the zip")
