"""Command ``check``: a case before it runs, how it was read and what a run of it will compute."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import pi
from typing import TYPE_CHECKING, TextIO

from alphacut.base.errors import FailedError, RefusedError
from alphacut.base.number_text import engineering, text_table
from alphacut.commands.options import read_case, write_answer
from alphacut.fuzzy.campaign.call import CampaignError
from alphacut.io.files import say

if TYPE_CHECKING:
    from alphacut.case.content import Content
    from alphacut.commands.pieces import Foreseen


def check(options: argparse.Namespace, out: TextIO) -> int:
    """Check a case, show how it was read, and count what a run of it will compute.

    All that stages need is read and built. With `time` small parts of their work are timed as well.

    Args:
        options: Of the command line: the case file `case` with its changes `set`, PETSc's options
            `petsc`, `time`, `json` and `quiet`.
        out: Takes the text, or the JSON document with ``--json -``.

    Returns:
        Exit status 0.

    Raises:
        BadInput: The case is not valid.
        RefusedError: What a stage needs does not fit.
        FailedError: What a stage needs cannot be built.
    """
    content = read_case(options).content
    # A case that is refused needs none of what stages and responses import.
    from alphacut.commands.case_text import (
        doubts,
        doubts_before_refusal,
        rows_of,
        structure_of_envelope,
    )
    from alphacut.commands.required import require_runnable

    rows = list(rows_of("", content))
    try:
        study, records = require_runnable(content)
        structure = structure_of_envelope(content)
    except RefusedError:
        # A wrong unit may be the cause of what is refused, and is shown before it.
        for doubt in doubts_before_refusal(content, rows):
            say(f"warning: {doubt}")
        raise
    if content.image_cell is not None and study is None:
        from alphacut.stages.image import study_of  # whose solvers take time to import

        study = study_of(content.image_cell)
    text = text_table(("key", "value", "kind"), rows)
    text += "".join(f"warning: {doubt}\n" for doubt in doubts(content, rows, structure))
    if study is not None:
        phases = (f"{name} {fraction:.2%}" for name, fraction in study.fractions.items())
        text += f"image: {study.extent}\nphases: {', '.join(phases)}\n"
    document: dict[str, object] = {"case": options.case, "stages": list(content.stages)}
    document |= {"period_s": None, "modes": None}
    if structure is not None and structure.linear is not None:
        from alphacut.commands.motion_text import (
            matrices_text,
            modes_document,
            modes_text,
            motion_text,
        )
        from alphacut.frame import MatrixStructure
        from alphacut.frame.structures.linear import NominalModes, nominal_modes

        modes = nominal_modes(structure.linear)
        document["modes"] = modes_document(modes)
        document["period_s"] = 2 * pi / float(modes.frequencies[0])
        section = content.structure_section
        others: list[NominalModes] = []
        if section is not None and isinstance(structure.linear, MatrixStructure):
            text += matrices_text(structure.linear, section.places, modes)
            for _, influence in structure.linear.components:
                others.append(nominal_modes(replace(structure.linear, pattern=influence)))
        is_shaken = content.records is not None or structure.linear.ground is not None
        text += modes_text(modes, others, is_shaken=is_shaken)
        text += motion_text(content, structure, records)
    keys = ("key", "value", "kind")
    document["inputs"] = [dict(zip(keys, row, strict=True)) for row in rows]
    if not options.quiet and options.json != "-":
        # All that is known at once is shown before parts of the work are timed for seconds.
        out.write(text)
        out.flush()
    else:
        # Nobody reads the text then: warnings go to standard error, as those of other commands.
        for line in text.splitlines():
            if line.startswith("warning: "):
                say(line)
    last_lines = f"{options.case}: no problems\n"
    if options.json or not options.quiet:
        from alphacut.commands.pieces import pieces_of  # of plans, which take time to import

        failure = ""
        if options.time:
            foreseen, failure = foreseen_stages(content, options.petsc)
        else:
            foreseen = list(pieces_of(content, options.petsc))
        document["foreseen"] = [stage._asdict() for stage in foreseen]
        last_lines = foreseen_text(foreseen) + failure + last_lines
    write_answer(options, document, out, last_lines)
    return 0


def foreseen_stages(content: Content, petsc: Mapping[str, str]) -> tuple[list[Foreseen], str]:
    """Return what the stages of a run will take, and a warning if a part that was tried failed.

    Args:
        content: The case.
        petsc: PETSc's options without their prefix.

    Returns:
        An entry for each stage until the first one that fails; and the warning as a line, else "".
    """
    from alphacut.commands.foresee import foresee  # it imports all stages, which takes time

    found: list[Foreseen] = []
    try:
        found.extend(foresee(content, petsc))
    except (FailedError, RefusedError, CampaignError) as error:
        # The case is valid: a shortened part of the work may fail where the whole does not.
        return found, f"warning: work that was begun to foresee its time failed: {error}\n"
    return found, ""


def foreseen_text(foreseen: Sequence[Foreseen]) -> str:
    """Return a text table of what the stages of a run will compute, and how long it will take.

    Args:
        foreseen: The stages. Either all of them have a time, or none.

    Returns:
        Lines that end with a newline: the table and the sum of the times, or in its place the
        option that times the stages. Empty without stages.
    """
    if not foreseen:
        return ""
    counts = []
    for x in foreseen:
        number = "" if x.number is None else f"{x.number:,} "
        counts.append((x.stage, f"{number}{x.pieces}"))
    times = [x.seconds for x in foreseen if x.seconds is not None]
    if not times:
        return f"{text_table(('stage', 'pieces'), counts)}with --time: how long a run will take\n"
    rows = [
        (*count, f"{engineering(seconds, '', digits=2)} s")
        for count, seconds in zip(counts, times, strict=True)
    ]
    text = text_table(("stage", "pieces", "about, by one process"), rows)
    return f"{text}a run takes about {engineering(sum(times), '', digits=2)} s, without figures\n"
