"""Command ``alphacut tolerances``: the largest supports for which a limit provably holds."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import TextIO

from alphacut.case.idle import require_read
from alphacut.case.load import load
from alphacut.commands import options as common
from alphacut.frame.decisions.limit_search import TIE
from alphacut.frame.structures.quantities import Output
from alphacut.io.files import say
from alphacut.io.problem import BadInput
from alphacut.io.progress import progress
from alphacut.io.units import engineering
from alphacut.stages.material.modulus import stand_in
from alphacut.stages.vibration.studies import fixed_line
from alphacut.stages.vibration.tolerances import Tolerances, input_unit, tolerances

ABOUT = "largest supports for which the limit provably holds"
OPEN = 0.1
"""Gap beyond the safe scale, as a share of it, from which on it is called undecided."""
KEYS = {
    "--fuzzy": common.KeyOption(
        "envelope.fuzzy", "inputs whose supports are scaled, as E,m", "NAMES"
    ),
    "--duration": common.KeyOption("envelope.duration", "length of the simulation", bare="s"),
    "--step": common.KeyOption("envelope.step", "time step", bare="s"),
}
READ = ("frame", "field", "envelope", "exceedance", "radius", "cell", "mesh", "modulus")


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    common.add_common(parser)
    common.add_keys(parser, KEYS)
    common.add_modulus(parser)
    parser.add_argument(
        "--most",
        type=float,
        metavar="X",
        help="largest scaling asked for (default 2, or what leaves each input a meaning)",
    )
    common.add_workers(parser, "the proof")


def run(options: argparse.Namespace, petsc: Mapping[str, str], out: TextIO) -> int:
    """Compute and report."""
    common.check_workers(options.workers)
    if options.most is not None and not options.most > 0:
        raise BadInput.of("--most", "out of range", f"{options.most:g}", "greater than 0")
    case = load(options.case, common.changes(options, KEYS))
    require_read(case, READ, "tolerances")
    handed = common.given_modulus(options.modulus) or stand_in(case)
    with progress("Tolerances", quiet=options.quiet) as tick:
        found = tolerances(case, handed, most=options.most, workers=options.workers, progress=tick)
    if case.sections.update:
        say("the supports scaled are those of the case: what [update] learns is not taken in")
    common.answer(options, found.document(), out, text(found))
    return 0


def text(found: Tolerances) -> str:
    """The safe scale, the safe intervals and the witness, with their units, a line each."""
    scale = found.found
    kept = [
        f"|{name}| <= {engineering(limit, Output(name).unit)}"
        for name, limit in found.limits.items()
    ]
    if scale.safe is None:
        return f"{' and '.join(kept)} does not hold at the nominal values: no tolerance is safe\n"
    lines = [
        f"{' and '.join(kept)} at all nodes, motion between them not included, for supports scaled"
        f" by up to {scale.safe:.4g} ({scale.nature}{f': {scale.reason}' if scale.reason else ''})"
    ]
    lines += [
        f"  {name}: {' … '.join(engineering(end, input_unit(name), digits=6) for end in ends)}"
        for name, ends in found.intervals.items()
    ]
    lines += fixed_line(found.fixed)
    lines += [f"scaled by {found.most:.4g} at most: {found.ended}"] if found.ended else []
    if found.undecided:
        why = "neither proved nor refuted; narrow some inputs"
        if scale.nominal_share > 1 - TIE:
            why = "the nominal motion reaches the limit itself; take a limit a little greater"
        what = f"undecided between {scale.safe:.4g} and {found.most:.4g}"
        return "\n".join([*lines, f"{what}: {why}", ""])
    if scale.witness is None:
        return "\n".join([*lines, f"nothing unsafe found up to {scale.safe:.4g}", ""])
    point = ", ".join(
        f"{name} = {engineering(float(x), input_unit(name), digits=6)}"
        for name, x in zip(scale.names, scale.witness, strict=True)
    )
    lines.append(f"unsafe at {scale.unsafe:.4g} ({100 * scale.gap:.2g} % more): {point}")
    what = f"|{next(iter(found.limits))}|" if len(kept) == 1 else "the worst of them"
    lines.append(f"  there {what} passes the limit by {100 * (scale.share - 1):.2g} %")
    if scale.gap > OPEN:
        lines.append("between the two it is undecided; narrow some inputs")
    return "\n".join([*lines, ""])
