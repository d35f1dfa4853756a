"""The command line: its parser, the options that commands share, and how they answer."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, NamedTuple, NoReturn, TextIO

from alphacut.base.csv_columns import text_of
from alphacut.base.errors import RefusedError, require
from alphacut.base.kept_files import write_text
from alphacut.io.files import as_json, suggestion
from alphacut.rve.interruption import uninterrupted

if TYPE_CHECKING:
    from alphacut.case.cell import CellContent
    from alphacut.case.content import Case

PETSC_PREFIX = "-rve_"
OPTIONS_FILE = "-options_file"
PETSC_HELP = """\
options of PETSc, for prisms (method prism, or a mesh): -rve_… anywhere, as
-rve_ksp_type gmres -rve_pc_type gamg, or -options_file FILE with such words"""


@dataclass(frozen=True)
class Command:
    """A command of the command line.

    Args:
        about: What it does, in a line.
        arguments: Function that adds its options to a parser.
        place: The function that runs it, as "run:report" of a file in `alphacut.commands`.
    """

    about: str
    arguments: Callable[[argparse.ArgumentParser], None]
    place: str

    def run(self, options: argparse.Namespace, out: TextIO) -> int:
        """Run the command with its options, and return the exit status."""
        # An exception raised amid imports could be swallowed by the code that they run: a signal
        # waits. Help and wrong options need no command, whose imports take a second.
        with uninterrupted():
            if "case" in options:  # a file that is not there is refused before that
                text_of(Path(options.case))
            function = resolve_name(f"alphacut.commands.{self.place}")
        status: int = function(options, out)
        return status


class Parser(argparse.ArgumentParser):
    """An argument parser that raises in place of printing its usage and leaving."""

    def error(self, message: str) -> NoReturn:
        """Raise a complaint of argparse as RefusedError, with the argument and its value apart.

        Args:
            message: Text of argparse, such as "argument --workers: invalid int value: 'x'".

        Raises:
            RefusedError: Always. A complaint of unknown form becomes "refused: …".
        """
        # argparse has texts only: the patterns are those of its messages in Python 3.11 to 3.13.
        argument, _, reason = message.removeprefix("argument ").partition(": ")
        cure = f"see {self.prog} --help"
        if match := re.fullmatch(r"invalid choice: '(.*?)' \(choose from (.*)\)", reason):
            value, choices = match.groups()
            raise RefusedError(argument, value, choices.replace("'", ""), cure)
        if match := re.fullmatch(r"invalid int value: '(.*)'", reason):
            raise RefusedError(argument, match[1], "whole numbers", cure)
        if reason.startswith("expected"):
            raise RefusedError(f"value of {argument}", None, "", cure)
        if argument == "the following arguments are required":
            raise RefusedError(reason, None, "", cure)
        raise RefusedError(argument, f"refused: {reason}", "", cure)

    def refuse(self, word: str) -> NoReturn:
        """Raise the problem of a word that is no option of this command."""
        # Short forms are left out: a suggestion by likeness means nothing for one letter.
        names = [name for name in self._option_string_actions if name.startswith("--")]
        key = f"{self.prog.removeprefix('alphacut ')}: option"
        raise RefusedError(key, word, ", ".join(names), suggestion(word, names))


class CommandLine(NamedTuple):
    """Words of the program's own, and values of PETSc's options, named without ``-rve_``."""

    words: list[str]
    petsc: dict[str, str]


def split_petsc(arguments: Sequence[str]) -> CommandLine:
    """Return the words of a command line and the options of PETSc among them.

    Args:
        arguments: Words of the command line. An option of PETSc begins with "-rve_". The word after
            it is its value, unless this begins as an option, such as "-x" or "--json", or ends in
            ".toml", as a case does. Negative numbers such as "-1" are values. "-options_file FILE"
            stands for the words of a file, in which "#" begins a comment.

    Returns:
        All other words in their order; and the values of the options by their names without
        "-rve_". An option without a value has "", and of one that is given twice the last value
        counts.

    Raises:
        RefusedError: There is no such file of options.
    """
    # argparse cannot know PETSc's options, of which there are thousands, nor which take a value.
    line = CommandLine([], {})
    option = ""  # whose value may follow
    all_words = list(arguments)
    if OPTIONS_FILE in all_words[:-1]:
        place = all_words.index(OPTIONS_FILE)
        text = text_of(Path(all_words[place + 1]))
        all_words[place : place + 2] = re.sub("#.*", "", text).split()
    for word in all_words:
        is_value = not re.match(r"--?[A-Za-z_]", word) and not word.endswith(".toml")
        if word.startswith(PETSC_PREFIX):
            option = word.removeprefix(PETSC_PREFIX)
            line.petsc[option] = ""
        elif option and is_value:
            line.petsc[option] = word
            option = ""
        else:
            line.words.append(word)
            option = ""
    return line


def require_petsc(petsc: Mapping[str, str], content: CellContent | None = None) -> None:
    """Refuse options of PETSc, which act on prisms alone, for a command that solves no prisms.

    Args:
        petsc: The options without their prefix; if empty, nothing is refused.
        content: The cell of the case; None for a command without a case.

    Raises:
        RefusedError: Naming the first option.
    """
    # An option that nothing reads would look as if it acted.
    has_prisms = content is not None and (
        content.mesh.file is not None
        or (content.modulus.method == "prism" and content.particle_cell is not None)
    )
    option = PETSC_PREFIX + next(iter(petsc), "")
    require(has_prisms or not petsc, option, "PETSc's", "options of a cell with method prism")


def read_case(options: argparse.Namespace) -> Case:
    """Return the case file that the options name, with the changes of ``--set``."""
    from alphacut.case.content import load  # Pydantic takes .1 s to import

    # Whether options of PETSc have a use is known when the case says how its cell is solved.
    case = load(options.case, options.set)
    require_petsc(options.petsc, case.content)
    return case


def add_common(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of every command on a case to a parser, in place.

    They are CASE as `case`, ``--set`` as the list `set`, ``--json`` and ``--quiet``. The help says
    below them how options of PETSc are given.
    """
    parser.epilog = PETSC_HELP
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
    """Add ``--json FILE`` and ``--quiet`` to a parser, in place; `json` is None by default."""
    parser.add_argument(
        "--json",
        metavar="FILE",
        help="file for the result as JSON; - for standard output, with nothing else on it",
    )
    parser.add_argument("--quiet", action="store_true", help="no progress and no table")


def add_run(parser: argparse.ArgumentParser, default_place: str = "nothing is kept") -> None:
    """Add the arguments of a command that keeps results: those of a case, and where they go."""
    add_common(parser)
    about = f"folder for results ({default_place} if left out); what is up to date there is taken"
    parser.add_argument("--out", metavar="FOLDER", help=about)
    parser.add_argument("--workers", metavar="N", type=int, default=1, help="processes (default 1)")


def write_answer(
    options: argparse.Namespace, document: Mapping[str, object], out: TextIO, text: str = ""
) -> None:
    """Write the result of a command as its options ask: as JSON, or `text` to be read.

    With ``--json -`` the JSON document alone is written to `out`. With ``--json FILE`` it goes to
    that file, and the text to `out` unless the command is to be quiet.

    Args:
        options: Of the command line: `json`, a file, "-" or None, and `quiet`.
        document: The result; arrays in it are allowed.
        out: Takes what is written to standard output.
        text: The result in words, with line ends.

    Raises:
        OSError: The file cannot be written.
    """
    if options.json == "-":
        out.write(as_json(document))
        return
    if options.json:
        write_text(options.json, as_json(document, indent=2))
    if not options.quiet:
        out.write(text)
