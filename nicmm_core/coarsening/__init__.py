"""Finds the start of a curve on a large mesh, on a coarse mesh of the same surface.

`coarse_mesh` builds the coarse mesh, and `fine_curve` maps a curve from it to the fine mesh.
`coarse_start` is the entry point.
"""
