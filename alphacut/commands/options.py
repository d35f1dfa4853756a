"""The command line: its parser, the options that commands share, and how they answer."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NoReturn, TextIO

from alphacut.base.errors import RefusedError, require
from alphacut.base.kept_files import write_text
from alphacut.case.cell import CellContent
from alphacut.io.files import as_json, suggestion

PETSC_PREFIX = "-rve_"


@dataclass(frozen=True)
class Command:
    """A command: what it does in a line, its options, and its run from them to the exit status."""

    about: str
    arguments: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace, TextIO], int]


class Parser(argparse.ArgumentParser):
    """An argument parser that raises in place of printing its usage and leaving."""

    def error(self, message: str) -> NoReturn:
        """Raises the complaint of argparse as the refusal of an argument."""
        argument, _, reason = message.removeprefix("argument ").partition(": ")
        cure = f"see {self.prog} --help"
        if match := re.fullmatch(r"invalid choice: '(.*?)' \(choose from (.*)\)", reason):
            raise RefusedError(argument, match[1], match[2].replace("'", ""), cure)
        if match := re.fullmatch(r"invalid int value: '(.*)'", reason):
            raise RefusedError(argument, match[1], "whole numbers", cure)
        if reason.startswith("expected"):
            raise RefusedError(f"value of {argument}", None, "", cure)
        if argument == "the following arguments are required":
            raise RefusedError(reason, None, "", cure)
        raise RefusedError(argument, f"refused: {reason}", "", cure)

    def refuse(self, word: str) -> NoReturn:
        """Raises the problem of a word that is no option of this command."""
        names = [name for name in self._option_string_actions if name.startswith("--")]
        allowed, cure = ", ".join(names), suggestion(word, names)
        raise RefusedError(f"{self.prog.removeprefix('alphacut ')}: option", word, allowed, cure)


def split_petsc(arguments: Sequence[str]) -> tuple[list[str], dict[str, str]]:
    """Words of the program's own, and values of PETSc's options, named without ``-rve_``."""
    words, petsc = list[str](), dict[str, str]()
    option = ""  # whose value may follow
    for word in arguments:
        is_value = not re.match(r"--?[A-Za-z_]", word) and not word.endswith(".toml")
        if word.startswith(PETSC_PREFIX):
            option = word.removeprefix(PETSC_PREFIX)
            petsc[option] = ""
        elif option and is_value:
            petsc[option], option = word, ""
        else:
            words.append(word)
            option = ""
    return words, petsc


def require_petsc(petsc: Mapping[str, str], content: CellContent | None = None) -> None:
    """Refuses PETSc options, named without their prefix, where a case solves no prisms."""
    has_prisms = content is not None and (
        content.mesh_cell is not None
        or (content.particle_cell is not None and content.modulus.method == "prism")
    )
    option = PETSC_PREFIX + next(iter(petsc), "")
    require(has_prisms or not petsc, option, "PETSc's", "options of a cell with method prism")


def add_common(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of every command on a case: CASE, ``--set``, ``--json``, ``--quiet``."""
    parser.add_argument("case", metavar="CASE", help="case file, for example cases/paper.toml")
    parser.add_argument(
        "--set",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        help="change a key of the case; may be repeated",
    )
    add_quiet(parser)


def add_quiet(parser: argparse.ArgumentParser) -> None:
    """Adds ``--json`` and ``--quiet``."""
    parser.add_argument(
        "--json",
        metavar="FILE",
        help="file for the result as JSON; - for standard output, with nothing else on it",
    )
    parser.add_argument("--quiet", action="store_true", help="no progress and no table")


def add_run(parser: argparse.ArgumentParser, default_place: str = "nothing is kept") -> None:
    """Adds the arguments of a command that keeps results: ``--out`` and ``--workers`` as well."""
    add_common(parser)
    about = f"folder for results ({default_place} if left out); what is up to date there is taken"
    parser.add_argument("--out", metavar="FOLDER", help=about)
    parser.add_argument("--workers", metavar="N", type=int, default=1, help="processes (default 1)")


def write_answer(
    options: argparse.Namespace, document: Mapping[str, object], out: TextIO, text: str = ""
) -> None:
    """Writes the result: as JSON where it is requested, else `text` on standard output."""
    if options.json == "-":
        out.write(as_json(document))
        return
    if options.json:
        write_text(options.json, as_json(document, indent=2))
    if not options.quiet:
        out.write(text)
