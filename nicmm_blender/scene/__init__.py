# SPDX-License-Identifier: GPL-3.0-or-later
"""What is read from Blender's data, and what a curve object keeps of its design."""
