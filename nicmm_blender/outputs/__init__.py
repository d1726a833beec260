# SPDX-License-Identifier: GPL-3.0-or-later
"""The outputs of a curve: new objects, and changes of its mesh."""
