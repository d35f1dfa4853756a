"""``--modulus``: a fuzzy Young's modulus typed in place of the case's."""

from __future__ import annotations

import argparse

from alphacut.fuzzy import FuzzyNumber
from alphacut.io import quantity
from alphacut.io.problem import BadInput, Problem
from alphacut.stages.material.modulus import read_number


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
        return read_number(text)
    try:
        number = quantity.fuzzy(text, "Pa")
    except ValueError as error:
        raise BadInput(
            Problem(
                "--modulus",
                str(error),
                text,
                "a stress such as '[22.8, 24.8, 25.8] GPa', or FILE.nc",
            )
        ) from None
    if not number.support.lower > 0:
        raise BadInput(Problem("--modulus", "out of range", text, "greater than 0"))
    return number
