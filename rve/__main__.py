"""``python -m rve solve CASE`` is ``alphacut cell``, ``python -m rve image CASE`` its ``image``."""

import sys

from alphacut.entry import main

if __name__ == "__main__":
    names = {"solve": "cell", "image": "image"}
    sys.exit(main(program=f"python -m {__package__}", names=names))
