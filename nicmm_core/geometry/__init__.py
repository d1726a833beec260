"""Meshes, points and polylines on them, traces over their faces, and the tolerances.

Read `mesh` and `surface_points` first. Of the modules outside, it imports only `errors`, `options`
and `progress`.
"""
