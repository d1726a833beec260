# SPDX-License-Identifier: GPL-3.0-or-later
"""What becomes of a curve: objects, and changes of its mesh."""
