"""The parser of the command line, whose complaints are problems like those of a case."""

from __future__ import annotations

import argparse
import re
from collections.abc import Mapping, Sequence
from typing import NoReturn

from alphacut.case.schema import every_key
from alphacut.case.values import nearest
from alphacut.io.problem import BadInput, Problem

PETSC_PREFIX = "-rve_"


class Parser(argparse.ArgumentParser):
    """An argument parser whose complaints are one line, like those about a case."""

    def error(self, message: str) -> NoReturn:
        """Raise instead of printing usage and leaving."""
        raise BadInput(self.complaint(message))

    def complaint(self, message: str) -> Problem:
        """A complaint of argparse in this project's words."""
        if match := re.match(
            r"argument COMMAND: invalid choice: '(.*?)' \(choose from (.*)\)", message
        ):
            known = [name.strip(" '") for name in match[2].split(",")]
            return Problem(
                "command",
                "there is no such command",
                match[1],
                f"{', '.join(known)}; see --help",
                nearest(match[1], known),
            )
        if match := re.match(r"argument (\S+): invalid int value: '(.*)'", message):
            return Problem(
                match[1], "this is no whole number", match[2], "a whole number such as 2"
            )
        return Problem(
            self.prog.removeprefix("alphacut ") if self.prog != "alphacut" else "command line",
            f"{message}; see --help",
        )

    def stranger(self, word: str, known: Sequence[str]) -> Problem:
        """The problem of a word that is no option, with what was meant."""
        here, what = self.prog.removeprefix("alphacut "), f"there is no such option: {word}"
        if not word.startswith("-"):
            return Problem(
                here,
                "there is one argument too many",
                word,
                "one case; other values stand behind their options",
            )
        if re.match(r"-(ksp|pc|mat|snes|mg|sub|log|options)_", word):
            return Problem(
                here, what, allowed=f"PETSc's options with their prefix: {PETSC_PREFIX}{word[1:]}"
            )
        key = word.partition("=")[0].removeprefix("--").replace("-", "_")
        full = [name for name in every_key() if name.rpartition(".")[2] == key]
        if full:
            return Problem(here, what, allowed=" or ".join(f"--set {name}=VALUE" for name in full))
        close = nearest(word.partition("=")[0], known)
        return Problem(here, what, allowed="" if close else ", ".join(known), nearest=close)

    def refuse(self, words: Sequence[str]) -> NoReturn:
        """Complain about words that are no options of this command, with the nearest that is."""
        known = [name for name in self._option_string_actions if name.startswith("--")]
        raise BadInput([self.stranger(word, known) for word in words])


def refuse_petsc(command: str, petsc: Mapping[str, str]) -> None:
    """Refuse PETSc's options with a command that solves nothing with PETSc."""
    if petsc and command not in ("cell", "image", "modulus", "run"):
        allowed = "with the commands cell, image, modulus and run"
        raise BadInput(
            [
                Problem(
                    f"{PETSC_PREFIX}{name}",
                    f"command {command} does not use PETSc",
                    allowed=allowed,
                )
                for name in petsc
            ]
        )


def split_petsc(arguments: Sequence[str]) -> tuple[list[str], dict[str, str]]:
    """Take PETSc's own options (``-rve_ksp_rtol 1e-10``) out of a command line."""
    ours: list[str] = []
    petsc: dict[str, str] = {}
    rest = list(arguments)
    while rest:
        word = rest.pop(0)
        if not word.startswith(PETSC_PREFIX):
            ours.append(word)
            continue
        takes_value = (
            bool(rest) and not re.match(r"--?[A-Za-z_]", rest[0]) and not rest[0].endswith(".toml")
        )
        petsc[word.removeprefix(PETSC_PREFIX)] = rest.pop(0) if takes_value else ""
    return ours, petsc
