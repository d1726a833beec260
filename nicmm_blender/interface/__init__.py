# SPDX-License-Identifier: GPL-3.0-or-later
"""The sidebar and the menu entries."""
