"""Problems of an input, one line each, and the exception that carries them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Self


@dataclass(frozen=True)
class Problem:
    """One thing wrong with a case file or a command line.

    Args:
        key: Name of the key or option, for example ``cell.matrix_modulus``.
        what: What is wrong, without a full stop.
        value: The value got, as the user wrote it; empty where there is none.
        allowed: What is allowed instead.
        nearest: The known name that comes nearest to an unknown one.
        file: Case file; empty for a command line.
        line: Line in the file, from 1; 0 where it is not known.
    """

    key: str
    what: str
    value: str = ""
    allowed: str = ""
    nearest: str = ""
    file: str = ""
    line: int = 0

    def __str__(self) -> str:
        place = f"{self.file}:{self.line}: " if self.line else f"{self.file}: " if self.file else ""
        text = f"{place}{self.key}" + (f" = {self.value}" if self.value else "") + f": {self.what}"
        text += f"; allowed: {self.allowed}" if self.allowed else ""
        text += f"; did you mean {self.nearest}?" if self.nearest else ""
        return " ".join(text.split())


class BadInput(Exception):  # noqa: N818 - it names the input, not the program, as the culprit
    """The input cannot be used; carries every problem found, each one line long."""

    def __init__(self, problems: Problem | Sequence[Problem]) -> None:
        self.problems = (problems,) if isinstance(problems, Problem) else tuple(problems)
        super().__init__("\n".join(map(str, self.problems)))

    @classmethod
    def of(
        cls,
        key: str,
        what: str,
        value: str = "",
        allowed: str = "",
        nearest: str = "",
        *,
        file: str = "",
        line: int = 0,
    ) -> Self:
        """The error of one problem, from its fields."""
        return cls(Problem(key, what, value, allowed, nearest, file, line))


def refuse(problems: Iterable[Problem]) -> None:
    """Raise the problems, where there are any.

    Raises:
        BadInput: There are.
    """
    if found := tuple(problems):
        raise BadInput(found)


EXTRAS = {"skimage": "particles", "gmsh": "mesh", "meshio": "mesh", "h5py": "mesh"}


def missing(error: ImportError) -> str:
    """Message for an import that failed, with its cure."""
    library = (error.name or "").partition(".")[0]
    if library in EXTRAS:
        cure = f"pip install '.[{EXTRAS[library]}]' in a checkout, or run inside ./enter"
    else:
        cure = (
            "DOLFINx and its libraries are in no Python index: run inside ./enter of a checkout, or"
            " install Debian 13's python3-dolfinx or conda-forge's fenics-dolfinx"
        )
    return f"{error}; {cure}"
