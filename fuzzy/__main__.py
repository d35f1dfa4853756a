"""Run ``python -m fuzzy modulus CASE``, the same as ``alphacut modulus``."""

import sys

from alphacut.entry import main

if __name__ == "__main__":
    sys.exit(main(program="python -m fuzzy", names={"modulus": "modulus"}))
