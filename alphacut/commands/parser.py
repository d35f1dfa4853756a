"""The parser of the command line, whose complaints are problems like those of a case."""

from __future__ import annotations

import argparse
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NoReturn

from alphacut.fuzzy.refused import RefusedError, require
from alphacut.io.problem import BadInput, Problem, suggestion

if TYPE_CHECKING:
    from alphacut.case.content import Content

PETSC_PREFIX = "-rve_"


class Parser(argparse.ArgumentParser):
    """An argument parser that raises in place of printing its usage and leaving."""

    def error(self, message: str) -> NoReturn:
        """Raises the complaint of argparse as a problem."""
        choice = re.match(
            r"argument COMMAND: invalid choice: '(.*?)' \(choose from (.*)\)", message
        )
        if choice:
            known = [name.strip(" '") for name in choice[2].split(",")]
            raise RefusedError("command", choice[1], ", ".join(known), suggestion(choice[1], known))
        raise BadInput(Problem(self.prog.removeprefix("alphacut "), f"{message}; see --help"))

    def refuse(self, word: str) -> NoReturn:
        """Raises the problem of a word that is no option of this command."""
        known = [name for name in self._option_string_actions if name.startswith("--")]
        allowed, cure = ", ".join(known), suggestion(word, known)
        raise RefusedError(f"{self.prog.removeprefix('alphacut ')}: option", word, allowed, cure)


def split_petsc(arguments: Sequence[str]) -> tuple[list[str], dict[str, str]]:
    """Options of PETSc (``-rve_ksp_rtol 1e-10``) apart from those of the program."""
    ours: list[str] = []
    petsc: dict[str, str] = {}
    rest = list(arguments)
    while rest:
        word = rest.pop(0)
        if not word.startswith(PETSC_PREFIX):
            ours.append(word)
            continue
        has_value = bool(rest) and not re.match(r"--?[A-Za-z_]", rest[0])
        has_value = has_value and not rest[0].endswith(".toml")
        petsc[word.removeprefix(PETSC_PREFIX)] = rest.pop(0) if has_value else ""
    return ours, petsc


def require_prism(petsc: Mapping[str, str], content: Content | None = None) -> None:
    """Refuses PETSc options where no prism elements are solved.

    Args:
        petsc: The options, without their prefix.
        content: The case; None for a command that solves no cell.

    Raises:
        RefusedError: There are such options.
    """
    prism = content is not None and content.round and content.modulus.method == "prism"
    option = PETSC_PREFIX + next(iter(petsc), "")
    allowed = "options of run, cell, modulus with method prism"
    require(bool(prism or not petsc), option, "PETSc's", allowed)
