"""The methods that are compared."""

from nicmm_core import arguments

METHODS = arguments.METHODS
