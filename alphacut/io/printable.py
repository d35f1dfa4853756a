"""Text from outside, made fit for a terminal."""

from __future__ import annotations

MOST = 200
"""Characters of a value that a message shows."""


def printable(text: object, most: int = MOST) -> str:
    """The text on one line without control characters, and at most `most` characters of it."""
    line = " ".join("".join(c if c.isprintable() else " " for c in str(text)[: 4 * most]).split())
    return line if len(line) <= most else f"{line[: most - 1]}…"
