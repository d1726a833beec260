"""Where an error that is not the package's own came from."""

from __future__ import annotations

from pathlib import Path


def place_of(error: Exception) -> str:
    """File and line that raised an error."""
    trace, place = error.__traceback__, ""
    while trace is not None:
        place = f"{Path(trace.tb_frame.f_code.co_filename).name}:{trace.tb_lineno}"
        trace = trace.tb_next
    return place
