"""The front door: case files, units, command line, stages, report; logs as "alphacut", silently."""

import logging
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from alphacut.entry import main

__all__ = ["main"]
logging.getLogger(__name__).addHandler(logging.NullHandler())


def __getattr__(name: str) -> Any:
    """Return `main` at its first use (PEP 562): functions and frames in Python do without it."""
    if name == "main":
        from alphacut.entry import main

        return main
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
