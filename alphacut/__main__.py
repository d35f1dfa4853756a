"""``alphacut …`` and ``python -m alphacut …``."""

import os
import sys

from alphacut.entry import main

__all__ = ["main"]
# Pydantic, which commands on cases import, looks for plugins in every installed distribution, and
# checks each schema that it makes itself: that takes .1 s, and this program wants neither.
os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
os.environ.setdefault("PYDANTIC_SKIP_VALIDATING_CORE_SCHEMAS", "1")
if __name__ == "__main__":
    sys.exit(main())
