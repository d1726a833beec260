"""The initial path: a simple path of mesh edges through the control points.

Where the mesh has too few vertices for such a path, edges are split virtually. The entry point is
`initial_path`.
"""
