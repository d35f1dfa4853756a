"""Table of a case file's sections: one source for checks, JSON Schema, help and docs."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Annotated, Literal, get_args

from alphacut.case.key import Key, Range, Section, keys_of
from alphacut.case.sections import particles
from alphacut.case.sections.material import CellTable, Mesh, Modulus, Radius, Response
from alphacut.case.sections.questions import Decision, Update
from alphacut.case.sections.structures import Frame, Pendulum
from alphacut.case.sections.vibration import Envelope, Exceedance, Study

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


SECTIONS: dict[str, type[Section]] = {
    "": Top,
    "microstructure": particles.Microstructure,
    "microstructure.packing": particles.Packing,
    "microstructure.circles": particles.Circles,
    "microstructure.image": particles.Photograph,
    "microstructure.spheres": particles.PackedSpheres,
    "radius": Radius,
    "cell": CellTable,
    "mesh": Mesh,
    "modulus": Modulus,
    "response": Response,
    "frame": Frame,
    "pendulum": Pendulum,
    "study": Study,
    "envelope": Envelope,
    "exceedance": Exceedance,
    "update": Update,
    "decision": Decision,
}
# sections that a stage cannot do without
NEEDED = {
    "microstructure": ("microstructure",),
    "modulus": ("radius", "cell"),
    "image": ("cell",),
    "envelope": ("envelope",),
}
# sections that hold their defaults where they are left out and the other one is there
IMPLIED = {"mesh": "cell", "modulus": "cell"}


def dotted(section: str, key: str) -> str:
    """Full name of a key, ``cell.matrix_modulus``."""
    return f"{section}.{key}" if section else key


@cache
def every_key() -> dict[str, Key]:
    """All keys by their full names."""
    return {
        dotted(name, key): entry
        for name, section in SECTIONS.items()
        for key, entry in keys_of(section).items()
    }
