"""Command ``alphacut envelope``, also ``python -m frame envelope``: fuzzy dynamics."""

from __future__ import annotations

import argparse
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

import numpy as np

from alphacut.case.case import Case
from alphacut.case.idle import changed_moduli, require_read
from alphacut.case.load import load
from alphacut.case.sections.vibration import ENVELOPE_METHODS
from alphacut.case.values import nearest
from alphacut.commands import options as common
from alphacut.frame import Envelope
from alphacut.frame.exceedance import peaks
from alphacut.frame.structures.quantities import Output
from alphacut.io.files import Document, say
from alphacut.io.kept_arrays import KeptArrays
from alphacut.io.problem import BadInput, Problem, refuse
from alphacut.io.progress import progress
from alphacut.io.provenance import fingerprint
from alphacut.io.units import engineering, largest_by_unit
from alphacut.stages import width_shares
from alphacut.stages.contract import require_choice
from alphacut.stages.material.modulus import stand_in
from alphacut.stages.vibration import decision, envelope
from alphacut.stages.vibration import exceedance as outcomes
from alphacut.stages.vibration.envelope_task import EnvelopeTask, task_of
from alphacut.stages.vibration.structure import Structure, structure
from alphacut.stages.vibration.studies import cut_line, fixed_line, left_out
from alphacut.stochastic.theta.truncated_normal import Array

if TYPE_CHECKING:
    import xarray

ABOUT = "envelopes of the structure's vibration on every α-cut"
KEYS = {
    "--fuzzy": common.KeyOption("envelope.fuzzy", "inputs that are fuzzy, as E,m", "NAMES"),
    "--duration": common.KeyOption("envelope.duration", "length of the simulation", bare="s"),
    "--step": common.KeyOption("envelope.step", "time step", bare="s"),
    "--alpha": common.KeyOption("envelope.alpha", "levels, as 0,0.5,1", "LIST"),
    "--method": common.KeyOption("envelope.method", ", ".join(ENVELOPE_METHODS), "CHOICE"),
    "--tolerance": common.KeyOption("envelope.tolerance", "error that must be kept", bare="m"),
    "--certify": common.KeyOption(
        "envelope.certify", "gap of bounds, proved if possible", bare="m"
    ),
}
READ = ("frame", "field", "pendulum", "tower", "envelope", "exceedance")
GIVEN = tuple(f"modulus.{x}" for x in ("value", "file", "measured", "claim", "bounds", "law"))
UNEXPLAINED = {"--out": "", "--workers": "1", "--best-effort": "", "--strict": ""}
OF_AUTO = ("modal", "improved-graph-follower")


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    common.add_common(parser)
    common.add_keys(parser, KEYS)
    common.add_modulus(parser)
    common.add_exclude(parser, " or ".join(OF_AUTO))
    common.add_workers(parser, "the proof of --certify")
    common.add_flag(parser, "--strict", "refuse a step or tolerance too coarse for the motion")
    common.add_flag(parser, "--explain", "say what would be run, in seconds; run nothing")
    parser.add_argument("--out", metavar="FILE.nc", help="write the envelopes as NetCDF")


def run(options: argparse.Namespace, petsc: Mapping[str, str], out: TextIO) -> int:
    """Compute and report."""
    common.check_workers(options.workers)
    if options.certify is not None and options.method is None:
        options.method = "modal"  # the one that can
    case = load(options.case, common.changes(options, KEYS), without=replaced(options))
    require_read(case, (*READ, *GIVEN), "envelope")
    handed = common.given_modulus(options.modulus) or stand_in(case)
    task = replace(task_of(case), exclude=excluded(options.exclude or ""))
    contradictions(options, case, task)
    for line in envelope.wide_gap(case):
        say(f"warning: {line}")
    wanted = structure(case, handed)
    if case.sections.exceedance:
        outcomes.require_random(case, wanted)  # before anything is computed
    if options.explain:
        common.refuse_beside(options, "--explain", UNEXPLAINED)
        plan = envelope.explain(wanted, task)
        plan += width_shares.explained(wanted, task) if case.envelope.shares else []
        plan += decision.explained(case, wanted, task) if case.sections.decision else []
        common.answer(options, {"plan": plan}, out, "".join(f"{line}\n" for line in plan))
        return 0
    content = {"case": case.sections, "task": task, "modulus": handed}
    content["files"] = case.digests(*case.sections.files)
    found, dataset = computed(options, case, wanted, task, fingerprint(content, ("fuzzy", "frame")))
    limit = exceeded(options, case, wanted)
    tried = dataset["peak_tried"].values
    contract = {"asked": task.tolerance, "reached": dataset.attrs.get("reached")}
    fixed, cut = left_out(wanted, [task]), cut_line(wanted, [task])
    document = {
        **envelope.document(found, tried),
        "fixed": fixed,
        "cut": cut,
        "duration": task.duration,
        "step": task.step,
        "tolerance": contract,
        **({"exceedance": limit} if limit else {}),
    }
    text = summary(found, tried[0], own_gap=task.certify is None) + "".join(
        f"{line}\n" for line in (*fixed_line(fixed), *cut)
    )
    text += outcomes.sentences(limit) if limit else ""
    common.answer(options, document, out, text)
    return 0


def computed(
    options: argparse.Namespace, case: Case, wanted: Structure, task: EnvelopeTask, key: str
) -> tuple[Envelope, xarray.Dataset]:
    """The envelopes, judged by the case's tolerance, then written where ``--out`` says."""
    beside = options.out and Path(options.out).with_suffix(".partial.npz")
    kept = KeptArrays(beside, key) if beside else None
    with progress("Envelopes", quiet=options.quiet) as tick:
        found = envelope.compute(
            wanted, task, strict=options.strict, workers=options.workers, progress=tick, kept=kept
        )
    dataset = outcomes.with_peaks(found, wanted, task)
    envelope.keep_tolerance(case, dataset, best_effort=options.best_effort)
    if kept:
        envelope.write(dataset, options.out, case_text=case.text_of_file, key=key)
        kept.done()
    return found, dataset


def exceeded(options: argparse.Namespace, case: Case, wanted: Structure) -> Document | None:
    """The fuzzy probability of exceeding the case's limit; None where it names none."""
    if case.sections.exceedance is None:
        return None
    with progress("Exceedance", quiet=options.quiet) as tick:
        return outcomes.exceedances_document(outcomes.exceedance(case, wanted, tick))


def replaced(options: argparse.Namespace) -> tuple[str, ...]:
    """The case's tolerance, where the command line gives the other kind."""
    shares = [text for text in options.set if re.match(r"(envelope\.)?relative.tolerance *=", text)]
    if options.tolerance is not None and not shares:
        return ("envelope.relative_tolerance",)
    lengths = [text for text in options.set if re.match(r"(\w+\.)?tolerance *=", text)]
    if shares and options.tolerance is None and not lengths:
        return ("envelope.tolerance", "pendulum.tolerance")
    return ()


def contradictions(options: argparse.Namespace, case: Case, task: EnvelopeTask) -> None:
    """Refuse options that have no effect together.

    Raises:
        BadInput: A modulus for a structure that takes none or gets another one, methods left out
            where none is chosen, processes where nothing is proved, or a tolerance that none can
            miss.
    """
    problems = []
    given = changed_moduli(case)
    if options.modulus is not None and (given or case.sections.frame is None):
        what = f"{given[0]} is given besides" if given else "this structure takes no modulus"
        allowed = "one of them" if given else "with a storey frame"
        problems.append(Problem("--modulus", what, options.modulus, allowed))
    if task.exclude and task.method != "auto":
        what = f"the method is {task.method}"
        problems.append(Problem("--exclude", what, options.exclude, "with --method auto"))
    if options.workers > 1 and task.certify is None:
        what = "this has no effect: only a proof is shared by processes"
        problems.append(Problem("--workers", what, str(options.workers), "with --certify"))
    refuse(problems)
    if options.best_effort:
        require_choice(case, modulus=False, envelope=True)


def excluded(text: str) -> tuple[str, ...]:
    """Names of methods, separated by commas."""
    names = tuple(name.strip() for name in text.split(",") if name.strip())
    what, close = "", ""
    for name in names:
        if name not in ENVELOPE_METHODS:
            what, close = f"there is no method {name}", nearest(name, OF_AUTO)
        elif name not in OF_AUTO:
            what = f"'{name}' is unknown to auto, which takes other methods"
    if set(names) == set(OF_AUTO):
        what = "no method is left for auto to take"
    if what:
        raise BadInput.of("--exclude", what, text, " or ".join(OF_AUTO), close)
    return names


def summary(found: Envelope, tried: Array | None = None, *, own_gap: bool = False) -> str:
    """Extremes and fuzzy peaks at the lowest level as a small table."""
    of = peaks(found)
    units = [Output(name).unit for name in found.outputs]
    least = of.lower[0] if tried is None else tried
    columns = [
        list(map(float, row))
        for row in np.stack([found.minimum[0], found.maximum[0], least, of.upper[0]], axis=1)
    ]
    errors = [None if of.error is None else float(of.error[0, k]) for k in range(len(units))]
    largest = largest_by_unit(
        (value, unit) for unit, values in zip(units, columns, strict=True) for value in values
    )
    shown = [
        [engineering(value, unit, beside=largest[unit]) for value in values]
        for unit, values in zip(units, columns, strict=True)
    ]
    rows = [(name, *values) for name, values in zip(found.outputs, shown, strict=True)]
    of_least = "least not below" if tried is None else "least peak of motions tried"
    lines = [
        f"{name:>14}  {low:>12}  {high:>12}   {most}{beyond(error, name)}; {of_least} {least}\n"
        for (name, low, high, least, most), error in zip(rows, errors, strict=True)
    ]
    effort = "eigen-analyses" if found.method == "modal" else "trajectories"
    cost = (
        f"{found.method}: {found.trajectories} {effort}, {found.seconds:.1f} s, bounds"
        f" {found.nature}{error_in_words(found)}"
    )
    head = (
        "        output           min           max   greatest peak at nodes   (α ="
        f" {found.alpha[0]:g}, nodes every {found.time[1]:g} s)\n"
    )
    claim = f"{found.facts['claim']}\n" if "claim" in found.facts else ""
    lines.append(f"{cost}\n{unproved(found)}{proved(found, own_gap=own_gap)}{claim}")
    return f"{head}{''.join(lines)}"


def unproved(found: Envelope) -> str:
    """Line on why bounds are estimated, where a proof would have been tried; empty elsewhere."""
    reason = found.facts.get("unproved", "")
    return f"{found.nature}, not proved: {reason}\n" if reason else ""


def beyond(error: float | None, output: str) -> str:
    """Words on how far a peak may lie outside its bounds."""
    if error is None:
        return ""
    return f", between nodes up to {engineering(error, Output(output).unit, digits=2)} more"


def error_in_words(found: Envelope) -> str:
    """The largest estimated error of each output; empty where none was estimated."""
    if found.error is None:
        return ""
    largest = zip(found.outputs, found.error.max((0, 1)), strict=True)
    words = ", attained to within " if "gap" in found.facts else ", error up to "
    return words + ", ".join(
        f"{engineering(float(value), Output(name).unit, digits=2)} of {name}"
        for name, value in largest
    )


def proved(found: Envelope, *, own_gap: bool) -> str:
    """Line on the certificate; empty without one. `own_gap`: the program chose what gap to ask."""
    if found.proved_lower is not None and found.proved_upper is not None:
        ends = zip(
            found.outputs, found.proved_lower[0].min(0), found.proved_upper[0].max(0), strict=True
        )
        words = (
            f"{name} {' … '.join(engineering(float(x), Output(name).unit) for x in pair)}"
            for name, *pair in ends
        )
        return f"guaranteed bounds of the exact motion: {', '.join(words)}\n"
    if "gap" not in found.facts:
        return ""
    of = str(found.facts["gap_output"])
    gap = engineering(float(found.facts["gap"]), Output(of).unit)
    asked = " (asked of the proof by the program itself)" if own_gap else ""
    return f"every node's bounds enclosed to within {gap} of {of}{asked}; {found.facts['proof']}\n"
