"""``python -m rve solve CASE`` is ``alphacut cell``."""

import sys

from alphacut.__main__ import main

if __name__ == "__main__":
    sys.exit(main(program=f"python -m {__package__}", names={"solve": "cell"}))
