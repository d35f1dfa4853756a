"""``python -m rve solve CASE``: one crisp cell; the same as ``alphacut cell``."""

import sys

from alphacut.entry import main

if __name__ == "__main__":
    sys.exit(main(program=f"python -m {__package__}", names={"solve": "cell"}))
