"""Run ``python -m fuzzy modulus`` or ``repair``, the same as those of ``alphacut``."""

import sys

from alphacut.entry import main

if __name__ == "__main__":
    sys.exit(main(program="python -m fuzzy", names={"modulus": "modulus", "repair": "repair"}))
