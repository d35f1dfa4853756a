"""Options that the commands share, and how they change a case."""

from __future__ import annotations

import argparse
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TextIO

from alphacut.case.sections.material import CELL_METHODS
from alphacut.fuzzy import FuzzyNumber
from alphacut.io import quantity
from alphacut.io.files import as_json, write_text
from alphacut.io.problem import BadInput, Problem, refuse
from alphacut.io.quantity import NUMBER


@dataclass(frozen=True)
class KeyOption:
    """A key of the case that is typed often enough to have an option.

    Args:
        key: Full name of the key.
        about: Its help, short.
        metavar: What it takes.
        bare: Unit of a bare number; empty where the unit must be written.
    """

    key: str
    about: str
    metavar: str = "QUANTITY"
    bare: str = ""


SAMPLE = {
    "--a2": KeyOption("radius.a2", "slope of the radius at the lower end of θ", "NUMBER"),
    "--a4": KeyOption("radius.a4", "slope at the upper end", "NUMBER"),
    "--inclusion-modulus": KeyOption("cell.inclusion_modulus", "as '80 GPa'"),
}
MESH = {
    "--layers": KeyOption("mesh.layers", "element layers in θ: prism", "INTEGER"),
    "--mesh-size": KeyOption("mesh.size", "element size: prism, slices", "NUMBER"),
    "--interface": KeyOption("mesh.interface", "conforming or sign: prism", "CHOICE"),
}
MODEL = {
    "--method": KeyOption("modulus.method", ", ".join(CELL_METHODS), "CHOICE"),
    "--tolerance": KeyOption(
        "modulus.tolerance", "relative error of E that must be kept", "NUMBER"
    ),
}


def add_flag(place: argparse._ActionsContainer, name: str, about: str) -> None:
    """An option that takes no value."""
    place.add_argument(name, action="store_true", help=about)


def add_common(parser: argparse.ArgumentParser) -> None:
    """The case and the options that every command on it takes."""
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
    """``--json`` and ``--quiet``."""
    parser.add_argument(
        "--json",
        metavar="FILE",
        help="write the result as JSON; - for standard output, with nothing else on it",
    )
    add_flag(parser, "--quiet", "no progress and no table, as with --json -")


def add_keys(parser: argparse.ArgumentParser, keys: Mapping[str, KeyOption]) -> None:
    """Options that stand for keys of the case."""
    group = parser.add_argument_group("keys of the case, others by --set")
    for option, entry in keys.items():
        bare = f"; a bare number is in {entry.bare}" if entry.bare else ""
        group.add_argument(option, metavar=entry.metavar, help=f"{entry.about}{bare}")


def add_exclude(parser: argparse.ArgumentParser, known: str) -> None:
    """``--exclude`` and ``--best-effort``."""
    parser.add_argument(
        "--exclude", metavar="NAMES", help=f"not to be taken by method auto: {known}"
    )
    add_best_effort(parser)


def add_best_effort(parser: argparse.ArgumentParser) -> None:
    """``--best-effort``."""
    add_flag(parser, "--best-effort", "take a result whose error is above the tolerance")


def add_workers(parser: argparse.ArgumentParser, what: str = "the samples") -> None:
    """``--workers``."""
    parser.add_argument(
        "--workers", metavar="N", type=int, default=1, help=f"processes for {what} (default 1)"
    )


def changes(options: argparse.Namespace, keys: Mapping[str, KeyOption]) -> list[str]:
    """Changes of the case by ``--set`` and by the options that stand for keys, as KEY=VALUE."""
    named = {
        entry: getattr(options, option.removeprefix("--").replace("-", "_"))
        for option, entry in keys.items()
    }
    return [
        *options.set,
        *(
            f"{entry.key}={with_unit(value, entry.bare)}"
            for entry, value in named.items()
            if value is not None
        ),
    ]


def with_unit(text: str, unit: str) -> str:
    """A quantity whose unit may be left out: ``30`` means 30 s where `unit` is s."""
    plain = re.fullmatch(NUMBER, text.strip())
    return f"{text} {unit}" if unit and plain else text


def refuse_beside(options: argparse.Namespace, first: str, others: Mapping[str, str]) -> None:
    """Refuse options that have no effect beside another one.

    Args:
        options: The options given.
        first: The option beside which the others have none.
        others: Those options, each with the value that it has where it is not given.

    Raises:
        BadInput: One problem for each that is given.
    """
    problems = []
    for name, default in others.items():
        value = getattr(options, name.removeprefix("--").replace("-", "_"))
        if value not in (None, False, [], "") and str(value) != default:
            shown = "" if value is True else str(value)
            problems.append(Problem(name, f"this has no effect beside {first}", shown))
    refuse(problems)


def answer(
    options: argparse.Namespace, document: Mapping[str, object], out: TextIO, text: str = ""
) -> bool:
    """Write the result: as JSON where it is wanted, else `text` on standard output.

    Returns:
        Whether people are spoken to: no JSON on standard output, and not quiet.
    """
    if options.json == "-":
        out.write(as_json(document))
    elif options.json:
        write_text(options.json, as_json(document, indent=2))
    spoken = options.json != "-" and not options.quiet
    if spoken:
        out.write(text)
    return spoken


def check_workers(count: int) -> None:
    """At least one worker."""
    if count < 1:
        raise BadInput.of("--workers", "out of range", str(count), "a whole number 1 or more")


def add_radius(parser: argparse.ArgumentParser) -> None:
    """``--radius``."""
    parser.add_argument(
        "--radius",
        metavar="NUMBER",
        help="one radius over half the cell's side in place of the map, inside (0, 1)",
    )


def one_radius(options: argparse.Namespace) -> list[str]:
    """Changes of the case that make its map constant; none without ``--radius``.

    Raises:
        BadInput: The radius lies outside (0, 1), or a parameter of the map is given besides.
    """
    if options.radius is None:
        return []
    slopes = [name for name in ("a2", "a4") if hasattr(options, name)]
    refuse_beside(options, "--radius", {f"--{name}": "" for name in slopes})
    for change in options.set:
        if re.match(r"\s*(radius\.)?a[1-4]\s*=", change):
            raise BadInput.of("--set", "this has no effect beside --radius", change)
    try:
        inside = 0 < float(options.radius) < 1
    except ValueError:
        inside = False
    if not inside:
        allowed = "a number inside (0, 1), in halves of the cell's side"
        raise BadInput.of("--radius", "out of range", options.radius, allowed)
    r = options.radius
    constant = [f"radius.a1={r}", "radius.a2=0", f"radius.a3={r}", "radius.a4=0"]
    return ["radius.map=hermite", *constant]


def add_modulus(parser: argparse.ArgumentParser) -> None:
    """``--modulus``."""
    parser.add_argument(
        "--modulus",
        metavar="QUANTITY|FILE.nc",
        help="Young's modulus in place of the case's: '[22, 24, 26] GPa', or α-cuts",
    )


def given_modulus(text: str | None) -> FuzzyNumber | None:
    """The modulus of ``--modulus`` in Pa: a quantity, or the α-cuts of a file."""
    if text is None:
        return None
    if text.endswith(".nc"):
        from alphacut.stages.material.modulus import read_number

        return read_number(text)
    try:
        number = quantity.fuzzy(text, "Pa")
    except ValueError as error:
        raise BadInput.of(
            "--modulus", str(error), text, "a stress such as '[22.8, 24.8, 25.8] GPa', or FILE.nc"
        ) from None
    if not number.support.lower > 0:
        raise BadInput.of("--modulus", "out of range", text, "greater than 0")
    return number
