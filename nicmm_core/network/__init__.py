"""The network that says where the curve runs: its forward pass, its training and its weights.

`single_pass` takes it as it was pretrained, `finetuning` trains it further for each curve, as the paper does. Only what
trains imports PyTorch.
"""
