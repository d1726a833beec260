"""Meshes, points and polylines on them, traces over their faces, and the tolerances of all.

It imports nothing but `errors` and `progress` from above; start with `mesh` and `surface_points`.
"""
