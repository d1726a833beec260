"""Level sets whose zero set is the curve: distance, features, energy, topology and contour.

`problem` builds the input and `contour` extracts the curve; `variational` minimises the energy.
"""
