"""Meshes, points and polylines on them, traces over their faces, and the tolerances.

Read `mesh` and `surface_points` first. From outside this folder, its modules import only `errors`,
`options` and `progress`.
"""
