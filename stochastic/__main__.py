"""Run ``python -m stochastic microstructure CASE``, the same as ``alphacut microstructure``."""

import sys

from alphacut.entry import main

if __name__ == "__main__":
    sys.exit(main(program="python -m stochastic", names={"microstructure": "microstructure"}))
