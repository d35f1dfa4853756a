"""Words for names of figures, inputs, sources of error and checks."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

from alphacut.io.files import Document
from alphacut.io.units import fixed

_TABLES = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
FIGURES: dict[str, str] = _TABLES["figures"]
WORDS: dict[str, str] = _TABLES["words"]
INPUTS: dict[str, str] = _TABLES["inputs"]
"""Inputs of a structure by their symbols."""


def in_words(name: str) -> str:
    """Name in words; a hyphen or underscore becomes a space where there are none."""
    return WORDS.get(name, name.replace("_", " "))


def caption(stem: str, *, paper: bool) -> str:
    """Caption of a figure's file, with the paper's number where the case is the paper's."""
    found = re.fullmatch(r"(?:fig)?(\d+(?:-\d+)?)[-_](.+)", stem)
    number, name = (
        (" to ".join(str(int(n)) for n in found[1].split("-")), found[2]) if found else ("", stem)
    )
    words = figure_words(
        name if name.startswith(("envelope-", "update-")) else name.replace("_", "-")
    )
    if not (paper and number):
        return words
    return f"{'Figs.' if 'to' in number else 'Fig.'} {number}: {words}"


def figure_words(name: str) -> str:
    """Words for a figure without its number."""
    if match := re.fullmatch(r"envelope-(.+)-([^-]+)", name):
        return f"Envelope of {match[2]}" + ("" if match[1] == "all" else f", study {match[1]}")
    if name.startswith("exceedance-"):
        of = name.removeprefix("exceedance-").replace("-", " ")
        return f"Fuzzy probability that {of} exceeds a limit, over the limit"
    if name not in FIGURES and name.startswith("update-"):
        return f"Envelope of {name.removeprefix('update-')} before and after the measurement"
    return FIGURES.get(name, name.replace("-", " "))


def is_figure(stem: str) -> bool:
    """Whether a file of this name may be a figure of a run."""
    name = re.sub(r"^(fig)?\d+(-\d+)?[-_]", "", stem).replace("_", "-")
    return name in FIGURES or name.startswith(("envelope-", "update-", "exceedance-"))


def core(modulus: Document) -> str:
    """Modal value or core interval of a summary's fuzzy modulus, in GPa."""
    low, high = (float(modulus["E_GPa"][side][-1]) for side in ("lower", "upper"))
    if high - low <= 1e-9 * abs(high):
        return f"{fixed(modulus['modal_GPa'], 4)} GPa"
    return f"[{fixed(low, 4)}, {fixed(high, 4)}] GPa at α = {modulus['alpha'][-1]:g}"


def widest(modulus: Document) -> str:
    """What a summary calls the widest of its cuts: the support, or the cut of its first level."""
    return f"at α = {modulus['alpha'][0]:g}" if modulus["alpha"][0] else "support"
