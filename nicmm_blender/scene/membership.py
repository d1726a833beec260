# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests whether an object is in a view layer."""


def is_in(view_layer, candidate) -> bool:
    """Whether a view layer contains an object.

    The name alone does not tell: an object linked from a library may have the same name.
    """
    objects = view_layer.objects
    named = objects.get(candidate.name)
    return named == candidate or (named is not None and any(each == candidate for each in objects))
