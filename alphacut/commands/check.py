"""``alphacut check``: everything that is wrong with a case, at once."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import asdict
from typing import TextIO

from alphacut.case.load import load
from alphacut.case.readings import readings
from alphacut.commands.options import add_common, answer
from alphacut.io.files import say
from alphacut.io.problem import BadInput
from alphacut.stages.readiness import ready

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
        answer(
            options,
            {
                "case": options.case,
                "ok": False,
                "problems": [asdict(problem) for problem in error.problems],
            },
            out,
        )
        raise
    inputs = list(readings(case))
    warnings = [f"warning: {remark}" for remark in (*found.warnings, *found.rough)]
    answer(
        options,
        {
            "case": options.case,
            "ok": True,
            "problems": [],
            "warnings": warnings,
            "stages": list(case.stages),
            "period_s": found.period,
            "inputs": [asdict(reading) for reading in inputs],
        },
        out,
    )
    for warning in warnings:
        say(warning)
    if options.json != "-" and not options.quiet:
        # the modulus is yet to be computed
        about = "about " if {"modulus", "image"} & set(case.stages) else ""
        period = f"; first natural period {about}{found.period:.3g} s" if found.period else ""
        passed = (
            {"modulus", "image"} & set(case.stages)
            and case.sections.frame
            and case.frame.modulus is not None
        )
        over = "; frame.modulus is passed over, stage modulus hands its own on" if passed else ""
        for reading in inputs:
            out.write(f"{reading}\n")
        out.write(
            f"{options.case}: no problems; stages {', '.join(case.stages)};"
            f" {case.top.title}{period}{over}\n"
        )
    return 0
