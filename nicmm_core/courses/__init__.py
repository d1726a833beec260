"""Which course a curve takes: candidates for every leg, combined, relaxed together and compared.

`course_search` is the entry point.
"""
