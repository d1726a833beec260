# SPDX-License-Identifier: GPL-3.0-or-later
"""Icons of the operators, shared by panels and menus."""

DESIGN = "CURVE_BEZCIRCLE"
EDIT = "CURVE_PATH"
CONVERT = "MOD_EDGESPLIT"
