# SPDX-License-Identifier: GPL-3.0-or-later
"""The operators of buttons and scripts, and how they run."""
