"""The methods that are compared."""

from nicmm_core.options import option

METHODS = option("method").names
