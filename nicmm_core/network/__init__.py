"""The network that infers the course of the curve: its forward pass, training and weights.

`single_pass` runs the pretrained network; `finetuning` trains it further for each curve, as the
paper does. Only the modules for training import PyTorch.
"""
