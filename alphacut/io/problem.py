"""Problems of an input, one line each, and the exception that carries them."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Self

from alphacut.fuzzy.refused import RefusedError, fit_message, printable


@dataclass(frozen=True)
class InputProblem:
    """One thing wrong with a case file or a command line.

    Args:
        key: Name of the key or option, such as ``cell.matrix_modulus``.
        what: Statement of what is wrong; empty where `value` and `allowed` say it.
        cure: Advice where `allowed` does not give it.
        file: Case file; empty for a command line.
        line: Line in the file, from 1; 0 where it is not known.
    """

    key: str
    what: str = ""
    value: str = ""
    allowed: str = ""
    cure: str = ""
    file: str = ""
    line: int = 0

    @classmethod
    def from_error(cls, error: RefusedError) -> Self:
        """The problem of a value that a constructor refused."""
        value = "" if error.value is None else printable(error.value)
        what = "is missing" if error.value is None else ""
        return cls(error.key, what, value, error.allowed, error.cure)

    def __str__(self) -> str:
        """The problem as one line: ``FILE:LINE: KEY is VALUE; allowed: ALLOWED; CURE``."""
        location = f"{self.file}:{self.line}" if self.line else self.file

        def line(value: str, allowed: str) -> str:
            """The line without the cure; `fit_message` shortens both texts."""
            text = f"{location}: {self.key}" if location else self.key
            text += f" is {value}" if value else ""
            if self.what:
                text += f": {self.what}" if value else f" {self.what}"
            return f"{text}; allowed: {allowed}" if allowed else text

        return fit_message(
            printable(self.value), printable(self.allowed), line, printable(self.cure)
        )


class BadInput(Exception):  # noqa: N818 - it names the input, not the program, as the culprit
    """An input that cannot be used; carries every problem of it."""

    def __init__(self, problems: InputProblem | Sequence[InputProblem]) -> None:
        self.problems = (problems,) if isinstance(problems, InputProblem) else tuple(problems)
        super().__init__("\n".join(map(str, self.problems)))


def nearest(name: str, names: Iterable[str]) -> str:
    """The known name that comes nearest to `name`; empty if none comes near."""
    folded = {option.lower(): option for option in names}
    close = get_close_matches(name.lower().replace("-", "_"), folded, n=1, cutoff=0.6)
    return folded[close[0]] if close else ""


def suggestion(name: str, names: Iterable[str]) -> str:
    """Words on the known name that comes nearest; empty if none comes near."""
    return f"did you mean {close}?" if (close := nearest(name, names)) else ""


INSIDE = "ALPHACUT_INSIDE"
"""Variable that ./enter sets."""
ELEMENTS = ("dolfinx", "petsc4py", "mpi4py", "basix", "ufl", "cffi", "gmsh", "meshio", "h5py")
EXTRAS = {"skimage": "particles", **dict.fromkeys(ELEMENTS, "cell")}


def missing(error: ImportError) -> str:
    """Message for an import that failed, with its cure."""
    library = (error.name or "").partition(".")[0]
    cure = f"pip install '.[{EXTRAS[library]}]'" if library in EXTRAS else f"install {library}"
    return f"{error}; {cure}" + ("" if os.environ.get(INSIDE) else ", or run inside ./enter")
