"""Uses of a curve: cut the mesh along it, take its region, separate the surface there.

No module of the design imports this package.
"""
