"""Outputs of a curve for the caller: the mesh cut along it, its region, and separate parts.

No module of the design imports this package.
"""
