"""Relaxes the curve itself on the input mesh until its energy converges.

`relaxing` is the entry point; `warm_start` starts from a curve that has been relaxed before.
"""
