"""Keys at the head of a case file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal, get_args

from alphacut.case.key import Key, Range, Section

VERSION = 1
Stage = Literal["microstructure", "modulus", "image", "envelope"]
STAGES: tuple[str, ...] = get_args(Stage)
KNOWN_VERSION = Range(f"equal to {VERSION}", lower=VERSION, upper=VERSION, closed=True)


@dataclass(frozen=True, kw_only=True, slots=True)
class Top(Section):
    """What the case is."""

    schema: Annotated[int, Key("version of the case format", allowed=KNOWN_VERSION)]
    title: Annotated[str, Key("one line, for figures and the report")]
    about: Annotated[str, Key("a paragraph: what the case shows")]
    source: Annotated[str, Key("where the values come from")] = ""
    stages: Annotated[tuple[Stage, ...], Key("stages that `alphacut run` computes, in order")]
