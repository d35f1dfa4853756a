"""Command ``check``: a case before it runs, and how it was read."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import TextIO

from alphacut.base.errors import RefusedError
from alphacut.base.number_text import text_table
from alphacut.commands.options import read_case, write_answer
from alphacut.io.files import say


def check(options: argparse.Namespace, out: TextIO) -> int:
    """Check a case, and show how it was read.

    All that stages need is read and built.

    Args:
        options: Of the command line: the case file `case` with its changes `set`, PETSc's options
            `petsc`, `json` and `quiet`.
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
        percolation_text,
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
    keys = ("key", "value", "kind")
    text = text_table(keys, rows)
    text += "".join(f"warning: {doubt}\n" for doubt in doubts(content, rows, structure))
    if study is not None:
        phases = (f"{name} {fraction:.2%}" for name, fraction in study.fractions.items())
        text += f"image: {study.extent}\nphases: {', '.join(phases)}\n"
        if study.percolation is not None:
            text += percolation_text(study.percolation)
    document: dict[str, object] = {
        "case": options.case,
        "stages": list(content.stages),
        "period_s": None,
        "modes": None,
        "inputs": [dict(zip(keys, row, strict=True)) for row in rows],
    }
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
        document["period_s"] = float(modes.periods[0])
        section = content.structure_section
        others: list[NominalModes] = []
        if section is not None and isinstance(structure.linear, MatrixStructure):
            text += matrices_text(structure.linear, section.places, modes)
            patterns = [pattern for _, pattern in structure.linear.components]
            others = [nominal_modes(replace(structure.linear, pattern=x)) for x in patterns]
        is_shaken = content.records is not None or structure.linear.ground is not None
        text += modes_text(modes, others, is_shaken=is_shaken)
        text += motion_text(content, structure, records)
    if options.quiet or options.json == "-":
        # Nobody reads the text then: warnings go to standard error, as those of other commands.
        for line in text.splitlines():
            if line.startswith("warning: "):
                say(line)
    write_answer(options, document, out, f"{text}{options.case}: no problems\n")
    return 0
