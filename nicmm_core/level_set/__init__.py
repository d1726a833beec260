"""Level sets whose zero set is the curve: distance, features, energy, topology and contour.

`problem` is the way in and `contour` the way out; `variational` minimises the energy by itself.
"""
