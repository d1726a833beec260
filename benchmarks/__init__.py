"""Benchmarks of the method: one module and one command per measurement; see `__main__`."""
