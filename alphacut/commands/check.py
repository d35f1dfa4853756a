"""Command ``alphacut check``: the case as it is read, and everything that is wrong with it."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from math import pi
from typing import TextIO

from alphacut.case.case import Case
from alphacut.case.key import Section, keys_of
from alphacut.case.load import load
from alphacut.commands.options import add_common, answer
from alphacut.frame.structures.linear import frequencies
from alphacut.fuzzy import Crisp, FuzzyNumber, Interval, Trapezoidal, Triangular
from alphacut.io.problem import BadInput
from alphacut.io.text_table import text_table
from alphacut.io.units import engineering
from alphacut.stages.material.modulus import stand_in
from alphacut.stages.vibration.structure import structure

ABOUT = "check a case without computing anything, and print what it was read as"
SHAPES = {Crisp: "crisp", Interval: "interval", Triangular: "triangle", Trapezoidal: "trapezoid"}
Row = tuple[str, str, str]


def arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of the command."""
    add_common(parser)


def run(options: argparse.Namespace, petsc: Mapping[str, str], out: TextIO) -> int:
    """Checks and reports; with ``--json`` the problems as data."""
    try:
        case = load(options.case, options.set)
        period = first_period(case)
    except BadInput as error:
        problems = [asdict(problem) for problem in error.problems]
        answer(options, {"case": options.case, "ok": False, "problems": problems}, out)
        raise
    rows = list(values(case))
    document = {
        "case": options.case,
        "ok": True,
        "problems": [],
        "stages": list(case.stages),
        "period_s": period,
        "inputs": [dict(zip(("key", "value", "kind"), row, strict=True)) for row in rows],
    }
    text = text_table(("key", "value", "kind"), rows)
    text += f"first natural period {period:.4g} s\n" if period else ""
    answer(options, document, out, f"{text}{options.case}: no problems\n")
    return 0


def first_period(case: Case) -> float | None:
    """First natural period in s at the modal values; None of a nonlinear structure, or of none."""
    if "envelope" not in case.stages:
        return None
    if case.sections.frame and case.frame.modulus is None and case.frame.stiffness is None:
        if (number := stand_in(case)) is None:
            return None
    else:
        number = stand_in(case)
    linear = structure(case, number).linear
    return None if linear is None else 2 * pi / float(frequencies(linear)[0])


def values(case: Case) -> Iterator[Row]:
    """Key, value and kind of every quantity of the case."""
    for section in ("radius", "cell", "picture", "frame", "pendulum", "envelope"):
        content = getattr(case.sections, section)
        if content is not None:
            yield from rows_of("cell" if section == "picture" else section, content)


def rows_of(name: str, section: Section) -> Iterator[Row]:
    """Key, value and kind of every quantity of a section."""
    for key, about in keys_of(type(section)).items():
        content = getattr(section, key, None)
        several = content if isinstance(content, tuple) else (content,)
        for number, one in enumerate(several, start=1):
            place = f"{name}.{key}" + (f"[{number}]" if len(several) > 1 else "")
            if isinstance(one, FuzzyNumber):
                yield place, _numbers(one, about.unit), SHAPES.get(type(one), "fuzzy")
            elif isinstance(one, float) and about.unit:
                yield place, engineering(one, about.unit), "number"


def _numbers(number: FuzzyNumber, unit: str) -> str:
    ends = dict.fromkeys((number.support.lower, *number.cut(1.0), number.support.upper))
    return " … ".join(engineering(x, unit) for x in ends)
