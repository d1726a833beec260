"""Finds curves on other meshes of the same surface: a coarse mesh, and the Delaunay triangulation.

`coarse_mesh` builds the coarse mesh of a large mesh, and `fine_curve` maps a curve from it to the
fine mesh; `coarse_start` puts these together. `retriangulated` maps requests to the Delaunay
triangulation, and curves back.
"""
