"""From control points to a simple initial path on the surface, split where vertices are too few.

`initial_loop` is the way in.
"""
