"""Reads and writes mesh files, and writes curves.

`files` has the functions for callers. The other modules convert between files and arrays, one
module for each format that is read. Readers raise `FormatError` for invalid files. They check the
counts in a file, so memory and time are bounded by the size of the file.
"""
