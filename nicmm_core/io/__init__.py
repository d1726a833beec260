"""Readers of mesh files: they convert bytes to arrays and raise `FormatError` for invalid files.

Counts in a file are checked, so that memory and time are bounded by the size of the file.
"""
