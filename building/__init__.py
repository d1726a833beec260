"""What `build.py` does: environment, checks, packages, site and releases.

These modules need only the standard library of Python 3.11; everything else runs in `.venv/`.
"""
