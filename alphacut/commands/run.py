"""Command ``alphacut run``: all stages, files, figures and the comparison."""

from __future__ import annotations

import argparse
import shlex
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TextIO

from alphacut.case.checks import FILES
from alphacut.case.load import load
from alphacut.case.quick import banner, quick, settings
from alphacut.commands.options import add_common, add_workers, check_workers
from alphacut.figures import all as figures
from alphacut.figures.captions import core
from alphacut.io.files import as_json, say, whole_file, write_text
from alphacut.io.output_paths import unwritable
from alphacut.io.problem import BadInput
from alphacut.io.provenance import attributes, door, fingerprint
from alphacut.io.units import engineering, largest_by_unit
from alphacut.stages import exceedance as outcomes
from alphacut.stages import summary
from alphacut.stages import width_shares as shares
from alphacut.stages.pipeline import Chain, Results
from alphacut.stages.readiness import ready

ABOUT = (
    "run every stage of a case: files, figures, summary, and the comparison with the paper where"
    " the case has one"
)


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    add_common(parser)
    add_workers(parser)
    parser.add_argument(
        "--out", metavar="FOLDER", help="where results go (default: results/NAME-OF-THE-CASE)"
    )
    again = parser.add_mutually_exclusive_group()
    again.add_argument(
        "--resume",
        action="store_true",
        help="go on from what an earlier run has left, where nothing changed: the default",
    )
    again.add_argument(
        "--fresh",
        action="store_true",
        help="compute everything anew instead of taking what is up to date",
    )
    parser.add_argument(
        "--strict",
        action="store_true",
        help="refuse a time step or tolerance too coarse for the motion",
    )
    parser.add_argument(
        "--quick",
        action="store_true",
        help="the quick form: same stages in seconds on coarse meshes; numbers mean nothing",
    )
    parser.add_argument("--no-figures", action="store_true", help="numbers only")


def run(options: argparse.Namespace, petsc: Mapping[str, str], out: TextIO) -> int:
    """Compute, draw, compare."""
    check_workers(options.workers)
    case = load(options.case, options.set)
    case = quick(case) if options.quick else case
    folder = Path(options.out or f"results/{case.name}{'-quick' if options.quick else ''}")
    if problems := list(unwritable("--out", folder, folder=True)):
        raise BadInput(problems)
    prepared = ready(case)
    if prepared.rough and options.strict:
        raise BadInput(prepared.rough)
    # of what is rough the stage itself warns, with the modulus that it gets
    for warning in prepared.warnings:
        say(f"warning: {warning}")
    start = time.perf_counter()
    chain = Chain(
        case, folder, options.workers, options.fresh, options.quiet, petsc, options.strict
    )
    results = chain.run()
    driving = chain.stored("shares.nc", *driven(chain, results))
    drawn = [] if options.no_figures else figures.draw(results, driving, quiet=options.quiet)
    found: dict[str, Any] = {
        **summary.summary(results),
        **({"quick": settings(results.case)} if options.quick else {}),
        "shares": shares.mean_shares(driving),
        **({"changes": options.set} if options.set else {}),
        "figures": drawn,
        "seconds": time.perf_counter() - start,
    }
    document = as_json(found, indent=2)
    write_text(folder / "summary.json", document)
    if options.json == "-":
        out.write(as_json(found))
    elif options.json:
        write_text(options.json, document)
    if options.json != "-" and not options.quiet:
        out.write(f"{banner(found['quick'])}\n" if options.quick else "")
        out.write(summary.table(found["paper"]) if found["paper"] else "")
        out.write(main_numbers(found))
        say(
            f"results are in {folder}, {len(drawn)} figures among them, after"
            f" {found['seconds']:.0f} s"
        )
        say(f"next: {door()} report {shlex.quote(str(folder))}")
    return 0


def main_numbers(found: Mapping[str, Any]) -> str:
    """The fuzzy modulus and every study's extremes, a line each."""
    from alphacut.frame.outputs import output_unit

    lines = []
    if cell := found.get("modulus"):
        lines.append(
            f"E = {core(cell)}, support [{cell['lower_GPa']:.4f}, {cell['upper_GPa']:.4f}] GPa"
        )
    for name, study in found.get("envelopes", {}).items():
        ends = [
            (output, output_unit(output), float(low), float(study["max"][output]))
            for output, low in study["min"].items()
        ]
        largest = largest_by_unit((value, unit) for _, unit, *values in ends for value in values)
        for output, unit, *values in ends:
            low, high = (engineering(value, unit, beside=largest[unit]) for value in values)
            lines.append(f"{output} from {low} to {high} at the lowest α (study {name})")
    limit = outcomes.sentence(found["exceedance"]) if "exceedance" in found else ""
    return "".join(f"{line}\n" for line in lines) + limit


def driven(chain: Chain, results: Results) -> tuple[str, Callable[[Path], None]]:
    """Fingerprint and making of shares.nc, which says what drives the widths."""
    files = [results.case.digest(key) for key in FILES if results.case.has(key)]
    content = {"case": results.case.values, "files": files, "modulus": results.handed}
    key = fingerprint(content, ("stochastic", "rve", "fuzzy", "frame", "alphacut"))

    def compute(path: Path) -> None:
        with whole_file(path) as partial:
            shares.dataset(results).assign_attrs(
                attributes(results.case.text_of_file, key)
            ).to_netcdf(partial)

    return key, compute
