"""Level sets whose zero set is the curve: distance, features, energy, topology and contour.

`problem` builds the input of the solvers, `variational` is the solver without a network, and
`contour` extracts the curve.
"""
