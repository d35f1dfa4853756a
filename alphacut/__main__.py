"""``alphacut …`` and ``python -m alphacut …``."""

from alphacut.entry import leave, main

if __name__ == "__main__":
    leave(main())
