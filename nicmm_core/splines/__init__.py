"""Clean versions of a curve for display and modelling: evenly spaced points, Bézier splines.

A curve of the package is exact: it has a point on every edge that it crosses, so its spacing varies
from zero to the length of an edge. `even_spacing` and `bezier` compute curves without this defect,
within the distance `geometry.tolerances.of_clean_curve`; `offset` moves points off the surface. The
folder imports only from `geometry`.
"""
