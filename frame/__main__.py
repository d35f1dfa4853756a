"""``python -m frame envelope CASE``: fuzzy forward dynamics; the same as ``alphacut envelope``."""

import sys

from alphacut.entry import main

if __name__ == "__main__":
    sys.exit(main(program=f"python -m {__package__}", names={"envelope": "envelope"}))
