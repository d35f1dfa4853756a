"""Options that the commands share, and how they change a case."""

from __future__ import annotations

import argparse
import re
from collections.abc import Mapping, Sequence
from typing import NoReturn

from alphacut.case.schema import every_key
from alphacut.case.values import nearest
from alphacut.io.problem import BadInput, Problem
from alphacut.io.units import QUANTITIES

RADIUS_OPTIONS = {f"--{name}": f"radius.{name}" for name in ("a1", "a2", "a3", "a4")}
CELL_OPTIONS = {
    **RADIUS_OPTIONS,
    "--matrix-modulus": "cell.matrix_modulus",
    "--matrix-poisson": "cell.matrix_poisson",
    "--inclusion-modulus": "cell.inclusion_modulus",
    "--inclusion-poisson": "cell.inclusion_poisson",
    "--layers": "mesh.layers",
    "--mesh-size": "mesh.size",
    "--interface": "mesh.interface",
    "--method": "modulus.method",
    "--tolerance": "modulus.tolerance",
}
PETSC_PREFIX = "-rve_"
METAVARS = {"integer": "INTEGER", "choice": "CHOICE", "choices": "NAMES", "numbers": "LIST"}
FORMS = {"numbers": ", as 0,0.5,1 or '[0, 0.5, 1]'", "choices": ", separated by commas"}
EXAMPLES = {"envelope.step": "0.01 s", "envelope.tolerance": "0.1 mm"}


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
        close = nearest(word.partition("=")[0], known)
        return Problem(here, what, allowed="" if close else ", ".join(known), nearest=close)

    def refuse(self, words: Sequence[str]) -> NoReturn:
        """Complain about words that are no options of this command, with the nearest that is."""
        known = [name for name in self._option_string_actions if name.startswith("--")]
        raise BadInput([self.stranger(word, known) for word in words])


def refuse_petsc(command: str, petsc: Mapping[str, str]) -> None:
    """Refuse PETSc's options with a command that solves nothing with PETSc."""
    if petsc and command not in ("cell", "modulus", "run"):
        allowed = "with the commands cell, modulus and run"
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


def add_common(parser: argparse.ArgumentParser) -> None:
    """The case and the options that every command on it takes."""
    parser.add_argument("case", metavar="CASE", help="case file, for example cases/paper.toml")
    parser.add_argument(
        "--set",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        help="change any key of the case; may be repeated",
    )
    add_quiet(parser)


def add_quiet(parser: argparse.ArgumentParser) -> None:
    """``--json`` and ``--quiet``."""
    parser.add_argument(
        "--json",
        metavar="FILE",
        help="write the result as one JSON object; - for standard output, with nothing else on it",
    )
    parser.add_argument("--quiet", action="store_true", help="no progress and no table")


def add_keys(
    parser: argparse.ArgumentParser, keys: dict[str, str], bare: Mapping[str, str] | None = None
) -> None:
    """Options that stand for keys; `bare` names the unit of those that need none."""
    known = every_key()
    for option, key in keys.items():
        entry = known[key]
        example = (
            f", for example '{EXAMPLES.get(key) or QUANTITIES[entry.unit][1]}'"
            if entry.unit
            else FORMS.get(entry.kind, "")
        )
        example += f", or a bare number of {bare[option]}" if bare and option in bare else ""
        choices = f": {', '.join(entry.choices)}" if entry.choices else ""
        metavar = METAVARS.get(entry.kind) or ("QUANTITY" if entry.unit else "NUMBER")
        parser.add_argument(
            option,
            metavar=metavar,
            help=f"{entry.about}{choices}{example} (default: {key} of the case)",
        )


def add_workers(parser: argparse.ArgumentParser, what: str = "the samples") -> None:
    """``--workers``."""
    parser.add_argument(
        "--workers",
        metavar="N",
        type=int,
        default=1,
        help=f"processes that share {what} (default 1)",
    )


def changes(options: argparse.Namespace, keys: dict[str, str]) -> list[str]:
    """Changes of the case as KEY=VALUE; ``--set`` first, so that a named option wins."""
    named = {
        option: getattr(options, option.removeprefix("--").replace("-", "_")) for option in keys
    }
    return [
        *options.set,
        *(f"{keys[option]}={value}" for option, value in named.items() if value is not None),
    ]


def check_workers(count: int) -> None:
    """At least one worker."""
    if count < 1:
        raise BadInput(Problem("--workers", "out of range", str(count), "a whole number 1 or more"))
