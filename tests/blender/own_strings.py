"""The labels and tooltips of the extension, collected from its registered classes."""

import bpy

KINDS = (
    bpy.types.Operator,
    bpy.types.Panel,
    bpy.types.Menu,
    bpy.types.PropertyGroup,
    bpy.types.AddonPreferences,
)


def own_strings(package):
    """Labels and tooltips of all classes whose module is in a package, without repetitions."""
    found = {}
    for kind in KINDS:
        common = {each.identifier for each in kind.bl_rna.properties}
        for cls in _below(kind):
            if not cls.__module__.startswith(package) or not cls.is_registered:
                continue
            found[getattr(cls, "bl_label", "")] = None
            found[_rna(cls).description] = None
            for each in _rna(cls).properties:
                if each.identifier in common:
                    continue
                found |= {each.name: None, each.description: None}
                if each.type == "ENUM":
                    for item in each.enum_items_static:
                        found |= {item.name: None, item.description: None}
    return [text for text in found if any(map(str.isalpha, text))]


def _below(kind):
    for each in kind.__subclasses__():
        yield each
        yield from _below(each)


def _rna(cls):
    if issubclass(cls, bpy.types.Operator):
        group, _, name = cls.bl_idname.partition(".")
        return getattr(getattr(bpy.ops, group), name).get_rna_type()
    return cls.bl_rna
