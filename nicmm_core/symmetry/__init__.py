"""Symmetric curves: each is its own mirror image in a plane (`geometry.mirror`).

`symmetric_request` adds the mirror images of points and maps to a request. `halves` makes symmetric
curves of curves that are not, and `symmetric_relaxation` relaxes them. `half_search` finds a start
if no curve through all points has a half on one side of the plane.
"""
