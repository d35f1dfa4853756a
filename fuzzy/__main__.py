"""Run ``python -m fuzzy modulus`` or ``repair``, the same as those of ``alphacut``."""

import sys

from alphacut.entry import main

if __name__ == "__main__":
    commands = {"modulus": "modulus", "repair": "repair"}
    sys.exit(main(program=f"python -m {__package__}", names=commands))
