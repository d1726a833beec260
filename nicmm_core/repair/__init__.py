"""Repairs meshes with defects so that every stage works on them, and maps curves back.

`mapped_mesh` is the map, `nonmanifold` and `degenerate_faces` repair, and `free_surface` removes
obstacles.
"""
