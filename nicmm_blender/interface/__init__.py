# SPDX-License-Identifier: GPL-3.0-or-later
"""The sidebar panels and the menu entries."""
