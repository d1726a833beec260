"""Finds few control points whose curve follows a line.

`stroke_fit` does so for a stroke, `feature_lines` finds lines along features of the surface, and
`stretch` replaces a stretch of a curve.
"""
