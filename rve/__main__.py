"""``python -m rve solve CASE`` is ``alphacut cell``, ``python -m rve image CASE`` its ``image``."""

from alphacut.entry import leave, main

if __name__ == "__main__":
    names = {"solve": "cell", "image": "image"}
    leave(main(program=f"python -m {__package__}", names=names))
