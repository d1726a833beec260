"""Relaxes curves on a canonical copy that were found on its Delaunay triangulation.

Both have the same vertices, and nearly the same surface.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from .improvement import relaxation_config
from .progress import uninterrupted
from .relaxation.curve_energies import energies_of, scaled_bending
from .relaxation.discrete_curve import DiscreteCurve
from .relaxation.relaxing import RelaxationConfig, Relaxed, unrelaxed
from .request import Request
from .start_search import InitialCurve, StartSearch
from .status import Status
from .symmetry.symmetric_relaxation import ComparedCurve

FAR_MORE, SLIGHTLY = 1.2, 3.0
"""Factor and increase of L ∮ κ_g² ds, together, above which a curve bends far more than before."""

LEAST_DECREASE = 1e-4
"""Decrease of the energy in an iteration, relative to the bending energy, below which it converges.

It is less than where curves are only compared, since the result must have no ripples.
"""

Relax = Callable[[InitialCurve, RelaxationConfig, int | None], Relaxed]
"""Relaxes a start with some settings and at most a number of iterations."""


def relaxed_on_copy(
    search: StartSearch,
    request: Request,
    curves: list[ComparedCurve],
    relax: Relax,
    max_iterations: int | None,
    cancelled: bool,
) -> list[ComparedCurve]:
    """Map curves from the Delaunay triangulation to the copy and relax them there.

    Those that are not simple on the copy are left out.

    Parameters
    ----------
    search : StartSearch
        The search on the copy.
    request : Request
        The request on the copy.
    curves : list of ComparedCurve
        Curves on the Delaunay triangulation.
    relax : callable
    max_iterations : int or None
        Limit on the iterations on both meshes together.
    cancelled : bool
        Whether the caller has stopped the search. Then the curves are mapped, but not relaxed.
    """
    found = []
    for start, before, energy in curves:
        with uninterrupted():  # so that a curve that was found before cancelling is not lost
            there = replace(start, curve=before.discrete_curve)
            begin = search.from_delaunay(request, there)
        if begin is None:
            continue
        assert isinstance(begin.curve, DiscreteCurve)
        left = None if max_iterations is None else max_iterations - before.iterations
        if cancelled or left == 0:
            status = Status.CANCELLED if cancelled else before.status
            relaxed = unrelaxed(begin.surface, begin.curve, status)
        else:
            relaxed = _relaxed_on_levels(request, begin, before, relax, left)
            cancelled = relaxed.status is Status.CANCELLED
        iterations, work = before.iterations + relaxed.iterations, before.work + relaxed.work
        found.append((begin, replace(relaxed, iterations=iterations, work=work), energy))
    return found


def _relaxed_on_levels(
    request: Request,
    start: InitialCurve,
    before: Relaxed,
    relax: Relax,
    max_iterations: int | None,
) -> Relaxed:
    """The best result of relaxing a start with all nodes.

    As long as it bends far more than it did on the Delaunay triangulation, it is relaxed with fewer
    nodes at first as well.
    """
    assert isinstance(start.curve, DiscreteCurve)
    enough = FAR_MORE * scaled_bending(before.discrete_curve) + SLIGHTLY
    config = replace(
        relaxation_config(request),
        least_decrease=LEAST_DECREASE,
        tension_factor=1.0,
        fine_below=0.0,
    )
    found, last = [unrelaxed(start.surface, start.curve, before.status)], config.levels[-1]
    for levels in (last,), (last // 2, last), config.levels:
        found.append(relax(start, replace(config, levels=levels), max_iterations))
        cancelled = found[-1].status is Status.CANCELLED
        bends_enough = scaled_bending(found[-1].discrete_curve) <= enough
        if max_iterations is not None or cancelled or bends_enough:
            break
    curves = [each.discrete_curve for each in found]
    energies = energies_of(start.surface, curves, request.smoothness)
    best = found[energies.index(min(energies))]
    return replace(best, status=Status.CANCELLED) if cancelled else best
