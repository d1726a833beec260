"""Relaxes symmetric curves.

A relaxed curve is made symmetric, relaxed again and made symmetric again, as long as that lowers
the energy. On a symmetric surface the nodes of a symmetric curve move symmetrically, except for
rounding and for what the triangulation changes, so one or two rounds are usually enough.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from ..courses.comparison import distinct_by_energy, is_apart
from ..geometry.curve import SurfaceCurve
from ..geometry.surface_points import nearest_points
from ..improvement import KINKED, relaxation_config
from ..progress import CancelledError
from ..relaxation.curve_energies import energies_of, relative_energies, scaled_bending
from ..relaxation.discrete_curve import DiscreteCurve
from ..relaxation.elastic_energy import bending_energy, feature_energy
from ..relaxation.relaxing import RelaxationConfig, Relaxed
from ..relaxation.warm_start import WARM
from ..request import Request
from ..start_search import InitialCurve
from ..status import Status
from .halves import mirror_of, symmetric_curves
from .reflection import asymmetry
from .symmetric_request import FARTHEST_IMAGE

MOST_ROUNDS = 6
"""Greatest number of times that a symmetric curve is relaxed."""

SHORT_ROUND = 3
"""Iterations of a round after one that has led away from symmetric curves.

A symmetric curve may be a saddle point of the energy of all curves.
"""

SAME_ENERGY = 0.1
"""Difference of energies that is neglected; that of a plane circle is 8π², about 80."""

ROUGH = 2.0
"""Energy of a symmetric curve above that of a relaxed one from which the relaxed one is taken, if
the surface is not symmetric."""

SYMMETRIC_SURFACE = 1e-5
"""Distance of mirror images from the surface, in bounding-box diagonals, up to which the surface
counts as symmetric."""

MOST_CANDIDATES = 4
"""Greatest number of relaxed curves that are made symmetric, besides those for alternatives."""

MOST_RELAXED = 2
"""Greatest number of symmetric curves that are relaxed, besides those for alternatives."""

PROMISING = 30.0
"""Energy above that of the best symmetric curve up to which a start may lead to a better one."""

ComparedCurve = tuple[InitialCurve, Relaxed, float]
"""A relaxed curve with its start, and its energy relative to that of the best curve."""

Relax = Callable[[InitialCurve, RelaxationConfig], Relaxed]
"""Relaxes a start with some settings."""


@dataclass(frozen=True)
class SymmetricCurve:
    """A symmetric curve with its nodes.

    Attributes
    ----------
    curve : SurfaceCurve
    start : InitialCurve
        The curve with nodes, from which relaxation can begin.
    """

    curve: SurfaceCurve
    start: InitialCurve

    @property
    def nodes(self) -> DiscreteCurve:
        """The curve with nodes."""
        assert isinstance(self.start.curve, DiscreteCurve)
        return self.start.curve

    def energy(self, request: Request, scale: float) -> float:
        """Its energy with a length scale."""
        return energies_of(self.start.surface, [self.nodes], request.smoothness, scale)[0]


def symmetric_from(
    request: Request, start: InitialCurve, curve: DiscreteCurve
) -> Iterator[SymmetricCurve]:
    """Yield the symmetric curves made of a curve through all control points.

    Parameters
    ----------
    request : Request
    start : InitialCurve
        What the curve was relaxed from.
    curve : DiscreteCurve
    """
    for nodes, found, visited in symmetric_curves(start.surface, curve, start.visited, request):
        yield SymmetricCurve(found, replace(start, curve=nodes, visited=visited))


def relaxed_symmetric(
    request: Request,
    start: InitialCurve,
    best: SymmetricCurve | None,
    scale: float,
    relax: Relax,
    config: RelaxationConfig,
) -> tuple[InitialCurve, Relaxed] | None:
    """Relax a curve to a symmetric one.

    Parameters
    ----------
    request : Request
    start : InitialCurve
        A curve through all control points.
    best : SymmetricCurve or None
        The same curve if it is symmetric.
    scale : float
        Length scale of the energies.
    relax : callable
        Relaxes a start with some settings; raises `CancelledError` if the caller stops it.
    config : RelaxationConfig
        Settings of the first round; the limit on iterations is that of all rounds together.

    Returns
    -------
    InitialCurve
        The start of the symmetric curve of least energy.
    Relaxed
        This curve.

    None if no symmetric curve was found.

    Raises
    ------
    CancelledError
        If the caller has stopped it before there was a symmetric curve.
    """
    iterations, work, status = 0, 0.0, Status.ITERATION_LIMIT
    collided, is_short = False, False
    fair: tuple[float, InitialCurve, Relaxed] | None = None
    for number in range(MOST_ROUNDS):
        left = config.most_iterations - iterations
        if left <= 0:
            break
        limit = min(left, SHORT_ROUND) if is_short else left
        settings = config if number == 0 else replace(WARM, defer_tracing=config.defer_tracing)
        try:
            last = relax(start, replace(settings, most_iterations=limit))
            found = _best_from(request, start, last, scale)
        except CancelledError:
            if best is None:
                raise
            status = Status.CANCELLED
            break
        iterations, work = iterations + last.iterations, work + last.work
        collided = collided or last.collided
        if last.status is Status.UNRELAXED:
            status = Status.UNRELAXED
            break
        (reached,) = energies_of(start.surface, [last.discrete_curve], request.smoothness, scale)
        if fair is None or reached < fair[0]:
            fair = reached, start, last
        energy = math.inf if found is None else found.energy(request, scale)
        before = math.inf if best is None else best.energy(request, scale)
        if found is not None and energy < before:
            best, start = found, found.start
            is_settled = last.status is Status.CONVERGED and energy <= reached + SAME_ENERGY
            if not is_settled and energy < before - SAME_ENERGY:
                continue
        elif best is None:
            return None
        elif not is_short and limit > SHORT_ROUND:
            is_short = True
            continue
        if last.status is Status.CONVERGED or is_short:
            status = Status.CONVERGED
        break
    if best is None:
        return None
    if fair is not None and _is_rough(request, best, fair[2], fair[0], scale):
        return fair[1], replace(fair[2], iterations=iterations, work=work, collided=collided)
    curve = best.nodes
    bending = bending_energy(curve.nodes, best.start.surface.normal_bending)
    feature = feature_energy(curve.nodes)
    relaxed = Relaxed(best.curve, curve, bending, feature, iterations, status, work, collided)
    return best.start, relaxed


def _is_rough(
    request: Request, symmetric: SymmetricCurve, fair: Relaxed, energy: float, scale: float
) -> bool:
    """Whether the surface is not symmetric enough for a fair symmetric curve.

    Where it is only nearly symmetric, mirror images of points are on the surface only after they
    are moved there, which bends the image of the curve. The curve `fair`, with its energy, has been
    relaxed from a symmetric one and not made symmetric again.
    """
    if symmetric.energy(request, scale) <= energy + ROUGH:
        return False
    mesh, plane = symmetric.start.surface.mesh, mirror_of(request).plane
    images = plane.reflected(symmetric.nodes.nodes.positions)
    if nearest_points(mesh, images)[1].max() <= SYMMETRIC_SURFACE * mesh.diagonal:
        return False
    return asymmetry(fair.curve, plane) <= FARTHEST_IMAGE * mesh.diagonal


def _best_from(
    request: Request, start: InitialCurve, last: Relaxed, scale: float
) -> SymmetricCurve | None:
    """The symmetric curve of least energy made of a relaxed curve, or None."""
    curves = symmetric_from(request, start, last.discrete_curve)
    return min(curves, key=lambda each: each.energy(request, scale), default=None)


def best_symmetric(
    request: Request,
    begins: list[SymmetricCurve],
    relax: Relax,
    most_iterations: int | None,
) -> tuple[list[ComparedCurve], bool]:
    """Relax the best of some symmetric curves.

    Parameters
    ----------
    request : Request
    begins : list of SymmetricCurve
    relax : callable
    most_iterations : int or None
        Limit on the iterations of each curve; None for the usual one.

    Returns
    -------
    list of ComparedCurve
        Distinct symmetric curves by ascending energy.
    bool
        Whether the caller has stopped it.
    """
    starts: list[InitialCurve] = []
    relaxed: list[Relaxed] = []
    tried: list[DiscreteCurve] = []
    energies: list[float] = []
    scale = min(each.nodes.length for each in begins)
    for begin in sorted(begins, key=lambda each: each.energy(request, scale)):
        is_enough = len(relaxed) > request.alternatives
        if is_enough and (
            len(relaxed) >= MOST_RELAXED + request.alternatives
            or begin.energy(request, scale) > min(energies) + PROMISING
        ):
            break
        if not is_apart(begin.start.surface, begin.nodes, tried):
            continue
        tried.append(begin.nodes)
        config = WARM if scaled_bending(begin.nodes) < KINKED else relaxation_config(request)
        if most_iterations is not None:
            config = replace(config, most_iterations=most_iterations)
        found = relaxed_symmetric(request, begin.start, begin, scale, relax, config)
        assert found is not None
        starts.append(found[0])
        relaxed.append(found[1])
        energies += energies_of(
            begin.start.surface, [found[1].discrete_curve], request.smoothness, scale
        )
        if found[1].status is Status.CANCELLED:
            break
    curves = [each.discrete_curve for each in relaxed]
    order = list(distinct_by_energy(starts[0].surface, curves, energies))
    relative = relative_energies(starts[0].surface, curves, request.smoothness, scale)
    cancelled = relaxed[-1].status is Status.CANCELLED
    return [(starts[i], relaxed[i], relative[i]) for i in order], cancelled
