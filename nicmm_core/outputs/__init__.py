"""What can be done with a curve: cut the mesh along it, take its region, part the surface there.

Nothing below imports this package.
"""
