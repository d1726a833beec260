"""The exceptions of this package, with the base class `NicmmError`.

Every message names the argument, and says what was found and what to change.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PointName:
    """The name of a point in messages: the name of its argument, and its index there."""

    argument: str
    index: int

    def __str__(self) -> str:
        return f"{self.argument}[{self.index}]"


class NicmmError(Exception):
    """Base class of all errors that this package raises because of its input.

    Attributes
    ----------
    points : tuple of PointName
        Points that the message names.
    """

    def __init__(self, message: str, *points: PointName) -> None:
        super().__init__(message)
        self.points = points


class MeshError(NicmmError):
    """The vertices and faces, or the mesh file, do not give a usable triangle mesh."""


class ControlPointError(NicmmError):
    """The control points cannot be used: too few, repeated, out of range or off the surface."""


class UnreachableError(NicmmError):
    """No curve on this surface can satisfy the request."""


class ArgumentError(NicmmError):
    """Another argument, such as a method, map, weight or file, has a value that cannot be used."""


class CurveError(NicmmError):
    """A curve cannot be used as asked: it is not on the mesh, meets itself or bounds no region."""


class MissingPackageError(NicmmError):
    """Plots, pretraining or a batch of designs needs a package that is not installed."""
