"""``alphacut check``: everything that is wrong with a case, at once."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import asdict
from typing import TextIO

from alphacut.case.case import Case
from alphacut.case.load import load
from alphacut.case.readings import readings
from alphacut.commands.options import add_common, answer
from alphacut.io.files import say
from alphacut.io.problem import BadInput
from alphacut.stages.image.phases import BEYOND, phase_lines
from alphacut.stages.image.reading import study_of
from alphacut.stages.material.microstructure import plan
from alphacut.stages.material.modulus import measured_line
from alphacut.stages.readiness import motion, ready

ABOUT = (
    "check a case without computing anything: a line for each problem, with its key and what is"
    " allowed"
)


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    add_common(parser)


def run(options: argparse.Namespace, petsc: Mapping[str, str], out: TextIO) -> int:
    """Check and report; with ``--json`` the problems as data."""
    try:
        case = load(options.case, options.set)
        found = ready(case)
    except BadInput as error:
        problems = [asdict(problem) for problem in error.problems]
        answer(options, {"case": options.case, "ok": False, "problems": problems}, out)
        raise
    inputs, plans = list(readings(case)), [*measured_line(case), *plan(case)]
    if "image" in case.stages:
        plans += [*phase_lines(study_of(case)), BEYOND[case.picture.boundary]]
    plans += [] if found.structure is None else motion(case, found.structure)
    warnings = [f"warning: {remark}" for remark in (*found.warnings, *found.rough)]
    document = {
        "case": options.case,
        "ok": True,
        "problems": [],
        "warnings": warnings,
        "stages": list(case.stages),
        "period_s": found.period,
        "inputs": [asdict(reading) for reading in inputs],
        "plan": plans,
    }
    answer(options, document, out)
    for warning in warnings:
        say(warning)
    if options.json != "-" and not options.quiet:
        lines = (*inputs, *plans, verdict(options.case, case, found.period))
        out.writelines(f"{line}\n" for line in lines)
    return 0


def verdict(name: str, case: Case, period: float | None) -> str:
    """The last line: that nothing is wrong, what would run, and the first natural period."""
    computed = {"modulus", "image"} & set(case.stages)  # the modulus is yet to be had
    first = f"; first natural period {'about ' * bool(computed)}{period:.3g} s" if period else ""
    passed = computed and case.sections.frame and case.frame.modulus is not None
    over = "; frame.modulus is passed over, stage modulus hands its own on" if passed else ""
    return f"{name}: no problems; stages {', '.join(case.stages)}; {case.top.title}{first}{over}"
