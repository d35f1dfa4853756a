"""``alphacut …`` and ``python -m alphacut …``."""

import atexit
import gc
import sys

gc.disable()  # what is imported is no garbage; `main` enables it when all is
atexit.register(gc.freeze)  # nor is it searched at the end, which takes .3 s

from alphacut.entry import main  # noqa: E402

__all__ = ["main"]
if __name__ == "__main__":
    sys.exit(main())
