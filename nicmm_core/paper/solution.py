"""The result of a level-set solver."""

from __future__ import annotations

from dataclasses import dataclass

from ..geometry.array_types import FloatArray
from ..status import Status


@dataclass(frozen=True)
class Solution:
    """A level set, its losses and its status.

    Attributes
    ----------
    field : (n,) float array
        φ of the iteration with the least loss, in units of the problem.
    terms : dict of str to float
        Unweighted terms of the loss of that φ.
    losses : list of float
        Total loss of every iteration.
    status : Status
        How the computation ended.
    held : int
        Number of vertices, over all iterations, that had to keep their signs for the topology.
    """

    field: FloatArray
    terms: dict[str, float]
    losses: list[float]
    status: Status
    held: int = 0

    @property
    def iterations(self) -> int:
        """Number of iterations."""
        return len(self.losses)
