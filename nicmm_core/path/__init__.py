"""A simple initial path through the control points, with virtual splits where vertices are too few.

`initial_loop` is the entry point.
"""
