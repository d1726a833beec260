"""Repairs meshes with defects so that every stage works on them, and maps curves back.

`mapped_mesh` maps between a repaired mesh and the original, `nonmanifold` and `degenerate_faces`
repair meshes, and `free_surface` removes the faces inside obstacles.
"""
