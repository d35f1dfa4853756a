"""Run ``python -m stochastic microstructure CASE``, the same as ``alphacut microstructure``."""

import sys

from alphacut.entry import main

if __name__ == "__main__":
    sys.exit(main(program=f"python -m {__package__}", names={"microstructure": "microstructure"}))
