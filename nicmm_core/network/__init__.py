"""The network that says where the curve runs: its forward pass, its training and its weights.

`single_pass` takes it as it was pretrained, `prediction` trains it on as the paper does. Only what
trains imports PyTorch.
"""
