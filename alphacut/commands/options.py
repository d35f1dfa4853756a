"""Options that the commands share, and how they change a case."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TextIO

from alphacut.case.load import Case, load
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.refused import RefusedError, require
from alphacut.io import quantity
from alphacut.io.files import as_json, write_text
from alphacut.stages.modulus import read_number
from alphacut.stages.store import Store

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


def add_run(parser: argparse.ArgumentParser, place: str = "nothing is kept") -> None:
    """Adds ``--out`` and ``--workers``."""
    about = f"folder for results ({place} if left out); what is up to date there is taken"
    parser.add_argument("--out", metavar="FOLDER", help=about)
    parser.add_argument("--workers", metavar="N", type=int, default=1, help="processes (default 1)")


def add_modulus(parser: argparse.ArgumentParser) -> None:
    """Adds ``--modulus``."""
    parser.add_argument(
        "--modulus",
        metavar="QUANTITY|FILE.nc",
        help="Young's modulus in place of the case's: '[22, 24, 26] GPa', or α-cuts",
    )


def opened(
    options: argparse.Namespace, keys: Mapping[str, tuple[str, str]] | None = None
) -> tuple[Case, Store]:
    """The case, changed as the options say, and the folder of the results.

    Raises:
        BadInput: The case has problems.
        RefusedError: There are fewer than one worker.
    """
    require(options.workers >= 1, "--workers", options.workers, "a whole number 1 or more")
    case = load(options.case, changes(options, keys or {}))
    folder = Path(options.out) if options.out else None
    return case, Store(folder, case.text, quiet=options.quiet, workers=options.workers)


def changes(options: argparse.Namespace, keys: Mapping[str, tuple[str, str]]) -> list[str]:
    """Changes of the case by ``--set`` and by the options that stand for keys, as KEY=VALUE."""
    values = {key: getattr(options, destination(option)) for option, (key, _) in keys.items()}
    return [*options.set, *(f"{key}={x}" for key, x in values.items() if x is not None)]


def destination(option: str) -> str:
    """Name of the attribute of an option."""
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


def modulus_option(text: str | None) -> FuzzyNumber | None:
    """The modulus of ``--modulus`` in Pa: a quantity, or the α-cuts of a file.

    Raises:
        RefusedError: It is no positive modulus.
    """
    if text is None:
        return None
    if text.endswith(".nc"):
        return read_number(text, "--modulus")
    allowed = "a stress above 0 such as '[22.8, 24.8, 25.8] GPa', or FILE.nc"
    try:
        number = quantity.fuzzy(text, "Pa")
    except ValueError as error:
        raise RefusedError("--modulus", text, allowed, str(error)) from None
    require(number.support.lower > 0, "--modulus", text, allowed)
    return number
