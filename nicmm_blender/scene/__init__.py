# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads Blender's data, and the record of its design in a curve object."""
