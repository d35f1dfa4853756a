"""What `./enter` shows of the machine, so that a message of a missing file can say so."""

from __future__ import annotations

import os
from pathlib import Path

INSIDE = "ALPHACUT_INSIDE"
"""Environment variable that `./enter` sets; to "apart" where it shows a few folders alone."""
PROJECT = Path(__file__).resolve().parents[2]


def unseen(path: Path) -> str:
    """Return a sentence if a path lies where `./enter` shows nothing of the machine; else ""."""
    from tempfile import gettempdir  # which costs the first record of a process 4 ms

    seen = [PROJECT, Path.cwd(), Path.home(), Path(gettempdir()), Path("/tmp")]
    place = path.absolute()
    if os.environ.get(INSIDE) != "apart" or any(place.is_relative_to(folder) for folder in seen):
        return ""
    return (
        "it may be there unseen: ./enter shows the project, the current folder, home and the"
        " temporary folder alone"
    )
