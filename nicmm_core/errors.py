"""What can go wrong, by type: one root, and a message that says what to change.

Every message names the argument, says what was found and what would mend it.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PointName:
    """A point by its argument and its index there, as messages name it."""

    argument: str
    index: int

    def __str__(self) -> str:
        return f"{self.argument}[{self.index}]"


class NicmmError(Exception):
    """Root of every error that this package raises for what it was given.

    Attributes
    ----------
    points : tuple of PointName
        The points that the message names.
    """

    def __init__(self, message: str, *points: PointName) -> None:
        super().__init__(message)
        self.points = points


class MeshError(NicmmError):
    """The vertex or face array cannot be a triangle mesh."""


class ControlPointError(NicmmError):
    """The control points cannot be used: too few, repeated, out of range or off the surface."""


class UnreachableError(NicmmError):
    """No curve on this surface can do what was asked."""


class ArgumentError(NicmmError):
    """Another argument (a method, a map, a weight, a file) has a value that cannot be used."""


class CurveError(NicmmError):
    """A curve cannot be used so: it is not on the mesh, meets itself or bounds no region."""


class MissingPackageError(NicmmError):
    """A method needs a package that is not installed."""
