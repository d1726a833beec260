"""Measurements of the method, one command a result; see `__main__`."""
