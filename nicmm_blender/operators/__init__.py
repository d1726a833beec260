# SPDX-License-Identifier: GPL-3.0-or-later
"""The operators for buttons and scripts, and the code that runs them."""
