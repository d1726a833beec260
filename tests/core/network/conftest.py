"""The tests of the network load PyTorch; no other conftest does."""

import torch

# The matrices here are so small that a second thread costs more time than it saves.
torch.set_num_threads(1)
