# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks the record of a curve before it is used, since files and scripts may contain anything."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields
from typing import Any

import numpy as np

from . import mirror_plane

Record = Mapping[str, Any]
"""The custom property that holds a record."""

LARGEST = 2**31 - 1
"""Largest index in Blender."""

SPLINES = ("EVEN", "EXACT", "BEZIER")
"""Spline types of a drawing."""


def is_group(value: object) -> bool:
    """Whether a custom property is a group of properties."""
    return hasattr(value, "keys") and hasattr(value, "get")


def problem_of(record: Record) -> str:
    """The problem with the points of a record; empty if they can be used."""
    return _problem(_check_points, record)


def problem_of_settings(record: Record, settings_type: type) -> str:
    """The problem with the settings of a record, whose class is `settings_type`; empty if none."""
    return _problem(_check_settings, record, settings_type)


def _problem(check: Callable[..., None], *arguments: object) -> str:
    try:
        check(*arguments)
    except _DamagedError as error:
        return str(error)
    return ""


class _DamagedError(Exception):
    """A problem with a record."""


def _check_points(record: Record) -> None:
    counts = _whole(record, "counts", least=1)
    closed = _whole(record, "closed", len(counts), least=0)
    total = sum(counts)
    _whole(record, "corners", 3 * total, least=0)
    _numbers(record, "barycentric", 3 * total)
    control_counts = _whole(record, "control_counts", len(counts), least=0)
    index = _whole(record, "control_index", sum(control_counts), least=-1)
    for number, (first, last) in enumerate(_ranges(control_counts)):
        if (index[first:last] >= counts[number]).any():
            raise _DamagedError("a control point is beyond the end of the curve")
    vertices = record.get("vertices")
    if not isinstance(vertices, int) or vertices < 0:
        raise _DamagedError(f"its number of vertices is {vertices!r}")
    count = _check_stored(record, "control_")
    if (_whole(record, "corner_points", count, least=0) > 1).any():
        raise _DamagedError("corner_points has values other than 0 and 1")
    _check_mirror(record, count, control_counts)
    if "via_legs" in record:
        legs = _whole(record, "via_legs", _check_stored(record, "via_"), least=0)
        if (np.diff(legs) < 0).any() or (legs >= count).any():
            raise _DamagedError("a via point is on a leg that does not exist")
    _check_junctions(record, count)
    if not len(counts) and (len(closed) or len(control_counts)):
        raise _DamagedError("it has settings of a curve but no curve")


def _check_mirror(record: Record, count: int, control_counts: np.ndarray) -> None:
    """Check that a curve with a mirror passes through its control points and their images.

    Parameters
    ----------
    record : mapping
    count : int
        Number of stored control points.
    control_counts : int array
        Number of control points of each curve, images included.
    """
    asked = record["asked"]
    if asked.get("mirror_axis", mirror_plane.NONE) == mirror_plane.NONE:
        return
    if asked.get("mirror_as") == mirror_plane.PAIR:
        fits = control_counts.tolist() in ([], [count, count])
    else:  # up to two points are on the plane, and have no images
        fits = not len(control_counts) or (
            len(control_counts) == 1 and 2 * count - 2 <= control_counts[0] <= 2 * count
        )
    if not fits:
        raise _DamagedError("its curve does not fit its control points and its mirror")


def _check_junctions(record: Record, count: int) -> None:
    """Check the junctions among the control points, and the rank."""
    rank = record.get("rank")
    if not isinstance(rank, int):
        raise _DamagedError(f"its rank is {rank!r}")
    stored = record.get("junctions", ())
    if isinstance(stored, str) or not hasattr(stored, "__iter__"):
        raise _DamagedError("junctions is not a list")
    for junction in stored:
        if not is_group(junction):
            raise _DamagedError("a junction is not a group of properties")
        values = [junction.get(name) for name in ("point", "part", "leg", "legs")]
        if not all(isinstance(value, int) and value >= 0 for value in values):
            raise _DamagedError("a junction has no valid indices")
        point, _part, leg, legs = values
        share = junction.get("share")
        if point >= count or leg >= legs or not _is_finite(share) or not 0.0 <= share <= 1.0:
            raise _DamagedError("a junction is at a place that does not exist")


def _check_stored(record: Record, kind: str) -> int:
    """Check control points or via points, whose names begin with their kind; return their number.

    On a surface that modifiers generate they are also stored on the cage.
    """
    corners = _whole(record, f"{kind}corners", least=0)
    if len(corners) % 3:
        raise _DamagedError(f"the length of {kind}corners is not a multiple of three")
    _numbers(record, f"{kind}barycentric", len(corners))
    _numbers(record, f"{kind}positions", len(corners))
    count = len(corners) // 3
    if len(record.get("cage", ())):
        _whole(record, "cage", 3, least=0)
        _whole(record, f"{kind}cage_faces", count, least=-1)
        _numbers(record, f"{kind}cage_places", 2 * count)
        _whole(record, f"{kind}cage_copies", count, least=0)
    return count


def _check_settings(record: Record, settings_type: type) -> None:
    settings: Any = record.get("asked")
    drawn: Any = record.get("drawn")
    if not is_group(settings):
        raise _DamagedError("asked is not a group of properties")
    for field in fields(settings_type):
        value = settings.get(field.name, field.default)
        fits = isinstance(value, str) if isinstance(field.default, str) else _is_finite(value)
        if not fits or value not in mirror_plane.CHOICES.get(field.name, (value,)):
            raise _DamagedError(f"its setting {field.name} is {value!r}")
    if not (is_group(drawn) and drawn.get("spline") in SPLINES and _is_finite(drawn.get("offset"))):
        raise _DamagedError("drawn does not describe how the curve is drawn")


def _is_finite(value: object) -> bool:
    return isinstance(value, int | float) and bool(np.isfinite(value))


def _ranges(counts: np.ndarray) -> Iterator[tuple[int, int]]:
    """Start and end of each part of an array that is divided into parts of these lengths."""
    ends = np.cumsum(counts)
    return zip((ends - counts).tolist(), ends.tolist(), strict=True)


def _numbers(record: Record, name: str, length: int | None = None) -> np.ndarray:
    """Read a list of finite numbers of a given length, or of any length."""
    try:
        values = np.array(record[name], dtype=np.float64)
    except (KeyError, TypeError, ValueError) as error:
        raise _DamagedError(f"{name} is missing or does not consist of numbers") from error
    if values.ndim != 1 or not np.isfinite(values).all():
        raise _DamagedError(f"{name} has values that are not finite numbers")
    if length is not None and len(values) != length:
        raise _DamagedError(f"{name} has {len(values)} values and needs {length}")
    return values


def _whole(record: Record, name: str, length: int | None = None, least: int = 0) -> np.ndarray:
    """Read a list of whole numbers from `least` to `LARGEST`."""
    values = _numbers(record, name, length)
    if ((values != np.floor(values)) | (values < least) | (values > LARGEST)).any():
        raise _DamagedError(f"{name} has values that are not valid indices or counts")
    return values.astype(np.int64)
