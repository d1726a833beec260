"""Meshes on which every stage works, made from meshes with defects, and the maps back.

`mapped_mesh` is the map, `nonmanifold` and `degenerate_faces` mend, and `free_surface` takes
obstacles away.
"""
