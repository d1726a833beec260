"""Large meshes: the curve is found on a coarse mesh of the same surface, then lifted.

`coarse_mesh` makes the coarse mesh, `lifting` brings a curve back from it.
"""
