"""The method of the paper, and the variational method with which it is compared.

The curve is the zero set of a level set. `problem` builds the input of the solvers. `fitting` takes
steps of the network's parameters and `variational` steps of φ at the vertices; `level_set_solver`
makes them. `contour` extracts the curve. The default method uses nothing of this. Only the modules
for pretraining import PyTorch.
"""
