"""Finds the course of a curve: candidates for every leg, combined, relaxed together and compared.

`course_surface` is the entry point; it prepares the surface on which `course_search` searches.
"""
