"""The method of the paper, and the variational method with which it is compared.

The curve is the zero set of a level set. `problem` builds the input of the solvers: the network,
which `finetuning` trains further for each curve, and `variational`. `contour` extracts the curve.
The default method uses nothing of this. Only the modules for training import PyTorch.
"""
