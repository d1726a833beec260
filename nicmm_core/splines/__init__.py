"""Clean versions of a curve for display and modelling: evenly spaced points, Bézier splines.

A curve of the package is exact: it has a point on every edge that it crosses, so its spacing varies
from nothing to an edge. `even_spacing` and `bezier` give curves without that, within the distance
`geometry.tolerances.of_clean_curve`; `offset` lifts points off the surface. Of the folders, it
imports only from `geometry`.
"""
