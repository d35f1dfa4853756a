"""Options that the commands share, and how they change a case."""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from typing import NoReturn

from alphacut.problem import BadInput, Problem
from alphacut.reading import nearest
from alphacut.schema import every_key
from alphacut.units import QUANTITIES

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


class Parser(argparse.ArgumentParser):
    """An argument parser whose complaints are one line, like those about a case."""

    def error(self, message: str) -> NoReturn:
        """Raise instead of printing usage and leaving."""
        raise BadInput(Problem(self.prog, message))

    def refuse(self, words: Sequence[str]) -> NoReturn:
        """Complain about words that are no options of this command, with the nearest that is."""
        known = [name for name in self._option_string_actions if name.startswith("--")]
        raise BadInput(
            [Problem(self.prog, f"there is no such option: {word}", nearest=nearest(word.partition("=")[0], known)) for word in words]
        )


def split_petsc(arguments: Sequence[str]) -> tuple[list[str], dict[str, str]]:
    """Take PETSc's own options (``-rve_ksp_rtol 1e-10``) out of a command line; a flag's value is empty."""
    ours: list[str] = []
    petsc: dict[str, str] = {}
    rest = list(arguments)
    while rest:
        word = rest.pop(0)
        if not word.startswith(PETSC_PREFIX):
            ours.append(word)
            continue
        takes_value = bool(rest) and not re.match(r"--?[A-Za-z_]", rest[0]) and not rest[0].endswith(".toml")
        petsc[word.removeprefix(PETSC_PREFIX)] = rest.pop(0) if takes_value else ""
    return ours, petsc


def add_common(parser: argparse.ArgumentParser) -> None:
    """The case and the options that every command on it takes."""
    parser.add_argument("case", metavar="CASE", help="case file, for example cases/paper.toml")
    parser.add_argument("--set", metavar="KEY=VALUE", action="append", default=[], help="change any key of the case; may be repeated")
    add_quiet(parser)


def add_quiet(parser: argparse.ArgumentParser) -> None:
    """``--json`` and ``--quiet``."""
    parser.add_argument(
        "--json", metavar="FILE", help="write the result as one JSON object; - for standard output, with nothing else on it"
    )
    parser.add_argument("--quiet", action="store_true", help="no progress and no table")


def add_keys(parser: argparse.ArgumentParser, keys: dict[str, str]) -> None:
    """Options that stand for keys of the case, with help from the schema."""
    known = every_key()
    for option, key in keys.items():
        entry = known[key]
        example = f", for example '{QUANTITIES[entry.unit][1]}'" if entry.unit else ""
        choices = f": {', '.join(entry.choices)}" if entry.choices else ""
        metavar = entry.kind.upper().split()[0] if entry.kind in ("integer", "choice") else "QUANTITY" if entry.unit else "NUMBER"
        parser.add_argument(option, metavar=metavar, help=f"{entry.about}{choices}{example} (default: {key} of the case)")


def add_workers(parser: argparse.ArgumentParser) -> None:
    """``--workers``."""
    parser.add_argument("--workers", metavar="N", type=int, default=1, help="processes that share the samples (default 1)")


def changes(options: argparse.Namespace, keys: dict[str, str]) -> list[str]:
    """What the options change in the case, as KEY=VALUE; ``--set`` comes first, so that a named option wins."""
    named = {option: getattr(options, option.removeprefix("--").replace("-", "_")) for option in keys}
    return [*options.set, *(f"{keys[option]}={value}" for option, value in named.items() if value is not None)]


def check_workers(count: int) -> None:
    """At least one worker."""
    if count < 1:
        raise BadInput(Problem("--workers", "out of range", str(count), "a whole number 1 or more"))
