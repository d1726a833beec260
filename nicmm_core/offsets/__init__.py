"""Curves at a constant distance from another curve along the surface.

`curve_offsets` computes them; `level_lines` traces lines along which a function is constant.
"""
