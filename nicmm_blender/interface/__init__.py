# SPDX-License-Identifier: GPL-3.0-or-later
"""What users see in the sidebar and in menus."""
