"""Set-up of the network tests; no other conftest imports PyTorch."""

import torch

# The matrices are so small that a second thread would cost more time than it saves.
torch.set_num_threads(1)
