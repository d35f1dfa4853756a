"""A case: every value checked and in SI, by its full name."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import cast

from alphacut.case.schema_image import PICTURES
from alphacut.fuzzy import FuzzyNumber
from alphacut.io.problem import BadInput, Problem


@dataclass(frozen=True)
class Case:
    """A checked case.

    Args:
        path: File it came from.
        values: Full key name to value, in SI; keys that were left out hold their default.
        written: Full key name to what the user wrote, for reports.
        lines: Full key name to its line in the file.
        changed: Full names of the keys that the command line changed.
    """

    path: Path
    values: Mapping[str, object]
    written: Mapping[str, object]
    lines: Mapping[str, int]
    changed: frozenset[str] = frozenset()

    @property
    def name(self) -> str:
        """The file's name without its ending: results go to results/NAME."""
        return self.path.stem

    @property
    def quoted(self) -> Path | None:
        """File of the numbers that a paper quotes for this case; None for a case of one's own."""
        path = self.path.with_suffix(".quoted.toml")
        return path if path.is_file() else None

    @property
    def text_of_file(self) -> str:
        """The file as it stands."""
        return self.path.read_text(encoding="utf-8-sig")

    def digest(self, key: str) -> str:
        """Digest of a file that the case names: results depend on its content."""
        return hashlib.sha256((self.path.parent / self.text(key)).read_bytes()).hexdigest()

    @property
    def stages(self) -> tuple[str, ...]:
        """The stages that a run computes, in order."""
        return cast(tuple[str, ...], self.values["stages"])

    def has(self, key: str) -> bool:
        """True if the key holds a value."""
        return self.values.get(key) is not None

    def asked(self, key: str) -> bool:
        """Whether the file or the command line gives the key, so that no default stands in."""
        return key in self.written

    def need(self, key: str) -> object:
        """The value of a key that this command cannot do without."""
        if not self.has(key):
            section = key.rpartition(".")[0]
            what = f"missing; this command needs section [{section}]"
            if section in ("cell", "radius") and any(self.has(f"cell.{k}") for k in PICTURES):
                what = "missing; the cell is a picture, whose modulus command image computes"
            if section == "radius" and "microstructure" in self.stages:
                what += (
                    f": alphacut microstructure {self.path.name} --out FOLDER makes it from the"
                    " particles, in FOLDER/radius.toml"
                )
            raise BadInput(Problem(key, what, file=str(self.path)))
        return self.values[key]

    def fuzzy(self, key: str) -> FuzzyNumber:
        """A crisp or fuzzy quantity."""
        return cast(FuzzyNumber, self.need(key))

    def fuzzies(self, key: str) -> tuple[FuzzyNumber, ...]:
        """An array of crisp or fuzzy quantities."""
        return cast(tuple[FuzzyNumber, ...], self.need(key))

    def number(self, key: str) -> float:
        """A crisp number."""
        return cast(float, self.need(key))

    def numbers(self, key: str) -> tuple[float, ...]:
        """An array of crisp numbers."""
        return cast(tuple[float, ...], self.need(key))

    def integer(self, key: str) -> int:
        """A whole number."""
        return cast(int, self.need(key))

    def text(self, key: str) -> str:
        """Text or a choice."""
        return cast(str, self.need(key))

    def names(self, key: str) -> tuple[str, ...]:
        """An array of names."""
        return cast(tuple[str, ...], self.need(key))

    def refuse(self, key: str, what: str, allowed: str = "") -> BadInput:
        """The error for a key whose value cannot be used after all."""
        value = self.written.get(key)
        return BadInput(
            Problem(
                key,
                what,
                "" if value is None else str(value),
                allowed,
                file=str(self.path),
                line=self.lines.get(key, 0),
            )
        )

    def with_values(self, **sections: Mapping[str, object]) -> Case:
        """A copy with other values, already checked: ``with_values(radius={"a2": …})``."""
        changed = {
            f"{name}.{key}": value
            for name, section in sections.items()
            for key, value in section.items()
        }
        return replace(self, values={**self.values, **changed})
