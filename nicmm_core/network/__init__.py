"""The network that infers where the curve runs: its forward pass, its training and its weights.

`single_pass` runs it as pretrained; `finetuning` trains it further for each curve, as the paper
does. Only the modules that train it import PyTorch.
"""
