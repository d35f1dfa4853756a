"""The front door: case files, units, command line, stages, report; logs below warnings."""

from typing import TYPE_CHECKING

from alphacut.base.first_use import at_first_use

if TYPE_CHECKING:
    from alphacut.entry import main

__all__ = ["main"]
AT_FIRST_USE = {"main": "entry"}
"""Module of each exported name that is imported at its first use: frames in Python need none."""

__getattr__, __dir__ = at_first_use(__name__, AT_FIRST_USE)
