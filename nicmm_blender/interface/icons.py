# SPDX-License-Identifier: GPL-3.0-or-later
"""Icons of the operators, shared by panels and menus."""

DESIGN = "CURVE_BEZCIRCLE"
EDIT = "CURVE_PATH"
NEXT_COURSE = "FRAME_NEXT"
CONVERT = "MOD_EDGESPLIT"
PARALLEL = "MOD_OFFSET"
STROKES = "GREASEPENCIL"
