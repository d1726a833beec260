# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads meshes from Blender, and reads and writes the design record of curve objects."""
