"""Relaxation of the curve itself on the input mesh.

`relaxing` is the entry point; `warm_start` starts from a curve that was relaxed before.
"""
