"""The parser of the command line, whose complaints are problems like those of a case."""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from typing import NoReturn

from alphacut.io.problem import BadInput, Problem, suggestion

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
            close = suggestion(choice[1], known)
            raise BadInput.of("command", "", choice[1], ", ".join(known), close)
        raise BadInput.of(self.prog.removeprefix("alphacut "), f"{message}; see --help")

    def refuse(self, words: Sequence[str]) -> NoReturn:
        """Raises a problem for each word that is no option of this command."""
        known = [name for name in self._option_string_actions if name.startswith("--")]
        here = self.prog.removeprefix("alphacut ")
        raise BadInput(
            [
                Problem(
                    here, f"has no option {word}", "", ", ".join(known), suggestion(word, known)
                )
                for word in words
            ]
        )


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
