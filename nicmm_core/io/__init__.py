"""Readers of mesh files: bytes in, arrays out, and a `FormatError` for anything else.

Nothing here trusts a count that a file states: memory and time follow the size of the file.
"""
