"""Names of the methods that the benchmarks compare."""

from nicmm_core.options import option

METHODS = option("method").names
