"""Run ``python -m stochastic microstructure CASE``, the same as ``alphacut microstructure``."""

from alphacut.entry import leave, main

if __name__ == "__main__":
    leave(main(program=f"python -m {__package__}", names={"microstructure": "microstructure"}))
