"""``python -m frame envelope CASE``: fuzzy forward dynamics; the same as ``alphacut envelope``."""

from alphacut.entry import leave, main

if __name__ == "__main__":
    leave(main(program=f"python -m {__package__}", names={"envelope": "envelope"}))
