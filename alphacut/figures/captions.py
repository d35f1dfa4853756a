"""Captions of figures, and words for names of inputs, sources of error and checks."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

from alphacut.case.content import QUESTIONS

_TABLES = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
FIGURES: dict[str, str] = _TABLES["figures"] | {one.key: one.caption for one in QUESTIONS}
WORDS: dict[str, str] = _TABLES["words"]
INPUTS: dict[str, str] = _TABLES["inputs"]
"""Inputs of a structure by their symbols."""


def in_words(name: str) -> str:
    """Name in words; an underscore becomes a space where there are none."""
    return WORDS.get(name, name.replace("_", " "))


def caption(stem: str, *, paper: bool) -> str:
    """Caption of a figure's file, with the paper's number where the case is the paper's."""
    parts = re.fullmatch(r"(?:fig)?(\d+(?:-\d+)?)[-_](.+)", stem)
    number, name = (parts[1], parts[2]) if parts else ("", stem)
    if match := re.fullmatch(r"envelope-(.+)-([^-]+)", name):
        words = f"Envelope of {match[2]}" + ("" if match[1] == "all" else f", study {match[1]}")
    else:
        words = FIGURES.get(name.replace("_", "-"), name.replace("-", " "))
    if not (paper and number):
        return words
    ends = [str(int(end)) for end in number.split("-")]
    return f"{'Figs.' if len(ends) > 1 else 'Fig.'} {' to '.join(ends)}: {words}"
