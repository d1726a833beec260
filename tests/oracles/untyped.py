"""Origin of exceptions that are not errors of the package."""

from __future__ import annotations

from pathlib import Path


def place_of(error: Exception) -> str:
    """File name and line that raised an exception."""
    trace, place = error.__traceback__, ""
    while trace is not None:
        place = f"{Path(trace.tb_frame.f_code.co_filename).name}:{trace.tb_lineno}"
        trace = trace.tb_next
    return place
