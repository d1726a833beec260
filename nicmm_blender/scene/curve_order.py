# SPDX-License-Identifier: GPL-3.0-or-later
"""The order of the curves of a mesh: a curve can avoid those above it in the list.

Each record stores a rank. A new curve gets the greatest rank plus one. Curves of equal rank are in
the order of their names.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import bpy

RANK = "rank"
"""Name of the field of a record."""

UNRANKED = -1
"""Rank of a curve with a damaged record, which comes before the others."""

RECORD_KEY = "nicmm_curve"
"""Custom property of the object that holds the record."""


def rank_of(curve_object: bpy.types.Object) -> int:
    """The rank of a curve; `UNRANKED` if its record has none."""
    rank = curve_object[RECORD_KEY].get(RANK)
    return rank if isinstance(rank, int) else UNRANKED


def position_of(curve_object: bpy.types.Object) -> tuple[int, str, str]:
    """A key to sort curve objects by: rank, name, and the file of a linked one."""
    library = curve_object.library
    return rank_of(curve_object), curve_object.name, "" if library is None else library.filepath


def next_rank(curves: Iterable[bpy.types.Object]) -> int:
    """The rank of a new curve below others."""
    return max((rank_of(each) for each in curves), default=UNRANKED) + 1


def new_ranks(curves: Sequence[bpy.types.Object]) -> dict[bpy.types.Object, int]:
    """The ranks of those curves that need another one to be in the order given."""
    found, least = {}, 0
    for each in curves:
        rank = rank_of(each)
        if rank < least:
            found[each] = rank = least
        least = rank + 1
    return found


def set_rank(curve_object: bpy.types.Object, rank: int) -> None:
    """Give a curve a rank."""
    curve_object[RECORD_KEY][RANK] = rank


def reverse(curves: Sequence[bpy.types.Object]) -> None:
    """Reverse the order of curves of different rank."""
    ranks = [rank_of(each) for each in curves]
    for each, rank in zip(curves, reversed(ranks), strict=True):
        set_rank(each, rank)
