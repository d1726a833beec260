"""Large meshes: the curve is found on a coarse mesh of the same surface first.

`coarse_mesh` makes the coarse mesh, `fine_curve` maps a curve from there to the fine mesh.
"""
