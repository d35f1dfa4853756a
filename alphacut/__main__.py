"""``alphacut …`` and ``python -m alphacut …``."""

import sys

from alphacut.entry import main

__all__ = ["main"]
if __name__ == "__main__":
    sys.exit(main())
