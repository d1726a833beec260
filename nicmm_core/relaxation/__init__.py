"""The curve itself is relaxed on the input mesh.

`relaxing` is the entry point; `warm_start` goes on from a curve that was relaxed before.
"""
