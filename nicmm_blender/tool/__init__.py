# SPDX-License-Identifier: GPL-3.0-or-later
"""The tool that draws and edits curves with the mouse."""
