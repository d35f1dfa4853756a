"""``python -m rve solve CASE`` is ``alphacut cell``."""

from alphacut.entry import leave, main

if __name__ == "__main__":
    names = {"solve": "cell"}
    leave(main(program=f"python -m {__package__}", names=names))
