"""Results that somebody else may have made: nothing of them is believed that could do harm.

Figures are PNG files inside the folder `figures` of the results, texts have no control characters
and are cut, and names lead to no other folder.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from alphacut.io.files import Document

MOST = 200
"""Characters of a text that are shown."""
WHOLE = ("about", "case_text", "command")
"""Texts that are shown whole."""
MOST_WHOLE = 100_000
NAME = re.compile(r"[\w+-][\w.+-]{0,100}")


def cleaned(summary: Document) -> Document:
    """The summary with texts that can be shown."""
    return {
        _text(key, MOST): _value(value, MOST_WHOLE if key in WHOLE else MOST)
        for key, value in summary.items()
    }


def _value(value: object, most: int) -> object:
    if isinstance(value, str):
        return _text(value, most)
    if isinstance(value, dict):
        return {_text(key, MOST): _value(entry, most) for key, entry in value.items()}
    return [_value(entry, most) for entry in value] if isinstance(value, list) else value


def _text(value: str, most: int) -> str:
    kept = "".join(c if c.isprintable() or c == "\n" else " " for c in value[: 2 * most])
    return kept if len(kept) <= most else f"{kept[: most - 1]}…"


def figures(summary: Document, folder: Path) -> Iterator[tuple[str, Path]]:
    """Stem and PNG of each figure that the summary names, and that lies in the folder's figures."""
    home = (folder / "figures").resolve()
    for name in map(str, summary.get("figures", ())):
        path = folder / name
        plain = NAME.fullmatch(Path(name).name) and path.suffix == ".png"
        if plain and path.resolve().parent == home and path.is_file():
            yield path.stem, path


def plain_name(name: str) -> bool:
    """True of a name that stands for a file in its folder and leads to no other."""
    return bool(NAME.fullmatch(name)) and ".." not in name
