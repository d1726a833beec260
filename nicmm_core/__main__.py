"""Runs the command line where the command ``nicmm`` is not installed: ``python -m nicmm_core``."""

import sys

from .commands import main

if __name__ == "__main__":
    sys.exit(main())
