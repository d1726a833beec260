# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether an object is in a view layer."""


def is_in(view_layer, candidate) -> bool:
    """Whether a view layer contains an object; one of a library may have the same name."""
    objects = view_layer.objects
    return candidate.name in objects and any(each == candidate for each in objects)
