"""The methods that are compared."""

from nicmm_core import design

METHODS = tuple(method for method in design.METHODS if method != "nicmm")
"""Without "nicmm", which is another name of "nicmm-paper" for now."""
