"""Options that the commands share, and how they change a case."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import TYPE_CHECKING, TextIO

from alphacut.commands.parser import PETSC_PREFIX
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.refused import RefusedError
from alphacut.io import quantity
from alphacut.io.files import as_json, write_text
from alphacut.io.problem import BadInput

if TYPE_CHECKING:
    from alphacut.case.content import Content

SAMPLE = {
    "--a2": ("radius.a2", "slope of the radius at the lower end of θ"),
    "--a4": ("radius.a4", "slope of the radius at the upper end"),
    "--inclusion-modulus": ("cell.inclusion_modulus", "as '80 GPa'"),
    "--method": ("modulus.method", "prism, slices, series or auto"),
}
"""Options of the cell that stand for keys of a case, each with its key and help."""


def add_common(parser: argparse.ArgumentParser) -> None:
    """Adds the case and the options that every command on it takes."""
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


def add_keys(parser: argparse.ArgumentParser, keys: Mapping[str, tuple[str, str]]) -> None:
    """Adds options that stand for keys of the case."""
    for option, (_, about) in keys.items():
        parser.add_argument(option, metavar="VALUE", help=about)


def add_workers(parser: argparse.ArgumentParser) -> None:
    """Adds ``--workers``."""
    parser.add_argument("--workers", metavar="N", type=int, default=1, help="processes (default 1)")


def add_modulus(parser: argparse.ArgumentParser) -> None:
    """Adds ``--modulus``."""
    parser.add_argument(
        "--modulus",
        metavar="QUANTITY|FILE.nc",
        help="Young's modulus in place of the case's: '[22, 24, 26] GPa', or α-cuts",
    )


def changes(options: argparse.Namespace, keys: Mapping[str, tuple[str, str]]) -> list[str]:
    """Changes of the case by ``--set`` and by the options that stand for keys, as KEY=VALUE."""
    values = {key: getattr(options, _attribute(option)) for option, (key, _) in keys.items()}
    return [*options.set, *(f"{key}={x}" for key, x in values.items() if x is not None)]


def _attribute(option: str) -> str:
    return option.removeprefix("--").replace("-", "_")


def answer(
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


def require_workers(count: int) -> None:
    """Refuses fewer than one worker.

    Raises:
        RefusedError: There are fewer.
    """
    if count < 1:
        raise RefusedError("--workers", count, "a whole number 1 or more")


def require_prism(petsc: Mapping[str, str], content: Content | None = None) -> None:
    """Refuses PETSc options where no prism elements are solved.

    Args:
        petsc: The options, without their prefix.
        content: The case; None for a command that solves no cell.

    Raises:
        RefusedError: There are such options.
    """
    prism = content is not None and content.round and content.modulus.method == "prism"
    if petsc and not prism:
        option = PETSC_PREFIX + next(iter(petsc))
        raise RefusedError(option, "PETSc's", "options of run, cell, modulus with method prism")


def modulus_option(text: str | None) -> FuzzyNumber | None:
    """The modulus of ``--modulus`` in Pa: a quantity, or the α-cuts of a file.

    Raises:
        BadInput: It is no positive modulus.
    """
    if text is None:
        return None
    if text.endswith(".nc"):
        from alphacut.stages.modulus import read_number

        return read_number(text)
    allowed = "a stress such as '[22.8, 24.8, 25.8] GPa', or FILE.nc"
    try:
        number = quantity.fuzzy(text, "Pa")
    except ValueError as error:
        raise BadInput.of("--modulus", str(error), text, allowed) from None
    if not number.support.lower > 0:
        raise BadInput.of("--modulus", "out of range", text, "greater than 0")
    return number
