"""The table of the options of a curve, each defined once.

The checks in `arguments`, the command line and Blender's properties take names, defaults, limits
and descriptions from this table. The signature of `design_curve` repeats names and defaults, which
a test compares. This module imports nothing from the package, so that Blender can read it without
loading the core.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

FEWEST_CLOSED, FEWEST_OPEN = 3, 2
"""Least number of control points of a closed curve and of an open one."""


class Kind(Enum):
    """The kind of value that an option takes."""

    SWITCH = "True or False"
    CHOICE = "one of several names"
    NUMBER = "a number without a unit"
    COUNT = "a whole number"
    LENGTH = "a length in mesh units"
    WEIGHTS = "a weight for each vertex, or None"
    POINTS = "a mapping from indices of control points to points, or None"
    CURVES = "a list of curves on the mesh, or None"
    INDICES = "indices of control points, or None"
    PLANE = "a point of a plane and its normal, or None"


COMPOUND_KINDS = (Kind.POINTS, Kind.CURVES, Kind.INDICES, Kind.PLANE)
"""Kinds of values that have several parts, and so no single field in a user interface."""


@dataclass(frozen=True)
class Choice:
    """One of the values of a choice: its name in scripts, its label and its effect."""

    name: str
    label: str
    description: str


@dataclass(frozen=True)
class Option:
    """An option of a curve.

    Attributes
    ----------
    name : str
        Name of the keyword argument.
    kind : Kind
    default : object
    label : str
        Label in user interfaces.
    description : str
        Tooltip and command-line help, without the last full stop.
    choices : tuple of Choice
        Accepted values of a choice.
    limits : (float, float)
        Smallest and largest value of a number, a count or a length, both included.
    usual : (float, float)
        Range of a slider, inside the limits.
    needs : tuple of str
        Names of options without which this one has no effect; one of them is enough.
    elastic_only : bool
        Whether only the method "elastic" accepts another value than the default.
    flag : str
        Command-line flag, if it differs from the name. The flag of a switch inverts its default.
    """

    name: str
    kind: Kind
    default: object
    label: str
    description: str
    choices: tuple[Choice, ...] = ()
    limits: tuple[float, float] = (0.0, float("inf"))
    usual: tuple[float, float] = (0.0, float("inf"))
    needs: tuple[str, ...] = ()
    elastic_only: bool = False
    flag: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the choices."""
        return tuple(choice.name for choice in self.choices)


OPTIONS: tuple[Option, ...] = (
    Option(
        "closed",
        Kind.SWITCH,
        True,
        "Closed",
        "Join the last control point to the first",
        flag="open",
    ),
    Option(
        "order",
        Kind.CHOICE,
        "given",
        "Order",
        "The order in which the curve visits the control points",
        choices=(
            Choice("given", "As Given", "In the order in which they are given"),
            Choice("shortest", "Shortest", "In the shortest order, cyclic for a closed curve"),
        ),
    ),
    Option(
        "via_points",
        Kind.POINTS,
        None,
        "Via Points",
        "Points near which the curve runs on its way from one control point to the next",
        flag="via",
    ),
    Option(
        "method",
        Kind.CHOICE,
        "elastic",
        "Method",
        "How the curve is computed",
        choices=(
            Choice(
                "elastic",
                "Elastic",
                "Search for the fairest course and relax it as an elastic curve",
            ),
            Choice("nicmm", "NICMM (Neural)", "The network of the paper, fitted to each curve"),
            Choice(
                "variational",
                "Variational",
                "The same energy as NICMM, minimised without a network",
            ),
        ),
    ),
    Option(
        "smoothness",
        Kind.NUMBER,
        1.0,
        "Smoothness",
        "Weight of fairness relative to length; larger values give fairer, longer curves",
        limits=(1e-3, 1e3),
        usual=(0.1, 10.0),
    ),
    Option(
        "corners",
        Kind.INDICES,
        None,
        "Corners",
        "Control points at which the curve may turn freely",
        elastic_only=True,
    ),
    Option(
        "normal_bending",
        Kind.NUMBER,
        0.0,
        "Normal Bending",
        "Weight of the bending of the surface itself under the curve. 0 ignores it; larger values "
        "give a curve that avoids ridges and valleys; 1 counts the whole curvature in space",
        limits=(0.0, 10.0),
        usual=(0.0, 1.0),
        elastic_only=True,
    ),
    Option(
        "obstacles",
        Kind.WEIGHTS,
        None,
        "Obstacles",
        "Weights that keep the curve away. It never enters faces whose vertices all have weight 1",
    ),
    Option(
        "clearance",
        Kind.LENGTH,
        0.0,
        "Clearance",
        "Minimum distance along the surface from obstacles of weight 1 and from curves to avoid",
        needs=("obstacles", "avoid"),
    ),
    Option(
        "avoid",
        Kind.CURVES,
        None,
        "Avoid",
        "Curves on the mesh that the curve does not cross, except at control points on them",
        elastic_only=True,
    ),
    Option(
        "alignment",
        Kind.WEIGHTS,
        None,
        "Alignment",
        "Weights that attract the curve",
    ),
    Option(
        "mirror",
        Kind.PLANE,
        None,
        "Mirror",
        "Plane in which the curve is its own mirror image; the control points lie on one side",
        elastic_only=True,
    ),
    Option(
        "alternatives",
        Kind.COUNT,
        0,
        "Alternatives",
        "Maximum number of additional curves along other courses, the lowest energy first",
        usual=(0.0, 5.0),
        elastic_only=True,
    ),
)
"""All options, in the order in which user interfaces show them."""


def option(name: str) -> Option:
    """The option with a given name."""
    return next(each for each in OPTIONS if each.name == name)
