"""A case: its sections as typed values in SI, and where they stand in the file."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Generic, TypeVar

from alphacut.case.key import Key, Section, UnknownValueError, keys_of
from alphacut.case.schema import Top
from alphacut.case.sections.material import Cell, Mesh, Modulus, Radius, Response
from alphacut.case.sections.particles import Microstructure
from alphacut.case.sections.picture import Picture
from alphacut.case.sections.questions import Decision, Update
from alphacut.case.sections.structures import Frame, Pendulum
from alphacut.case.sections.vibration import Envelope, Exceedance, Study
from alphacut.io.problem import BadInput, Problem
from alphacut.io.provenance import digest, door

S = TypeVar("S", bound=Section)
WHOLE = "levels that begin at 0 and end at 1, or 1 alone for one number"


@dataclass(frozen=True, kw_only=True)
class Sections:
    """The sections of a case; None where the file has none.

    The file's section [cell] is a round particle, `cell`, or a `picture`.
    """

    top: Top
    microstructure: Microstructure | None = None
    radius: Radius | None = None
    cell: Cell | None = None
    picture: Picture | None = None
    mesh: Mesh | None = None
    modulus: Modulus | None = None
    response: Response | None = None
    frame: Frame | None = None
    pendulum: Pendulum | None = None
    study: tuple[Study, ...] = ()
    envelope: Envelope | None = None
    exceedance: Exceedance | None = None
    update: Update | None = None
    decision: Decision | None = None

    @property
    def files(self) -> tuple[Section, ...]:
        """The sections that may name files, in the order of the fields."""
        every = (getattr(self, field.name) for field in fields(self))
        return tuple(section for section in every if isinstance(section, Section))


class Needed(Generic[S]):
    """A section of a case that its reader cannot do without.

    Raises:
        BadInput: The file has no such section.
    """

    def __set_name__(self, owner: type[Case], name: str) -> None:
        """Keep the section's name."""
        self.name = name

    def __get__(self, case: Case, owner: type[Case]) -> S:
        """The section of a case."""
        found: S | None = getattr(case.sections, self.name)
        if found is None:
            raise case.without(self.name)
        return found


@dataclass(frozen=True)
class Case:
    """A checked case; a section by its name, such as `case.radius.theta`.

    Args:
        path: File it came from.
        sections: The sections that the file has; keys that were left out hold their default.
        written: Full key name to what the user wrote, for messages and reports.
        lines: Full key name to its line in the file.
        changed: Full names of the keys that the command line changed.
        broken: Full names of keys whose values are wrong, while the case is being checked.
    """

    path: Path
    sections: Sections
    written: Mapping[str, object]
    lines: Mapping[str, int]
    changed: frozenset[str] = frozenset()
    broken: frozenset[str] = frozenset()

    microstructure = Needed[Microstructure]()
    radius = Needed[Radius]()
    cell = Needed[Cell]()
    picture = Needed[Picture]()
    mesh = Needed[Mesh]()
    modulus = Needed[Modulus]()
    response = Needed[Response]()
    frame = Needed[Frame]()
    pendulum = Needed[Pendulum]()
    envelope = Needed[Envelope]()
    exceedance = Needed[Exceedance]()
    update = Needed[Update]()
    decision = Needed[Decision]()

    @property
    def name(self) -> str:
        """The file's name without its ending: results go to results/NAME."""
        return self.path.stem

    @property
    def top(self) -> Top:
        """What stands above the first section: title, stages."""
        return self.sections.top

    @property
    def stages(self) -> tuple[str, ...]:
        """The stages that a run computes, in order."""
        return self.sections.top.stages

    @property
    def is_paper(self) -> bool:
        """Whether studies name figures of the paper."""
        return any(study.figures for study in self.sections.study)

    @property
    def text_of_file(self) -> str:
        """The file as it stands."""
        return self.path.read_text(encoding="utf-8-sig")

    def beside(self, name: str) -> Path:
        """A file that the case names, looked for from the case's folder."""
        return self.path.parent / name

    def digests(self, *sections: Section | None) -> list[str]:
        """Digests of the files that sections name: results depend on their content."""
        return [
            hashlib.sha256(self.beside(name).read_bytes()).hexdigest()
            for section in sections
            if section is not None
            for _, name in files_of(section)
        ]

    def traces(self, *names: str) -> dict[str, str]:
        """Digest of each section, by default of all, and of the files it names; "" of none."""
        every = {field.name: getattr(self.sections, field.name) for field in fields(Sections)}
        names = names or tuple(name for name in every if name not in ("top", "study"))
        given = {name: every[name] for name in names}
        return {k: digest([x, self.digests(x)]) if x else "" for k, x in given.items()}

    def asked(self, key: str) -> bool:
        """Whether the file or the command line gives the key, so that no default stands in."""
        if key in self.broken:
            raise UnknownValueError(key)
        return key in self.written

    @property
    def names_mesh(self) -> bool:
        """Whether the case names the mesh that its model of the cell is to have."""
        return any(self.asked(f"mesh.{name}") for name in keys_of(Mesh))

    @property
    def names_particles(self) -> bool:
        """Whether the case says of what kind its particles are."""
        return self.asked("cell.particles")

    @property
    def words(self) -> str:
        """Every text that the case gives."""
        return " ".join(str(value) for value in self.written.values() if isinstance(value, str))

    @property
    def modulus_tolerance(self) -> float | None:
        """Relative tolerance on E that is asked for; None where the case names none."""
        return self.modulus.tolerance if self.asked("modulus.tolerance") else None

    @property
    def stand_ins(self) -> dict[str, object]:
        """What stands in for the computed modulus, by its full key."""
        given = self.sections.modulus
        if given is None:
            return {}
        found = {
            "modulus.value": given.value,
            "modulus.file": given.file,
            "modulus.measured": given.measured,
        }
        return {key: value for key, value in found.items() if value is not None}

    @property
    def computes_modulus(self) -> bool:
        """Whether a stage computes the modulus that its structure takes over."""
        return not self.stand_ins and bool({"modulus", "image"} & set(self.stages))

    def without(self, section: str) -> BadInput:
        """The error of a command that cannot do without a section."""
        if section in ("cell", "radius") and (given := next(iter(self.stand_ins), "")):
            what = "this gives the modulus, and the command computes one from [radius] and [cell]"
            taken = f", or {door('envelope', self.path)}, which takes it"
            allowed = "both sections beside it" + taken * ("envelope" in self.stages)
            return self.refuse(given, what, allowed)
        what = f"missing; this command needs section [{section}]"
        if section == "picture":
            section, what = "cell", "missing; this command needs section [cell] with a picture"
        if section in ("cell", "radius") and self.sections.picture:
            what = "missing; the cell is a picture, whose modulus command image computes"
        if section == "radius" and "microstructure" in self.stages:
            what += (
                f": {door('microstructure', self.path)} --out particles makes it from the"
                " particles, in particles/radius.toml"
            )
        return BadInput.of(section, what, file=str(self.path))

    def problem(self, key: str, what: str, allowed: str = "") -> Problem:
        """The problem of a key, with the value that is written for it."""
        value = self.written.get(key)
        return Problem(key, what, "" if value is None else str(value), allowed)

    def refuse(self, key: str, what: str, allowed: str = "") -> BadInput:
        """The error for a key whose value cannot be used after all."""
        return BadInput(self.located(self.problem(key, what, allowed)))

    def located(self, problem: Problem) -> Problem:
        """The problem with its file and line; a missing key points at its section."""
        key = problem.key
        if key in self.changed:
            return replace(problem, file="command line", line=0)
        line = self.lines.get(key) or self.lines.get(key.rpartition(".")[0]) or 0
        return replace(problem, file=str(self.path), line=line)

    def told(self, section: str) -> Iterator[tuple[str, Key, object]]:
        """Name, key and text of what the file gives in a section."""
        found = getattr(self.sections, section)
        for name, key in keys_of(type(found)).items() if found is not None else ():
            if (text := self.written.get(f"{section}.{name}")) is not None:
                yield name, key, text


def files_of(section: Section) -> Iterator[tuple[str, str]]:
    """Key and name of each file that a section, or a section inside it, names."""
    keys = keys_of(type(section))
    for field in fields(section):
        value = getattr(section, field.name)
        if isinstance(value, Section):
            yield from ((f"{field.name}.{key}", name) for key, name in files_of(value))
        elif field.name in keys and keys[field.name].file and value is not None:
            yield field.name, str(value)
