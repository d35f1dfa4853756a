"""Run ``python -m fuzzy modulus`` or ``repair``, the same as those of ``alphacut``."""

from alphacut.entry import leave, main

if __name__ == "__main__":
    commands = {"modulus": "modulus", "repair": "repair"}
    leave(main(program=f"python -m {__package__}", names=commands))
